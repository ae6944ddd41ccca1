"""The demo as a user runs it: exit code, files and schema, from bags recorded over DDS."""

import itertools
import json
from pathlib import Path

from slip_bags.reader import Bag
from slip_vic.run.launcher import Launcher
from slip_vic.scenarios.scenario import load_scenario
from test.system.conftest import DEMO_S

NUMBERS = {
    "slip_linear_m",
    "slip_angular_rad",
    "slip_linear_peak_m",
    "slip_speed_peak_m_s",
    "effort_peak_nm",
    "ticks",
    "real_time_factor",
}


def test_summary_has_the_documented_form(demo: tuple[Path, str]) -> None:
    summary = json.loads((demo[0] / "summary.json").read_text())
    assert summary["scenario"] == "paper_planar"
    assert summary["seed"] == 0
    assert {"mujoco", "pin", "numpy"} <= set(summary["versions"])
    assert list(summary["runs"]) == ["classical", "vic", "governed"]
    for run in summary["runs"].values():
        assert set(run) >= NUMBERS
        assert all(isinstance(run[name], int | float) for name in NUMBERS)
        assert run["ticks"] == 1000 * DEMO_S
        assert run["messages_lost"] == 0


def test_bags_are_where_the_summary_says(demo: tuple[Path, str]) -> None:
    for run in json.loads((demo[0] / "summary.json").read_text())["runs"].values():
        with Bag(run["bag"]) as bag:
            assert bag.topics["/effort_command"].message_count == run["ticks"]


def test_table_and_files(demo: tuple[Path, str]) -> None:
    out, text = demo
    assert "slip at the end [mm]" in text
    assert "classical / vic" in text
    files = ["classical", "governed", "report.html", "summary.json", "vic"]
    assert sorted(path.name for path in out.iterdir()) == files


def test_a_gripper_that_opens_lets_the_object_go(demo: tuple[Path, str], tmp_path: Path) -> None:
    """Parameters reach the processes: with a hundredth of the demo's grip the object slips much more."""
    assignments = ["bridge.duration_s=0.6", "bridge.grip.force=0.005"]
    Launcher(load_scenario("paper_planar", law="classical", assignments=assignments), bag=tmp_path / "bag").run()
    assert slip_after(tmp_path / "bag", 600) > 1.5 * slip_after(demo[0] / "classical", 600)


def slip_after(folder: Path, ticks: int) -> float:
    """Return how far the object has slipped after a number of ticks [m]."""
    with Bag(folder) as bag:
        position = list(itertools.islice(bag.messages("/slip_truth"), ticks))[-1].value.position
    return float((position[0] ** 2 + position[1] ** 2) ** 0.5)
