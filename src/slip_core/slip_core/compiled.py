"""What is compiled, how it is marked, and where its machine code is: a wheel carries it, a clone makes and keeps it.

What is compiled is what is read: the same functions run in Python with NUMBA_DISABLE_JIT=1, to the same bits.
Arithmetic is strict IEEE (no fast-math, no fused operations, no linear algebra library), so results depend neither on
the instruction set of the machine nor on who compiled. `compiler` calls numba; it is imported where something compiles.
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
"""How numba compiles a kernel that the installation carries, for compiled code that calls it."""


def kernel(result: str, *arguments: str) -> Callable[[F], F]:
    """Return a decorator that gives the machine code of a function for these types when its module is imported.

    It is that of the library in the package's folder if the library was made of the same sources. Otherwise the
    function is compiled, and its machine code kept in the user's cache folder under a name that changes with every
    source it can depend on: a stale one is never used, and installations of the same sources share one. A folder that
    another user can write to is not used either, because what lies there is run.
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
    """A function that kernels take in. Called from Python it works too, as a compiled function of its own."""

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


def compiler() -> Any:
    """Return the module that compiles: it takes a second to import."""
    return importlib.import_module("slip_core.compiler")


@functools.cache
def _library(package: Path) -> dict[str, Any]:
    """Return the kernels that a package carries as machine code, by name: of these sources, for this libc or older."""
    with contextlib.suppress(ImportError):
        if any(package.glob(f"{LIBRARY}-*.so")):  # a clone has none, and no need of a digest
            loader = ExtensionFileLoader(LIBRARY, str(library_path(package)))
            module = loader.create_module(ModuleSpec(LIBRARY, loader, origin=loader.path))
            loader.exec_module(module)
            return vars(module)
    return {}


def library_path(package: Path) -> Path:
    """Return where the library of a package's kernels is, if it has one: the name changes with all its sources."""
    return package / f"{LIBRARY}-{platform.machine()}-{_digest(package)}.so"


def _name(function: Callable[..., Any]) -> str:
    """Return the name of a kernel: of its module, its own, and of what it is made for."""
    enclosed = (getattr(cell.cell_contents, "__name__", "") for cell in function.__closure__ or ())
    return " ".join((function.__module__, function.__qualname__, *enclosed)).strip()


@functools.lru_cache
def code_folder(package: Path) -> Path:
    """Return the folder of what numba has compiled of a package: its name changes with Python, numba and sources."""
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
    """Return a digest of all modules that import this one, here or where imports lead, and of what they import."""
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
