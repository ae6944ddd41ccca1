"""What went wrong is said by the real processes, in a line each, with exit code 1."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from test.system.bringup.test_cli import slip_vic

NO_GRIP = ("--set", "bridge.grip.force=0.0", "--set", "bridge.duration_s=0.1")
LOST = "LOST at 0.000 s: the object is lost: the grip is zero"
PRINTED = ("--scenario", "glass_transport", "--law", "vic", "--set", "controller.gains.spin=follow")
REFUSED = ("--scenario", "vertical_plane", "--set", "controller.governor.margin=0.95")


@pytest.mark.parametrize(
    ("words", "kind", "reason"),
    [
        ((*PRINTED, "--set", "bridge.duration_s=0.3"), "FAULT", "the limit is"),
        ((*REFUSED, "--set", "bridge.duration_s=0.3", "--in-process"), "UNREACHABLE", "at 800 ms of the path"),
    ],
    ids=["fault", "refused path"],
)
def test_what_the_controller_gave_up_for_is_said(words: tuple[str, ...], kind: str, reason: str) -> None:
    done = slip_vic("run", *words)
    assert done.returncode == 1
    said = [line for line in done.stderr.splitlines() if line.startswith(f"{kind} at 0.")]
    assert len(said) == 1
    assert reason in said[0]


@pytest.mark.smoke
def test_a_run_that_goes_well_says_nothing() -> None:
    done = slip_vic("run", "--set", "bridge.duration_s=0.3")
    assert done.returncode == 0
    assert done.stderr == ""


def test_the_demo_says_it_of_each_run_and_keeps_everything(tmp_path: Path) -> None:
    done = slip_vic("demo", *NO_GRIP, "--out", tmp_path / "out")
    assert done.returncode == 1
    said = [line for line in done.stderr.splitlines() if LOST in line]
    assert said == [f"{kind}: {LOST}" for kind in ("classical", "vic", "governed")]
    runs = json.loads((tmp_path / "out/summary.json").read_text())["runs"]
    assert all(LOST in run["incidents"] for run in runs.values())
