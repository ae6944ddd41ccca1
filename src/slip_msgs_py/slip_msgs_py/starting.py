"""Nodes that are still being imported: the first time on a machine that compiles their formulas, for a minute or more.

Each holds a lock until then, so that a node that waits for another does not give it up before it has begun.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import tempfile
from collections.abc import Iterator
from typing import IO


def _file() -> IO[bytes] | None:
    path = os.path.join(tempfile.gettempdir(), f"slip_vic_starting.{os.getuid()}")
    try:
        return open(os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o600), "rb")
    except OSError:  # a lock is a courtesy: without it, patience ends as it is set
        return None


@contextlib.contextmanager
def starting() -> Iterator[None]:
    """Show other processes of this user that this one is still being imported."""
    lock = _file()
    if lock is None:
        yield
        return
    with lock:
        fcntl.flock(lock, fcntl.LOCK_SH)
        yield


def somebody_starts() -> bool:
    """Return whether a process of this user is still being imported."""
    lock = _file()
    if lock is None:
        return False
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return True
        return False
