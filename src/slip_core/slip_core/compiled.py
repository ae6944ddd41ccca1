"""What is compiled, how it is marked, and where machine code comes from: a wheel contains it, a clone caches it.

What is compiled is what is read: the same functions run in Python with NUMBA_DISABLE_JIT=1, to the same bits.
Arithmetic is strict IEEE (no fast-math, no fused operations, no linear algebra library), so results depend neither on
the instruction set nor on where the code was compiled. `compiler` calls numba and is imported only to compile.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib
import importlib.metadata
import importlib.util
import os
import platform
import re
import stat
import sys
from collections.abc import Callable
from importlib.machinery import ExtensionFileLoader, ModuleSpec
from pathlib import Path
from typing import Any, Final, TypeVar, cast

from slip_core.errors import InputError

F = TypeVar("F", bound=Callable[..., Any])


VOID, REAL, INT, BOOL = "void", "float64", "int64", "boolean"
"""Types of arguments and results, in numba's notation."""
IN1, IN2 = "Array(float64, 1, 'C', readonly=True)", "Array(float64, 2, 'C', readonly=True)"
"""Vector and matrix (by rows) that a kernel only reads; arrays that are read-only, and others too, fit."""
OUT1, OUT2 = "Array(float64, 1, 'C')", "Array(float64, 2, 'C')"
WHOLE1 = "Array(int64, 1, 'C', readonly=True)"
IN2_F = "Array(float64, 2, 'F', readonly=True)"
"""Matrix by columns, as Eigen has them."""

LIBRARY: Final = "kernels"
INTERPRETED: Final = os.environ.get("NUMBA_DISABLE_JIT") == "1"
KERNELS: Final[dict[Path, dict[str, Any]]] = {}
"""The kernels that numba has compiled, by the folder of their package and by name."""
CARRIED: Final[dict[object, Callable[[], Any]]] = {}
"""What compiles a kernel of the wheel's library with numba, for compiled code that calls it."""


def kernel(result: str, *arguments: str) -> Callable[[F], F]:
    """Return a decorator that replaces a function by its machine code for these types when its module is imported.

    The code comes from the library in the package's folder if that was built from the same sources. Otherwise the
    function is compiled and cached in the user's cache folder, under a name that changes with every source it can
    depend on: stale code is never used, and installations of the same sources share it. A folder that another user can
    write to is refused, because its content is executed.
    """

    def found(function: F) -> F:
        if INTERPRETED:
            return function
        package = package_of(function)
        carried = _library(package).get(_name(function))
        make = functools.cache(lambda: compiler().keep(function, f"{result}({', '.join(arguments)})"))
        if carried is None:
            carried = KERNELS.setdefault(package, {})[_name(function)] = make()
        else:
            CARRIED[carried] = make
        return cast(F, carried)

    return found


def part(function: F) -> F:
    """Mark a function that only kernels call: it becomes part of them."""
    return function if INTERPRETED else cast(F, Part(function))


class Part:
    """A function that becomes part of the kernels that call it. Called from Python, it is compiled on its own."""

    def __init__(self, function: Callable[..., Any]) -> None:
        functools.update_wrapper(self, function)
        self.py_func = function

    @property
    def _numba_type_(self) -> Any:  # numba reads it
        return compiler().types.Dispatcher(compiler().inlined(self.py_func))

    @functools.cached_property
    def _alone(self) -> Callable[..., Any]:
        return cast(Callable[..., Any], compiler().keep(self.py_func))

    def __call__(self, *arguments: Any) -> Any:
        """Return what the function returns."""
        return self._alone(*arguments)


def interpreted(function: F) -> F:
    """Return the Python function of a part, with the same bits: for rare calls, so that nodes do not import numba."""
    return cast(F, getattr(function, "py_func", function))


def compiler() -> Any:
    """Return the module that compiles, which takes a second to import."""
    return importlib.import_module("slip_core.compiler")


