"""The only module that calls the compiler: formulas of a control cycle as machine code, made once and kept.

What is compiled is what is read: the same functions run in Python with NUMBA_DISABLE_JIT=1, to the same bits.
Compilation is strict IEEE arithmetic (no fast-math, no fused operations, no linear algebra library), so results do not
depend on the instruction set of the machine.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.util
import os
import pickle
import re
import stat
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core import config
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from slip_core.errors import InputError
from slip_core.part_compiler import STRICT, Part

F = TypeVar("F", bound=Callable[..., Any])

VOID, REAL, INT = numba.types.void, numba.types.float64, numba.types.int64
IN1, IN2 = (numba.types.Array(REAL, dimensions, "C", readonly=True) for dimensions in (1, 2))
"""Vector and matrix (by rows) that a kernel only reads; arrays that are read-only, and others too, fit."""
OUT1, OUT2 = (numba.types.Array(REAL, dimensions, "C") for dimensions in (1, 2))
WHOLE1 = numba.types.Array(INT, 1, "C", readonly=True)
BOOL = numba.types.boolean
IN2_F = numba.types.Array(REAL, 2, "F", readonly=True)
"""Matrix by columns, as Eigen has them."""


def kernel(signature: object) -> Callable[[F], F]:
    """Return a decorator that compiles a function for one signature when its module is imported.

    The machine code is kept in the user's cache folder under a name that changes with every source it can depend on:
    a stale one is never used, and installations of the same sources share one. A folder that another user can write to
    is not used either, because what lies there is run.

    Args:
        signature: for instance VOID(IN1, IN2, INT, OUT1), or text in numba's notation.
    """

    def compile_now(function: F) -> F:
        return cast(F, _kept(function, signature))

    return compile_now


def part(function: F) -> F:
    """Mark a function that only kernels call: it becomes part of them."""
    return function if config.DISABLE_JIT else cast(F, Part(function, _kept))


def _kept(function: Callable[..., Any], *signatures: object) -> Callable[..., Any]:
    """Return a function compiled for a signature now, or for that of each first call; the machine code is kept."""
    made = numba.njit(**STRICT)(function)
    if not config.DISABLE_JIT:
        made._cache = _MachineCode(function)
        for signature in signatures:
            made.compile(signature)
            made.disable_compile()
    return cast(Callable[..., Any], made)


class _MachineCode(NullCache):  # type: ignore[misc]
    """The machine code of a function on disk: one file per signature, written atomically.

    numba's own cache numbers the files of a function and lists them in an index. If two processes add to it at once,
    each may write its code to the file that the index lists for the other's signature.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        code = function.__code__
        path = Path(code.co_filename).resolve(strict=True)
        package = _package(path)
        enclosed = dumps(tuple(cell.cell_contents for cell in function.__closure__ or ()))
        self._key = str(path.relative_to(package)), function.__qualname__, code.co_firstlineno, enclosed
        self._begin = code_folder(package) / function.__name__

    def load_overload(self, signature: object, target: Any) -> CompileResult | None:
        """Return the code of a signature, None if there is none."""
        target.refresh()
        try:
            kept = pickle.loads(self._path(signature, target.codegen()).read_bytes())
        except FileNotFoundError:
            return None
        return CompileResult._rebuild(target, *kept)

    def save_overload(self, signature: object, compiled: CompileResult) -> None:
        """Write the code of a signature."""
        if not compiled.library.has_dynamic_globals:
            path = self._path(signature, compiled.codegen)
            unfinished = path.with_suffix(f".{os.getpid()}")
            unfinished.write_bytes(dumps(compiled._reduce()))
            unfinished.replace(path)

    def _path(self, signature: object, codegen: Any) -> Path:
        key = repr((self._key, signature, codegen.magic_tuple()))
        return self._begin.with_name(f"{self._begin.name}-{hashlib.sha256(key.encode()).hexdigest()}.code")


@functools.lru_cache
def code_folder(package: Path) -> Path:
    """Return the folder of a package's machine code: its name changes with Python, numba and all its sources."""
    digest = hashlib.sha256(f"{numba.__version__} {sys.implementation.cache_tag}".encode())
    for text in _sources(package):
        digest.update(text)
    folder = user_cache() / f"{package.name}-{digest.hexdigest()[:16]}"
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


def _sources(package: Path) -> list[bytes]:
    """Return the texts of all modules that import this one, here or where imports lead, and of what they import."""
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
    return [texts[name] for name in sorted(wanted)]


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


def _package(path: Path) -> Path:
    """Return the folder of the top package of a module."""
    folder = path.parent
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
