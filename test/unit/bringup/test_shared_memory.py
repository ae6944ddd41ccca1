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


def test_a_dead_port_goes_together_with_its_semaphore(shm: Path) -> None:
    make(shm, "fastrtps_port7411", "sem.fastrtps_port7411_mutex", "fastrtps_0123_el", "another_file")
    shared_memory.remove_orphans(shared_memory.segments())
    assert [path.name for path in shm.iterdir()] == ["another_file"]


def test_a_semaphore_lives_as_long_as_its_port(shm: Path) -> None:
    make(shm, "fastrtps_port7411", "sem.fastrtps_port7411_mutex")
    with (
        (shm / "fastrtps_port7411").open("r+b") as file,
        mmap.mmap(file.fileno(), 1) as _mapped,
    ):
        assert shared_memory.orphans(shared_memory.segments()) == set()
    assert len(shared_memory.orphans(shared_memory.segments())) == 2


def test_only_candidates_are_removed(shm: Path) -> None:
    make(shm, "fastrtps_old")
    candidates = shared_memory.segments()
    make(shm, "fastrtps_new")
    assert {path.name for path in shared_memory.remove_orphans(candidates)} == {"fastrtps_old"}
    assert (shm / "fastrtps_new").exists()