@functools.cache
def _library(package: Path) -> dict[str, Any]:
    """Return the kernels in a package's library, by name; none if it has other sources or needs a newer libc."""
    with contextlib.suppress(ImportError):
        if any(package.glob(f"{LIBRARY}-*.so")):  # a clone has none and needs no digest
            loader = ExtensionFileLoader(LIBRARY, str(library_path(package)))
            module = loader.create_module(ModuleSpec(LIBRARY, loader, origin=loader.path))
            loader.exec_module(module)
            return vars(module)
    return {}


def library_path(package: Path) -> Path:
    """Return the path of the library of a package's kernels, which may be absent; its name changes with the sources."""
    return package / f"{LIBRARY}-{platform.machine()}-{_digest(package)}.so"


def _name(function: Callable[..., Any]) -> str:
    """Return the name of a kernel: its module, its own name, and the names in its closure."""
    enclosed = (getattr(cell.cell_contents, "__name__", "") for cell in function.__closure__ or ())
    return " ".join((function.__module__, function.__qualname__, *enclosed)).strip()


@functools.lru_cache
def code_folder(package: Path) -> Path:
    """Return the folder of a package's compiled code; its name changes with Python, numba and the sources."""
    made_of = f"{importlib.metadata.version('numba')} {sys.implementation.cache_tag} {_digest(package)}"
    folder = user_cache() / f"{package.name}-{hashlib.sha256(made_of.encode()).hexdigest()[:16]}"
    if not folder.exists():
        print(f"compiling {package.name} for this machine, once", file=sys.stderr, flush=True)
    make_folder(folder)
    check_private(folder, os.geteuid())
    return folder


def check_private(folder: Path, user: int) -> None:
    """See that a folder belongs to a user, and that no other can write to it.

    Raises:
        InputError: it is not so.
    """
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != user or stat.S_IMODE(found.st_mode) & 0o022:
        got = f"owner {found.st_uid}, {stat.filemode(found.st_mode)}"
        expected = "a folder to which this user alone can write, since what lies in it is run"
        raise InputError(f"machine code in {folder}", got=got, expected=expected, fix="remove it")


@functools.cache
def _digest(package: Path) -> str:
    """Return a digest of the modules that import this one, here or in imported packages, and of their imports."""
    texts = _texts(package) | _texts(Path(__file__).parent)
    wanted, left = set[str](), _compiling(texts)
    while left:
        name = left.pop()
        top = name.partition(".")[0]
        if name not in texts and not any(known.partition(".")[0] == top for known in texts):
            found = importlib.util.find_spec(top)
            more = _texts(Path(found.origin).parent) if found is not None and found.origin is not None else {}
            texts |= more
            left += _compiling(more)
        if name in wanted or name not in texts:
            continue
        wanted.add(name)
        for module, names in _IMPORT.findall(texts[name].decode()):
            left += [module, *(f"{module}.{item}" for item in re.findall(r"\w+", names))]
    return hashlib.sha256(b"".join(texts[name] for name in sorted(wanted))).hexdigest()[:16]


def _compiling(texts: dict[str, bytes]) -> list[str]:
    """Return which modules import this one: all count, since what is imported by a name in a variable is not seen."""
    return [name for name, text in texts.items() if b"slip_core.compiled" in text]


def _texts(top: Path) -> dict[str, bytes]:
    """Return the text of every module of a package by its name."""
    return {
        ".".join((top.name, *path.relative_to(top).with_suffix("").parts)): path.read_bytes()
        for path in top.rglob("*.py")
    }


_IMPORT = re.compile(r"^from (slip_[\w.]+) import (\([^)]*\)|[^\n]*)", re.MULTILINE)


def package_of(function: Callable[..., Any]) -> Path:
    """Return the folder of the top package of a function."""
    folder = Path(function.__code__.co_filename).resolve(strict=True).parent
    while (folder.parent / "__init__.py").exists():
        folder = folder.parent
    return folder


def make_folder(folder: Path) -> None:
    """Make a folder of the user's cache, for this user alone, where it is not there.

    Raises:
        InputError: it cannot be made.
    """
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        expected, fix = "a folder that can be made", "set XDG_CACHE_HOME to one of yours"
        raise InputError(f"cache {folder}", got=error, expected=expected, fix=fix) from None


def user_cache() -> Path:
    """Return the folder of this user's caches of the suite; see `make_folder`."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "slip_vic"
