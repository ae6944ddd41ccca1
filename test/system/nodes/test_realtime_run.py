"""A real-time run end to end; nothing here depends on how fast this machine is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from slip_bags.reader import Bag
from slip_core.stamps import stamp_to_ns
from slip_vic.run.launcher import Launcher
from slip_vic.scenarios.scenario import load
from slip_vic_controller.node import timing

DURATION_S = 0.5
PERIOD_NS = 20_000_000  # slow enough that also a crowded machine answers some ticks
ASSIGNMENTS = (
    f"bridge.duration_s={DURATION_S}",
    "control_period_s=0.02",
    "controller.gains.k_s=20.0",
    "controller.gains.stiffness=[5.0, 5.0, 100.0, 60.0, 60.0, 4.5]",  # what 20 ms admit
)


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("realtime") / "bag"
    scenario = load("paper_planar", law="vic", mode="realtime", set=ASSIGNMENTS)
    result = Launcher(scenario, bag=folder).run()
    assert result.ticks == DURATION_S * 1e9 / PERIOD_NS
    assert result.lost == 0
    assert 0.0 <= result.timing["fresh_share"] <= 1.0
    return folder


def test_stamps_are_wall_time(bag: Path) -> None:
    opened = Bag(bag)
    stamps = [stamp_to_ns(m.value.header.stamp) for m in opened.messages("/joint_states")]
    received = [m.log_time_ns for m in opened.messages("/joint_states")]
    steps = np.diff(stamps)
    assert (steps[steps < PERIOD_NS] >= 0).all()  # repeated first states before everybody was connected
    assert (steps[-20:] == PERIOD_NS).all()
    assert abs(stamps[0] - received[0]) < 60e9


def test_timing_belongs_to_cycles(bag: Path) -> None:
    opened = Bag(bag)
    cycles = [m.value for m in opened.messages("/controller/timing")]
    answers = list(opened.messages("/controller/ledger"))
    names = {m.value.status[0].name for m in opened.messages("/diagnostics")}
    assert tuple(cycles[0].name) == timing.SCALARS
    # The watchdog's own cycles answer no new state: they are in the ledger and have no timing.
    assert 0 < len(cycles) <= len(answers)
    assert names == {"slip_vic_controller: mode"}
