"""The demo as a user runs it: exit code, files and schema, from bags recorded over DDS."""

import json
from pathlib import Path

from slip_bags.reader import Bag
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
    assert list(summary["runs"]) == ["classical", "vic", "governed", "governed_follow"]
    for run in summary["runs"].values():
        assert set(run) >= NUMBERS
        assert all(isinstance(run[name], int | float) for name in NUMBERS)
        assert run["ticks"] == 1000 * DEMO_S
        assert run["messages_lost"] == 0


def test_bags_are_where_the_summary_says(demo: tuple[Path, str]) -> None:
    for run in json.loads((demo[0] / "summary.json").read_text())["runs"].values():
        bag = Bag(run["bag"])
        assert bag.topics["/effort_command"].message_count == run["ticks"]


def test_table_and_files(demo: tuple[Path, str]) -> None:
    out, text = demo
    assert "slip at the end [mm]" in text
    assert "path error, peak" in text
    files = ["classical", "governed", "governed_follow", "report.html", "summary.json", "vic"]
    assert sorted(path.name for path in out.iterdir() if path.name != ".lock") == files
