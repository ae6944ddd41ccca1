"""A ROS_DOMAIN_ID of one's own: locked while in use, so that a user's runs on one machine never hear each other.

The lock is a file because it must hold across network namespaces; the sockets of ROS's `domain_coordinator` do not.
"""

from __future__ import annotations

import contextlib
import fcntl
import itertools
import os
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from slip_core.errors import InputError, ProtocolError

# Above 101 the DDS ports reach into Linux's ephemeral range; 0 is everybody's default.
FIRST, LAST = 1, 101
_turns = itertools.count(os.getpid())  # the next run gets the next domain: nothing of the last one is under way


@contextlib.contextmanager
def domain_id(wanted: int | None = None) -> Iterator[int]:
    """Hold a domain id: the wanted one, whoever else holds it, or one that no other run of this suite holds.

    Raises:
        InputError: where the folder of the locks cannot be made.
        ProtocolError: where all ids are taken, or locks cannot be written.
    """
    count, turn = LAST - FIRST + 1, next(_turns)
    free = [FIRST + (turn + offset) % count for offset in range(count)]
    for candidate in free if wanted is None else [wanted]:
        with _lock_file(candidate) as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                if wanted is None:
                    continue
            os.utime(lock.fileno())
            yield candidate
            return
    raise ProtocolError(f"all ROS domain ids from {FIRST} to {LAST} are in use by other runs; give --domain-id")


def _lock_file(domain: int) -> IO[str]:
    """Open the file whose lock is held by the run in a domain.

    Raises:
        InputError: its folder cannot be made.
        ProtocolError: it cannot be written.
    """
    from slip_core.compiled import make_folder  # numba takes a second to load

    path = _folder() / str(domain)
    make_folder(path.parent)
    try:
        return path.open("a")
    except OSError as error:
        raise ProtocolError(f"lock {path}: {error.strerror}; set XDG_CACHE_HOME to a folder of yours") from None


def domains_in_use() -> list[int]:
    """Return the domain ids that this user's runs of the suite hold, the newest first."""
    found = []
    for path in _folder().glob("*"):
        with path.open() as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                found.append((path.stat().st_mtime, int(path.name)))
    return [domain for _, domain in sorted(found, reverse=True)]


def chosen_domain(option: int | None) -> int | None:
    """Return the domain id of ``--domain-id`` or else of ROS_DOMAIN_ID; None where neither is given.

    Raises:
        InputError: where DDS has no ports for it.
    """
    text = os.environ.get("ROS_DOMAIN_ID", "").strip() if option is None else str(option)
    if text and not (text.isdecimal() and int(text) <= 232):
        raise InputError("ROS_DOMAIN_ID", got=text, expected="a whole number from 0 to 232 (0 to 101 is safe)")
    return int(text) if text else None


def _folder() -> Path:
    from slip_core.compiled import user_cache  # numba takes a second to load

    return user_cache() / "domains"
