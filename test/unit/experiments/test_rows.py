"""Files of rows: they continue, keep every bit, and refuse what was made of something else."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from slip_core.errors import InputError
from slip_vic.experiments.rows import FILE, digest_of, key_of, read_json, read_rows, rows_added
from slip_vic.experiments.run import METRICS, Row, row_of
from slip_vic.experiments.world import World

MADE_OF = {"numpy": "2.0"}


def world(seed: int) -> World:
    return World("paper_planar", "ideal", seed, number=seed, law="vic")


def result(seed: int = 0, value: float = 1.0) -> Row:
    return row_of(world(seed), "ok", "", dict.fromkeys(METRICS, value))


def test_a_file_continues_where_it_stopped(tmp_path: Path) -> None:
    path = tmp_path / FILE
    with rows_added(path, MADE_OF) as (done, add):
        assert done == set()
        add(result(10))
        add(row_of(world(2), "crashed", "it was\nthe weather", {}))
    with path.open("a", encoding="utf-8") as cut:
        cut.write("study,3,vic,paper_pl")  # cut off by a full disk or a kill
    with rows_added(path, MADE_OF) as (done, add):
        assert done == {world(10).key}
        add(result(2))
        add(result(0))
        assert [row["seed"] for row in read_rows(path)] == ["10", "2", "0"]
    assert [row["seed"] for row in read_rows(path)] == ["0", "2", "10"]
    assert read_json(path) == (MADE_OF, digest_of(read_rows(path)))


def test_a_row_keeps_every_bit(tmp_path: Path) -> None:
    with rows_added(tmp_path / FILE, MADE_OF) as (_, add):
        add(result(0, 0.1 + 0.2))
    (row,) = read_rows(tmp_path / FILE)
    assert {float(row[name]) for name in METRICS} == {0.1 + 0.2}
    assert key_of(row) == world(0).key


def test_a_file_keeps_to_what_it_is_made_of(tmp_path: Path) -> None:
    path = filled(tmp_path, range(1)) / FILE
    with pytest.raises(InputError, match=r"got numpy 2\.0, expected 2\.1; give another folder"):
        filled(tmp_path, range(1), made={"numpy": "2.1"})
    filled(tmp_path, range(1), made={"sensor ideal": "d3"})
    assert read_json(path)[0] == {"numpy": "2.0", "sensor ideal": "d3"}
    path.with_suffix(".json").write_text('{"assignments": []}')
    with pytest.raises(InputError, match="another folder"):
        filled(tmp_path, range(1))


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        (b"off_goal_m", b"off", "no column off_goal_m"), (b",1.0,", b",one,", "float: 'one'"),
        (b",vic,", b",\xff,", "utf-8"), (b",vic,", b"," + b"v" * 200_000 + b",", "field"),
    ],
)  # fmt: skip
def test_what_is_no_file_of_rows(tmp_path: Path, old: bytes, new: bytes, what: str) -> None:
    path = filled(tmp_path, range(1)) / FILE
    path.write_bytes(path.read_bytes().replace(old, new))
    with pytest.raises(InputError, match=what):
        read_rows(path)


def test_a_place_that_cannot_be_written() -> None:
    with pytest.raises(InputError, match="--out /proc/study"):
        filled(Path("/proc/study"), range(1))


def test_a_folder_is_for_one_process_at_a_time(tmp_path: Path) -> None:
    in_use = pytest.raises(InputError, match=f"in use by process {os.getpid()}")
    with rows_added(tmp_path / FILE, MADE_OF), in_use:
        filled(tmp_path, range(1))
    filled(tmp_path, range(1))


def filled(folder: Path, seeds: range, value: float = 1.0, made: dict[str, str] = MADE_OF) -> Path:
    with rows_added(folder / FILE, made) as (_, add):
        for seed in reversed(seeds):
            add(result(seed, value))
    return folder
