"""The suite: its worlds are frozen, results are rows that go on, are verified and compared."""

import io
import json
import math
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from rich.console import Console

from slip_core.errors import InputError
from slip_vic.cli import cli
from slip_vic.experiments import suite
from slip_vic.experiments.compare import HEAD, NARROW, compare, joined, lines_of, table_for
from slip_vic.experiments.law import find_law
from slip_vic.experiments.rows import COLUMNS, read_rows
from slip_vic.experiments.run import TIMED, run, slip_path
from slip_vic.experiments.world import World, parameter_of
from slip_vic.run.versions import digest
from test.support.pages import ROOT

FIRST = ["0e500583c9eb7264", "fd488b4ff232056b", "69a69bce92f4bd47", "1f870f0ac5844efd"]


def short(track: Any, number: int) -> World:
    lasts = (f"bridge.duration_s={0.05 + 0.01 * number}",)
    return World("paper_planar", "vision_60", number, lasts, suite.SUITE, number, track=track)


@pytest.fixture
def two_worlds(monkeypatch: pytest.MonkeyPatch) -> None:
    def chosen(law: Any, count: int, track: Any = None, *_: Any, **__: Any) -> list[World]:
        return [short(track or suite.track_of(law), number) for number in range(1, min(count, 2) + 1)]

    monkeypatch.setattr(suite, "suite", chosen)


class HereEngine:
    """Runs tasks in this process: what is tested is not the pool, whose workers take seconds to start."""

    def __enter__(self) -> Any:
        return self

    deaths = 0

    def __exit__(self, *_: object) -> None: ...

    def run(self, call: Any, shared: Any, tasks: Any) -> Iterator[Any]:
        return ((task, call(shared, task)) for task in tasks)


