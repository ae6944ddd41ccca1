"""Lock files: one process holds the lock, others wait or choose another file; a lock ends with its process."""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Callable, Iterator
from pathlib import Path

from slip_core.errors import InputError


class TakenError(Exception):
    """Another process has the lock; the text names it."""


@contextlib.contextmanager
def locked(path: Path, waits: Callable[[str], object] | None = None) -> Iterator[None]:
    """Hold the lock of a file while the block runs. The file names this process to others.

    Args:
        path: of the file; it is made where it does not exist.
        waits: takes the name of the process that has the lock, before this one waits for it; None: it does not wait.

    Raises:
        TakenError: another process has the lock, and `waits` is None.
        OSError: the file cannot be written.
    """
    with path.open("a+") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            file.seek(0)
            owner = file.read().strip() or "another process"
            if waits is None:
                raise TakenError(owner) from None
            waits(owner)
            fcntl.flock(file, fcntl.LOCK_EX)
        file.truncate(0)
        file.write(f"process {os.getpid()} on {os.uname().nodename}\n")
        file.flush()
        yield


@contextlib.contextmanager
def own_folder(folder: Path) -> Iterator[None]:
    """Make an output folder, and keep other commands out of it while the block runs.

    Raises:
        InputError: another command writes there, or nothing can be written.
    """
    with contextlib.ExitStack() as kept:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            kept.enter_context(locked(folder / ".lock"))
            kept.callback((folder / ".lock").unlink, missing_ok=True)
        except OSError as error:
            raise InputError(f"--out {folder}", got=error, expected="a folder that can be written") from None
        except TakenError as owner:
            expected, fix = "a folder of its own for each command", "wait for it, or give another folder"
            raise InputError(f"--out {folder}", got=f"in use by {owner}", expected=expected, fix=fix) from None
        yield


def is_locked(path: Path) -> bool:
    """Return whether a process has the lock of a file."""
    with path.open() as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False
