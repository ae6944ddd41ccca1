"""Find files by ``package://`` URI or path, whether installed, editable or in a colcon overlay."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import resource
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Final

from slip_core.errors import InputError, SlipVicError

PACKAGES: Final = "SLIP_VIC_PACKAGES"
"""Environment variable with folders of packages, ``NAME=DIR`` separated like paths: option --package sets it, and the
processes that are started inherit it."""

MAX_BYTES: Final = 512 << 20
"""Bytes that what a file becomes may take of memory."""
MAX_TEXT: Final = MAX_BYTES // 16
"""Bytes of a text: what a parser makes of it takes several times as much."""


@contextlib.contextmanager
def bounded_memory(what: str, expected: str = "a file as this suite writes it") -> Iterator[None]:
    """Let the process take at most `MAX_BYTES` more in the block, if it has no other thread that could run into it.

    Args:
        what: names the file that is read in the block.
        expected: what it should be.

    Raises:
        InputError: it needs more, or anything goes wrong in the block but what the system refuses.
    """
    taken = int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    most = min(taken + MAX_BYTES, soft % 2**64) if threading.active_count() == 1 else soft  # soft: -1 without a limit
    try:
        resource.setrlimit(resource.RLIMIT_DATA, (most, hard))
        report, sys.unraisablehook = sys.unraisablehook, callable  # a generator that cannot close is not reported
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))
            sys.unraisablehook = report
    except OSError:
        raise
    except Exception as error:  # a file may hold anything
        cause: BaseException | None = error
        while not (isinstance(cause, MemoryError | None) or "out of memory" in str(cause)):
            cause = cause.__context__
        if cause is None and isinstance(error, SlipVicError):
            raise
        if cause is None:
            raise InputError(what, got=str(error) or type(error).__name__, expected=expected) from error
        got = f"more than memory may hold: {MAX_BYTES >> 20} MiB, or ulimit"
        raise InputError(what, got=got, expected="a smaller file") from None


def read_text(uri: str, what: str) -> str:
    """Return the text behind ``package://<package>/<path>`` or a plain path.

    Raises:
        InputError: where the package or the file does not exist or cannot be read.
    """
    try:
        with open_file(find_file(uri), what) as file:
            data = file.read(MAX_TEXT + 1)
        if len(data) > MAX_TEXT:
            raise ValueError(f"more than {MAX_TEXT} bytes")
        return data.decode("utf-8")
    except (OSError, ValueError) as error:
        raise _unreadable(what, uri, error) from None


def open_file(path: Path, what: str) -> IO[bytes]:
    """Open a regular file for reading; a FIFO would block, and a device need not end.

    Raises:
        InputError: not readable, or not a regular file.
    """
    try:
        if path.exists() and not path.is_file():
            raise InputError(what, got="no regular file", expected="a readable file")
        return path.open("rb")
    except (OSError, ValueError) as error:
        raise _unreadable(what, str(path), error) from None


def _unreadable(what: str, uri: str, error: Exception) -> InputError:
    """Return the error of a file that cannot be read; what: may name it already."""
    why = getattr(error, "strerror", None) or ("binary data" if isinstance(error, UnicodeError) else str(error))
    return InputError(what, got=why if uri in what else f"{uri}: {why}", expected="a readable file")


def find_file(uri: str) -> Path:
    """Return the path behind ``package://<package>/<path>``, ``file://<path>`` or a plain path; it need not exist.

    Raises:
        InputError: no such package.
    """
    if not uri.startswith("package://"):
        return Path(uri.removeprefix("file://"))
    package, _, inner = uri.removeprefix("package://").partition("/")
    folders = list(_folders(package))
    if not folders:
        fix = f"--package {package}=DIR"
        raise InputError(f"package {package}", got="no such package", expected="one that is installed", fix=fix)
    return next((folder / inner for folder in folders if (folder / inner).exists()), folders[0] / inner)


def add_package(text: str) -> None:
    """Make a package known to this process and to those that it starts; text: NAME=DIR.

    Raises:
        InputError: another form, or no such folder.
    """
    name, _, folder = text.partition("=")
    if not name or not folder:
        raise InputError("--package", got=text, expected="NAME=DIR")
    if not Path(folder).is_dir():
        raise InputError(f"--package {name}", got=folder, expected="a folder")
    known = os.environ.get(PACKAGES, "")
    os.environ[PACKAGES] = os.pathsep.join(filter(None, (f"{name}={Path(folder).absolute()}", known)))


def _folders(package: str) -> Iterator[Path]:
    """Yield the folders that a package may be in: those named by --package, then of ROS, then of Python."""
    given = (item.partition("=") for item in os.environ.get(PACKAGES, "").split(os.pathsep))
    candidates = [Path(folder) for name, _, folder in given if name == package]
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    candidates += [Path(prefix, "share", package) for prefix in prefixes if prefix]
    try:
        spec = importlib.util.find_spec(package) if package.isidentifier() else None
    except (ImportError, ValueError):
        spec = None
    inside = [Path(folder) for folder in (spec.submodule_search_locations if spec else None) or ()]
    beside = (parent / "share" / package for folder in inside for parent in folder.parents)  # of wheels and conda
    yield from (candidate for candidate in (*candidates, *inside, *beside) if candidate.is_dir())