@pytest.fixture
def here(two_worlds: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("slip_vic.experiments.runner.open_engine", lambda *_: HereEngine())


def test_the_worlds_are_frozen() -> None:
    frozen = [world for arms, count in suite.COUNTS.items() for world in suite.worlds("capped", arms, count)]
    assert [world.digest for world in frozen[:4]] == FIRST
    assert digest(world.digest.encode() for world in frozen) == suite.DIGEST
    tuning = suite.worlds("capped", 1, 300, suite.TUNING)
    assert {world.settings for world in tuning}.isdisjoint(world.settings for world in frozen)
    assert len(tuning) == 60


def test_every_parameter_of_the_worlds_exists() -> None:
    """One that is renamed or removed needs a line in experiments/renamed.yaml."""
    seen: set[str] = set()
    for world in (*suite.worlds("capped", 1, 300), *suite.worlds("capped", 2, 60)):
        own = {parameter_of(setting) for setting in world.settings} | {world.scenario, world.sensor}
        if own - seen:
            world.load("governed", "observer")
            seen |= own


def test_a_law_has_the_track_and_the_arms_that_it_can() -> None:
    assert [(w.track, w.arms) for w in suite.suite(find_law("governed"), 1)] == [("capped", 1), ("capped", 2)]
    assert [(w.track, w.arms) for w in suite.suite(find_law("grasp_cbf"), 1, arms=(1,))] == [("free", 1)]
    assert [w.arms for w in suite.suite(find_law("toppra_offline"), 1)] == [1]


def test_a_result_continues_is_verified_and_compared(tmp_path: Path, two_worlds: None) -> None:
    folder = tmp_path / "classical"
    invoke = lambda count: CliRunner().invoke(  # noqa: E731
        cli, ["benchmark", "run", "classical", "--worlds", count, "--out", str(folder), "--jobs", "1"]
    )
    first, more, again = invoke("1"), invoke("2"), invoke("2")
    assert "classical: 1 worlds, 0 not ok, 0 were there already" in first.output, first.output
    assert "classical: 2 worlds, 0 not ok, 1 were there already" in more.output
    assert "2 were there already" in again.output
    content = json.loads((folder / "result.json").read_text())
    assert (content["worlds"], content["worlds_of_suite"], content["suite"]) == (2, 360, "carry-2026.1")
    assert suite.verify_result(folder) == (2, [])

    with pytest.raises(InputError, match="law classical"):
        suite.run_law("fixed_grip", 1, folder, "pool", 1)
    lines, line = compare([folder, folder], tmp_path)
    assert [cells[0] for cells in lines] == ["classical"]
    for width, columns in ((300, HEAD), (80, NARROW)):
        console = Console(width=width, record=True, file=io.StringIO())
        console.print(table_for(console, lines))
        head = console.export_text().splitlines()[2]
        assert [cell.strip() for cell in head.strip("┃").split("┃")] == list(columns)
    page = (tmp_path / "compare.html").read_text()
    assert page.count("data:image/png;base64,") == 1
    assert not re.search(r'(src|href)="http', page)
    assert str(tmp_path / "compare.png") in line
    shown = json.loads((tmp_path / "compare.json").read_text())["laws"]
    assert [(one["law"], one["worlds"], one["peak [N]"]) for one in shown] == [("classical", "2", "0.5")]

    study = folder / "rows.csv"
    row = read_rows(study)[1]
    study.write_text(study.read_text().replace(f"{row['squeeze_mean_n']},{row['squeeze_peak_n']}", "0.5,0.4", 1))
    _, wrong = suite.verify_result(folder)
    assert "squeeze_peak_n is 0.5, the result has 0.4" in " ".join(wrong), wrong
    assert "rows have the digest" in wrong[0]
    assert CliRunner().invoke(cli, ["benchmark", "verify", str(folder)]).exit_code == 1


def test_shards_of_a_law_are_compared_as_one(tmp_path: Path, here: None) -> None:
    folders = [tmp_path / "first", tmp_path / "second"]
    for k, folder in enumerate(folders, start=1):
        suite.run_law("classical", 2, folder, "pool", 1, shard=(k, 2))
    assert [[row["world"] for row in suite.read_result(folder).rows] for folder in folders] == [["1"], ["2"]]
    suite.run_law("classical", 2, tmp_path / "whole", "pool", 1)
    timeless = lambda rows: {  # noqa: E731
        tuple(value for name, value in row.items() if name not in TIMED) for row in rows
    }
    (joint,) = joined(folders)
    assert timeless(joint.rows) == timeless(suite.read_result(tmp_path / "whole").rows)


def test_who_stays_at_the_start_of_a_closed_path_has_not_arrived(tmp_path: Path) -> None:
    file = tmp_path / "still.py"
    file.write_text(
        "class Still:\n    needs = frozenset()\n    def reset(self, setup): ...\n    def step(self, seen): ...\n"
    )
    path = {"kind": "circle", "duration_s": 0.2, "ramp_s": 0.1, "period_s": 0.1, "radius": 0.001}
    closed = (*(f"controller.trajectory.{name}={value}" for name, value in path.items()), "bridge.duration_s=0.25")
    world = short("capped", 1)
    row = run(replace(world, settings=closed), f"{file}:Still")
    assert (row.outcome, row.reason) == ("stays", "the pad does not leave the start")
    assert math.isnan(row.metrics["arrival_s"])
    assert row.metrics["final_error_m"] < 1e-3


def test_no_law_looks_better_by_what_it_does_not_carry() -> None:
    """Four worlds in which the pad slides by 1 mm each: arrived, late, left short, never left; then one lost."""
    cases = [("ok", 1.0, 0.0), ("ok", math.nan, 0.01), ("ok", math.nan, 0.03), ("stays", math.nan, 0.0)]
    cases.append(("fault", math.nan, 0.0))
    rows = tuple(
        {**dict.fromkeys(COLUMNS, "1"), "world": str(k), "track": "capped", "slip_path_m": "0.001"}
        | {"outcome": outcome, "arrival_s": repr(arrival), "final_error_m": repr(error)}
        for k, (outcome, arrival, error) in enumerate(cases)
    )
    law = suite.LawRows("law", "law", "", oracle=False, digest="", rows=rows)
    (line,) = lines_of([law], 1)
    shown = dict(zip(HEAD, line, strict=True))
    assert [shown[name] for name in ("worlds", "carried", "lost", "short", "late")] == ["5", "2", "1", "2", "1"]
    assert (shown["slip [mm]"], shown["arrives [s]"], shown["peak [N]"]) == ("inf", "inf", "1")
    (line,) = lines_of([replace(law, rows=rows[:3])], 1)
    assert dict(zip(HEAD, line, strict=True))["slip [mm]"] == "1"


def test_the_slip_path_is_its_length_and_not_where_it_ends() -> None:
    time = np.linspace(0.0, 1.0, 1001)
    velocity = np.zeros((1001, 6))
    velocity[:, 0], velocity[:, 5] = np.cos(2 * np.pi * time), 0.5
    assert slip_path(time, velocity) == pytest.approx((2.0 / np.pi, 0.5), rel=1e-4)


def test_a_number_of_a_law_can_be_changed_by_its_name() -> None:
    assert find_law("fixed_grip?factor=1.5").kind.factor == 1.5
    assert find_law("governed?governor.margin=0.8").kind.more == {"governor.margin": 0.8}
    assert find_law("fixed_grip?factor=1.5").label == "fixed_grip?factor=1.5"
    assert find_law("classical?stiffness=2").kind.stiffness == 2.0
    with pytest.raises(InputError, match="of a number that the class has"):
        find_law("fixed_grip?factr=1.5")


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
    assert Path("out/benchmark/compare.html").is_file()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "governd"], "did you mean governed"),
        (["run", "nowhere.py:Law"], "no file nowhere.py"),
        (["compare", "nowhere"], "a result of slip-vic benchmark run"),
        (["verify", "nowhere"], "a result of slip-vic benchmark run"),
    ],
)
def test_what_is_not_there_is_one_line(arguments: list[str], message: str) -> None:
    with pytest.raises(InputError, match=message) as found:
        CliRunner().invoke(cli, ["benchmark", *arguments], catch_exceptions=False)
    assert "\n" not in str(found.value)
