"""Ports that killed processes have left: which files are marked when a node has started, and which are removed."""

from __future__ import annotations

import contextlib
import fcntl
import mmap
import os
from pathlib import Path

import pytest

from slip_msgs_py import dead_ports
from slip_msgs_py.dead_ports import (
    CORRUPTED,
    INITIALISED,
    INITIALISING_S,
    NODE,
    NODE_AT,
    STATE,
    make_heard,
    replacing_dead_ports,
)

FLAGS, OK_CLEARED = 0b111, 0b110  # as a killed listener leaves them


@pytest.fixture
def shm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(dead_ports, "SHM", tmp_path)
    return tmp_path


def port_of(folder: Path, *, wait_ms: int = 1000) -> Path:
    """Write the file of a port as Fast DDS does, with a lock file that no process holds."""
    port = folder / "fastrtps_port9"
    node = NODE.pack(0, 1, 0, 0, 9, 1, 3000, wait_ms, 8192, 1, FLAGS)
    port.write_bytes(STATE.pack(INITIALISED).ljust(NODE_AT) + node.ljust(1000))
    (folder / "fastrtps_port9_el").touch()
    return port


def flags_of(data: bytes) -> int:
    return int(NODE.unpack(data[NODE_AT : NODE_AT + NODE.size])[-1])


def test_a_writer_sees_that_a_dead_port_has_failed_although_its_file_was_replaced(shm: Path) -> None:
    port = port_of(shm)
    with port.open("rb") as writer:
        with replacing_dead_ports():
            port.unlink()
            port_of(shm)
        assert flags_of(writer.read()) == OK_CLEARED
    assert flags_of(port.read_bytes()) == FLAGS


def test_a_port_with_a_listener_stays_as_it_is(shm: Path) -> None:
    port = port_of(shm)
    with (shm / "fastrtps_port9_el").open() as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with replacing_dead_ports():
            pass
    assert flags_of(port.read_bytes()) == FLAGS


def test_a_file_of_another_layout_stays_as_it_is(shm: Path) -> None:
    before = port_of(shm, wait_ms=7).read_bytes()
    with replacing_dead_ports():
        pass
    assert (shm / "fastrtps_port9").read_bytes() == before


def test_a_node_that_listens_at_a_file_which_was_replaced_is_made_again(shm: Path) -> None:
    with contextlib.ExitStack() as open_files:
        made: list[Listener] = []

        def make() -> Listener:
            made.append(Listener(shm, open_files, replaced=len(made) < 2))
            return made[-1]

        assert make_heard(make) is made[2]
        assert [node.destroyed for node in made] == [True, True, False]


class Listener:
    """A node that listens at a port: it holds the lock, and has the file mapped."""

    def __init__(self, folder: Path, open_files: contextlib.ExitStack, *, replaced: bool) -> None:
        self.destroyed = False
        port = port_of(folder)
        self._own = open_files.enter_context(contextlib.ExitStack())
        lock = self._own.enter_context((folder / "fastrtps_port9_el").open())
        fcntl.flock(lock, fcntl.LOCK_EX)
        with port.open("r+b") as file:
            self._own.enter_context(mmap.mmap(file.fileno(), NODE_AT))
        if replaced:
            port.unlink()

    def destroy_node(self) -> None:
        self.destroyed = True
        self._own.close()


@pytest.mark.parametrize("content", [b"", STATE.pack(0), STATE.pack(1)])
def test_a_file_that_was_never_initialised_goes_and_who_waits_for_it_is_released(shm: Path, content: bytes) -> None:
    port, age_s = shm / "fastrtps_port9", 2.0 * INITIALISING_S
    port.write_bytes(content)
    with port.open("rb") as waiting:
        with replacing_dead_ports():
            assert port.exists(), "its maker may be at work"
        then = port.stat().st_mtime - age_s
        os.utime(port, (then, then))
        with replacing_dead_ports():
            assert not port.exists()
        assert STATE.unpack(waiting.read(STATE.size)) == (CORRUPTED,)


def test_a_file_that_is_in_order_stays_however_old(shm: Path) -> None:
    port = port_of(shm)
    os.utime(port, (0.0, 0.0))
    with replacing_dead_ports():
        assert port.exists()
