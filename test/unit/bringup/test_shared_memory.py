"""What a killed process leaves in /dev/shm is found whole, and what is in use is left alone."""

from __future__ import annotations

import mmap
from pathlib import Path

import pytest

from slip_vic.run import shared_memory


@pytest.fixture
def shm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(shared_memory, "SHM", tmp_path)
    return tmp_path


def make(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).write_bytes(b"x")


def test_what_nobody_has_open_goes_but_for_ports_which_the_next_node_may_be_opening(shm: Path) -> None:
    make(shm, "fastrtps_port7411", "fastrtps_port7411_el", "sem.fastrtps_port7411_mutex", "fastrtps_0123_el", "another")
    shared_memory.remove_orphans(shared_memory.segments())
    assert {path.name for path in shm.iterdir()} == {
        "fastrtps_port7411", "fastrtps_port7411_el", "sem.fastrtps_port7411_mutex", "another"
    }  # fmt: skip


def test_dead_ports_of_one_domain_go_whole_and_those_in_use_stay_whole(shm: Path) -> None:
    dead = ("fastrtps_port12161", "fastrtps_port12161_el", "sem.fastrtps_port12161_mutex")
    alive = ("fastrtps_port12163", "fastrtps_port12163_el", "sem.fastrtps_port12163_mutex")
    others = ("fastrtps_port7001", "fastrtps_port12411", "fastrtps_0123")
    make(shm, *dead, *alive, *others)
    with (shm / "fastrtps_port12163_el").open("rb"):
        shared_memory.remove_dead_ports(19)
    assert {path.name for path in shm.iterdir()} == {*alive, *others}


def test_what_is_mapped_stays(shm: Path) -> None:
    make(shm, "fastrtps_0123")
    with (shm / "fastrtps_0123").open("r+b") as file, mmap.mmap(file.fileno(), 1) as _mapped:
        assert shared_memory.orphans(shared_memory.segments()) == set()
    assert len(shared_memory.orphans(shared_memory.segments())) == 1


def test_only_candidates_are_removed(shm: Path) -> None:
    make(shm, "fastrtps_old")
    candidates = shared_memory.segments()
    make(shm, "fastrtps_new")
    assert {path.name for path in shared_memory.remove_orphans(candidates)} == {"fastrtps_old"}
    assert (shm / "fastrtps_new").exists()
