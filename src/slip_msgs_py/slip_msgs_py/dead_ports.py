"""Ports of shared memory that killed processes have left: what a node that starts does about them.

A node listens at the first port of its domain at which none does. Where a killed process has left that port, Fast DDS
puts another file in its place and tells nobody: whoever had the old one open writes on into it, and the new node hears
nothing of it. That lasts until the writer's watchdog misses the listener, some seconds, or permanently where the
listener was killed between waiting and reading: nothing watches it there. So the old file is marked as Fast DDS marks a
port that has failed, and with its next message a writer opens the new one.

Where a watchdog has missed a listener, its writers make and remove the port's file with each message, until they give
up the dead node after 20 s. That can remove the file of a node which begins to listen there: it begins again.

A file whose maker was killed before it was initialised is waited for permanently by everybody who opens it: it goes.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import re
import struct
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final, Protocol, TypeVar

SHM = Path("/dev/shm")
PORT: Final = "fastrtps_port"
REPLACED: Final = re.compile(rb"/" + PORT.encode() + rb"(\d+) \(deleted\)$", re.MULTILINE)
STATE: Final = struct.Struct("=I")  # the first word of a file of boost's; the flags are such a word too
INITIALISED, CORRUPTED = 2, 3
INITIALISING_S = 1.0  # at most, where its maker lives
NODE_AT: Final = 256
NODE: Final = struct.Struct("=q10I")
"""Fast DDS's `PortNode`, up to its flags: time of the last check, references, two offsets, number of the port, how many
listen, time-outs for checks and for a wait, which is a third of that, capacity, how many wait, flags."""
PORT_OK: Final = 1  # of the flags
MORE_ATTEMPTS: Final = 4  # one in five fails where a dead node is sent 10,000 messages a second
Made = TypeVar("Made", bound="Node")


class Node(Protocol):
    """What has a participant, alone in this process."""

    def destroy_node(self) -> None:
        """Release everything."""


def make_heard(factory: Callable[[], Made]) -> Made:
    """Make a node that hears what is sent to where it listens."""
    node = _make(factory)
    for _ in range(MORE_ATTEMPTS):
        if not listens_in_vain():
            break
        node.destroy_node()
        node = _make(factory)
    return node


def _make(factory: Callable[[], Made]) -> Made:
    with replacing_dead_ports():
        return factory()


def listens_in_vain() -> bool:
    """Return whether this process listens at a port whose file is no longer the port's."""
    with contextlib.suppress(OSError):
        replaced = {int(number) for number in REPLACED.findall(Path("/proc/self/maps").read_bytes())}
        if replaced:
            files = [os.readlink(file) for file in Path("/proc/self/fd").iterdir() if file.is_symlink()]
            return any(f"{SHM}/{PORT}{number}_el" in files for number in replaced)
    return False


@contextlib.contextmanager
def replacing_dead_ports() -> Iterator[None]:
    """Make a node's participant inside: then whoever wrote to a node that was killed writes to this one."""
    _remove_uninitialised()
    with contextlib.ExitStack() as files:
        dead = [(lock, port) for lock in SHM.glob(f"{PORT}*_el") if (port := _dead_port(lock, files)) is not None]
        try:
            yield
        finally:
            for lock, port in dead:
                _mark_failed(port, int(_name(lock).removeprefix(PORT)))


def _name(lock: Path) -> str:
    return lock.name.removesuffix("_el")


def _dead_port(lock: Path, files: contextlib.ExitStack) -> int | None:
    """Open the port of a lock file that no listener holds; None for others."""
    with contextlib.suppress(OSError):  # held, gone, or another user's
        with lock.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        port = os.open(lock.with_name(_name(lock)), os.O_RDWR)
        files.callback(os.close, port)
        return port
    return None


def _mark_failed(port: int, number: int) -> None:
    """Clear the flag of a port that is in order, where its file is what this version of Fast DDS writes."""
    data = os.pread(port, NODE.size, NODE_AT)
    if len(data) == NODE.size:
        _, _, _, _, written, _, timeout_ms, wait_ms, _, _, flags = NODE.unpack(data)
        if (written, timeout_ms // 3) == (number, wait_ms) and wait_ms > 0 and flags < 8:
            os.pwrite(port, STATE.pack(flags & ~PORT_OK), NODE_AT + NODE.size - STATE.size)


def _remove_uninitialised() -> None:
    """Remove the files of ports that were left before they were initialised, and release who waits for one of them."""
    for path in SHM.glob(f"{PORT}*[0-9]"):
        with contextlib.suppress(OSError), path.open("r+b") as file:
            word = file.read(STATE.size)
            state = STATE.unpack(word)[0] if len(word) == STATE.size else 0
            if state < INITIALISED and time.time() - path.stat().st_mtime > INITIALISING_S:
                path.unlink()
                file.seek(0)
                file.write(STATE.pack(CORRUPTED))
