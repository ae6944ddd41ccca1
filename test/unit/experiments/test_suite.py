"""The suite: its worlds are frozen, results are rows that go on and are compared."""

import math
import re
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from slip_core.errors import InputError
from slip_vic.cli import cli
from slip_vic.experiments import suite
from slip_vic.experiments.engines import ENGINES
from slip_vic.experiments.law import find_law
from slip_vic.experiments.rows import FILE, read_json, read_rows, write_rows
from slip_vic.experiments.run import run, slip_path
from slip_vic.experiments.world import World
from slip_vic.run.versions import digest
from test.support.pages import ROOT

LAW = "class Mine:\n    needs = frozenset()\n    def reset(self, setup): ...\n    def step(self, seen):"
FIRST = ["247aedd780232ba3", "2eec09f3bd841e0c", "b7339e446e0b95b1", "92d6347268b6ed46"]


def short(track: Any, number: int) -> World:
    lasts = (f"bridge.duration_s={0.05 + 0.01 * number}",)
    return World("paper_planar", "vision_60", number, lasts, suite.SUITE, number, track=track)


class HereEngine:
    """Runs tasks in this process: what is tested is not the pool, whose workers take seconds to start."""

    deaths = ()

    def __enter__(self) -> Any:
        return self

    def __exit__(self, *_: object) -> None: ...

    def run(self, call: Any, shared: Any, tasks: Any) -> Iterator[Any]:
        return ((task, call(shared, task)) for task in tasks)


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two worlds with one arm that take no time, in this process."""
    worlds = lambda track, arms, count: [short(track, k + 1) for k in range(min(count, 2))] if arms == 1 else []  # noqa: E731
    monkeypatch.setattr(suite, "worlds", worlds)
    monkeypatch.setitem(ENGINES, "pool", lambda _: HereEngine())


def benchmark(*words: object) -> str:
    done = CliRunner().invoke(cli, ["benchmark", *map(str, words)], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.output


def test_the_worlds_are_frozen() -> None:
    frozen = [
        world
        for arms, count in suite.COUNTS.items()
        for track in suite.TRACKS
        for world in suite.worlds(track, arms, count)
    ]
    assert [world.digest for world in frozen[:4]] == FIRST
    assert digest(world.digest.encode() for world in frozen) == suite.DIGEST


def test_a_law_has_the_track_and_the_arms_that_it_can() -> None:
    assert [(w.track, w.arms) for w in suite.suite(find_law("governed"), 1)] == [("capped", 1), ("capped", 2)]
    assert [(w.track, w.arms) for w in suite.suite(find_law("grasp_cbf"), 1, arms=(1,))] == [("free", 1)]
    assert [w.arms for w in suite.suite(find_law("toppra_offline"), 1)] == [1]


def test_a_result_continues_and_is_compared(tmp_path: Path, here: None) -> None:
    folder = tmp_path / "classical"
    for count, there in ((1, "0 of 1"), (2, "1 of 2"), (2, "2 of 2")):
        output = benchmark("run", "classical", "--worlds", count, "--out", folder)
        assert f"{there} runs were there already" in output
    output = benchmark("compare", folder, "--out", tmp_path)
    assert "classical" in output
    assert "0/2" in output, "too short to arrive"
    assert (tmp_path / "rows.png").stat().st_size > 10_000


def test_verify_runs_no_code_that_only_a_result_names(tmp_path: Path, here: None) -> None:
    file, mark = tmp_path / "mine.py", tmp_path / "imported"
    file.write_text(f"open({str(mark)!r}, 'w')\n{LAW} ...")
    benchmark("run", f"{file}:Mine", "--out", tmp_path / "result", "--worlds", 1)
    mark.unlink()
    for name, module in list(sys.modules.items()):
        if getattr(module, "__file__", None) == str(file):
            del sys.modules[name]
    with pytest.raises(InputError, match="--law"):
        suite.verify_result(tmp_path / "result")
    assert not mark.exists()
    assert suite.verify_result(tmp_path / "result", f"{file}:Mine") == (1, [])
    assert mark.exists()
    count, wrong = suite.verify_result(tmp_path / "result", "fixed_grip")
    assert (count, len(wrong)) == (1, 1)
    words = ["benchmark", "verify", str(tmp_path / "result"), "--law", "fixed_grip"]
    assert CliRunner().invoke(cli, words).exit_code == 1


def test_a_law_that_ends_the_program_is_named_and_the_exit_code_is_1(tmp_path: Path, here: None) -> None:
    file = tmp_path / "quits.py"
    file.write_text(f"{LAW} raise SystemExit('\x1b[2J')")
    words = ["benchmark", "run", f"{file}:Mine", "--out", str(tmp_path / "out"), "--worlds", "1"]
    done = CliRunner().invoke(cli, words, catch_exceptions=False)
    assert done.exit_code == 1
    assert "failed, 0.000 s: step raises SystemExit: \\x1b[2J" in done.stderr


def test_a_result_that_was_changed_or_that_others_do_not_get_is_refused(tmp_path: Path, here: None) -> None:
    """Whoever runs some of its worlds again finds out."""
    theirs, again = tmp_path / "theirs", tmp_path / "again"
    benchmark("run", "classical", "--out", theirs)
    benchmark("run", "classical", "--worlds", 1, "--out", again)
    assert len(suite.compared([theirs, again])) == 2
    row, text = read_rows(theirs / FILE)[0], (theirs / FILE).read_text()
    (theirs / FILE).write_text(text.replace(f"{row['squeeze_mean_n']},{row['squeeze_peak_n']}", "0.5,0.4", 1))
    with pytest.raises(InputError, match="got rows"):
        suite.compared([theirs])
    write_rows(theirs / FILE, read_rows(theirs / FILE), read_json(theirs / FILE)[0])
    with pytest.raises(InputError, match="another result of carry-2026"):
        suite.compared([theirs, again])


def test_laws_are_compared_in_the_worlds_that_all_have(tmp_path: Path, here: None) -> None:
    one, two, other = (tmp_path / name for name in "abc")
    benchmark("run", "classical", "--out", two)
    benchmark("run", "fixed_grip", "--out", one, "--worlds", 1)
    assert [(row["law"], row["world"]) for row in suite.compared([two, one])] == [
        ("classical", "1"), ("fixed_grip", "1"),
    ]  # fmt: skip
    benchmark("run", "vic", "--out", other)
    write_rows(other / FILE, read_rows(other / FILE)[1:], read_json(other / FILE)[0])
    with pytest.raises(InputError, match="no world that all of them have"):
        suite.compared([one, other])


def test_who_stays_at_the_start_of_a_closed_path_has_not_arrived(tmp_path: Path) -> None:
    file = tmp_path / "still.py"
    file.write_text(f"{LAW} ...")
    path = {"kind": "circle", "duration_s": 0.2, "ramp_s": 0.1, "period_s": 0.1, "radius": 0.001}
    closed = (*(f"controller.trajectory.{name}={value}" for name, value in path.items()), "bridge.duration_s=0.25")
    world = short("capped", 1)
    row = run(replace(world, settings=closed, law=f"{file}:Mine"))
    assert (row["outcome"], row["reason"]) == ("stays", "the pad does not leave the start")
    assert math.isnan(float(row["arrival_s"]))
    assert float(row["final_error_m"]) < 1e-3


def test_the_slip_path_is_its_length_and_not_where_it_ends() -> None:
    time = np.linspace(0.0, 1.0, 1001)
    velocity = np.zeros((1001, 6))
    velocity[:, 0], velocity[:, 5] = np.cos(2 * np.pi * time), 0.5
    assert slip_path(time, velocity) == pytest.approx((2.0 / np.pi, 0.5), rel=1e-4)


def test_a_number_of_a_law_can_be_changed_by_its_name() -> None:
    assert find_law("fixed_grip?factor=1.5").kind.factor == 1.5
    assert find_law("governed?governor.margin=0.8").settings == ("controller.governor.margin=0.8",)
    for name in ("factr=1.5", "step=1", "needs=x"):
        with pytest.raises(InputError, match="of a number that the class has"):
            find_law(f"fixed_grip?{name}")


def test_the_steps_of_the_page_work_in_a_folder_of_its_own(
    tmp_path: Path, here: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Word for word, in worlds that are shorter."""
    page = (ROOT / "docs" / "your_law.md").read_text().partition("A law in any folder:")[2]
    (code, commands) = (re.search(rf"```{kind}\n(.*?)```", page, re.DOTALL) for kind in ("python", "bash"))
    assert code
    assert commands
    monkeypatch.chdir(tmp_path)
    Path("my_law.py").write_text(code[1])
    for command in commands[1].splitlines():
        ended = CliRunner().invoke(cli, command.split()[1:], catch_exceptions=False)
        assert ended.exit_code == 0, f"{command}: {ended.output}"
    assert "2 worlds ran again, all are equal" in ended.output
    assert Path("out/benchmark/rows.png").is_file()
