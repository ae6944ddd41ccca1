"""A ROS_DOMAIN_ID of one's own: locked while in use, so that runs on one machine never hear each other.

The lock is a file because it must hold across network namespaces; the sockets of ROS's `domain_coordinator` do not.
That package also turns an OSError inside its block into another error.
"""

from __future__ import annotations

import contextlib
import fcntl
import itertools
import os
import tempfile
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
        InputError: where the wanted id is out of range.
        ProtocolError: where all ids are taken, or none can be locked.
    """
    count, turn = LAST - FIRST + 1, next(_turns)
    free = [FIRST + (turn + offset) % count for offset in range(count)]
    for candidate in free if wanted is None else [check_domain(wanted)]:
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
        ProtocolError: it cannot be written.
    """
    folder = _folder()
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        if folder.lstat().st_uid == os.geteuid():
            return open(os.open(folder / str(domain), os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o600))
        why = "belongs to another user"
    except OSError as error:
        why = (error.strerror or str(error)).lower()
    raise ProtocolError(f"{folder}, where runs on this machine lock their ROS domain: {why}; set TMPDIR to your own")


def domains_in_use() -> list[int]:
    """Return the domain ids that runs of this suite on this machine hold, the newest first."""
    folder = _folder()
    found = []
    for path in folder.iterdir() if folder.is_dir() else ():
        if not path.name.isdigit():
            continue
        with contextlib.suppress(OSError), path.open("r+") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                found.append((path.stat().st_mtime, int(path.name)))
    return [domain for _, domain in sorted(found, reverse=True)]


def _folder() -> Path:
    return Path(tempfile.gettempdir()) / f"slip_vic_domains.{os.getuid()}"


def check_domain(wanted: int) -> int:
    """Return the id where DDS has ports for it.

    Raises:
        InputError: where it is out of range.
    """
    if not 0 <= wanted <= 232:
        raise InputError("ROS_DOMAIN_ID", got=wanted, expected="a whole number from 0 to 232 (0 to 101 is safe)")
    return wanted


def domain_from_environment() -> int | None:
    """Return ROS_DOMAIN_ID of the environment, None where it is not set.

    Raises:
        InputError: where it is not a whole number.
    """
    text = os.environ.get("ROS_DOMAIN_ID")
    if text is None or not text.strip():
        return None
    try:
        return check_domain(int(text))
    except ValueError:
        raise InputError(
            "ROS_DOMAIN_ID", got=text, expected="a whole number from 0 to 232", fix="unset it or set it right"
        ) from None
