"""The text of a URDF from a file; a xacro file is expanded by the `xacro` package, which needs no ROS.

A xacro file is a program: it reads files and evaluates expressions. Expand only those that you would run.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from slip_core.errors import InputError
from slip_core.files.resources import bounded_memory, find_file, open_file, read_text
from slip_core.grasp_params import ArmParams

SUFFIX: Final = ".xacro"


def arm_urdf(params: ArmParams) -> str:
    """Return the URDF of an arm, on its own base.

    Raises:
        InputError: as in `read_urdf`.
    """
    return params.robot_description or read_urdf(params.robot_description_file, "parameter robot_description_file")


def read_urdf(uri: str, what: str, arguments: Mapping[str, str] | None = None) -> str:
    """Return the URDF text behind ``package://<package>/<path>`` or a plain path, expanded where it is ``*.xacro``.

    ``$(find NAME)`` is as in `find_file`.

    Args:
        uri: of the file.
        what: names it in errors.
        arguments: of a xacro file; others have their defaults.

    Raises:
        InputError: a file or package that is not there, or a xacro file that cannot be expanded.
    """
    open_file(find_file(uri), what).close()
    if uri.endswith(SUFFIX):
        return bounded_memory(what)(_expanded)(find_file(uri), what, arguments or {})
    if arguments:
        raise InputError(what, got=f"arguments {', '.join(arguments)}", expected=f"a file *{SUFFIX}, which takes them")
    return read_text(uri, what)


def _expanded(path: Path, what: str, arguments: Mapping[str, str]) -> str:
    try:
        import xacro
        from xacro import substitution_args
    except ImportError:
        raise InputError(what, got=str(path), expected="the package that expands it", fix="pip install xacro") from None
    declared = ""
    try:
        # It opens what a file includes by itself, and would wait for a FIFO; a missing file stays its own error.
        xacro.open = lambda path: open_file(Path(path), path) if Path(path).exists() else Path(path).stat()
        xacro.init_stacks(str(path))
        document = xacro.parse(None, str(path))
        declared = _declared(document.getElementsByTagName("xacro:arg"), arguments)
        with _finding(substitution_args):
            xacro.process_doc(document, mappings=dict(arguments))
        return str(document.toxml())
    except InputError:
        raise
    except Exception as error:  # expressions and macros of the file run here: anything may happen
        if isinstance(getattr(error, "exc", None), InputError):
            raise error.exc from None  # type: ignore[attr-defined]
        detail = " ".join(str(error).split()) or type(error).__name__
        expected = f"a xacro file that can be expanded{declared if 'arg' in detail else ''}"
        raise InputError(what, got=str(path), expected=expected, fix=detail[:300]) from None


def _declared(declarations: Iterable[Any], given: Mapping[str, str]) -> str:
    """Return in words which arguments a xacro file declares; one without a default has its given value for one.

    `xacro` itself accepts no argument without a default.
    """
    words = []
    for one in declarations:
        name = one.getAttribute("name")
        words.append(f"{name} (default {one.getAttribute('default')!r})" if one.hasAttribute("default") else name)
        if name in given and not one.hasAttribute("default"):
            one.setAttribute("default", given[name])
    return f"; --arg NAME:=VALUE gives its arguments: {', '.join(words)}" if words else ""


@contextlib.contextmanager
def _finding(module: object) -> Iterator[None]:
    """Let ``$(find NAME)`` go to `find_file`: xacro itself uses only ament, which may be missing beside a wheel."""

    def find(name: str) -> str:
        return str(find_file(f"package://{name}"))

    expressions = module._eval_dict  # type: ignore[attr-defined]
    own = module._eval_find, expressions["find"]  # type: ignore[attr-defined]
    module._eval_find = expressions["find"] = find  # type: ignore[attr-defined]
    try:
        yield
    finally:
        module._eval_find, expressions["find"] = own  # type: ignore[attr-defined]
