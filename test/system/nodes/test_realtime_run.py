"""A real-time run end to end; nothing here depends on how fast this machine is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from slip_bags.reader import Bag
from slip_core.stamps import stamp_to_ns
from slip_sim_bridge import pacing
from slip_vic.run.launcher import Launcher
from slip_vic.run.processes import Scheduling
from slip_vic.scenarios.scenario import load_scenario
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
    scenario = load_scenario("paper_planar", mode="realtime", assignments=ASSIGNMENTS)
    # A priority that no system has: the run must go on without it, and say so.
    result = Launcher(scenario, bag=folder, scheduling=Scheduling(fifo=1000)).run()
    assert result.ticks == DURATION_S * 1e9 / PERIOD_NS
    assert result.lost == 0
    assert 0.0 <= result.timing["fresh_share"] <= 1.0
    assert {warning.partition(":")[0] for warning in result.warnings} == {"controller", "bridge"}
    assert all("SCHED_FIFO 1000 is not permitted" in warning for warning in result.warnings)
    return folder


def test_stamps_are_wall_time(bag: Path) -> None:
    with Bag(bag) as opened:
        stamps = [stamp_to_ns(m.value.header.stamp) for m in opened.messages("/joint_states")]
        received = [m.log_time_ns for m in opened.messages("/joint_states")]
    steps = np.diff(stamps)
    assert (steps[steps < PERIOD_NS] >= 0).all()  # repeated first states before everybody was connected
    assert (steps[-20:] == PERIOD_NS).all()
    assert abs(stamps[0] - received[0]) < 60e9


def test_timing_belongs_to_ticks(bag: Path) -> None:
    with Bag(bag) as opened:
        cycles = [m.value for m in opened.messages("/controller/timing")]
        ticks = [m.value for m in opened.messages("/bridge/timing")]
        answers = list(opened.messages("/controller/ledger"))
        names = {m.value.status[0].name for m in opened.messages("/diagnostics")}
    assert tuple(cycles[0].name) == timing.SCALARS
    assert tuple(ticks[0].name) == pacing.SCALARS
    # The watchdog's own cycles answer no new state: they are in the ledger and have no timing.
    assert 0 < len(cycles) <= len(answers)
    assert len(ticks) == DURATION_S * 1e9 / PERIOD_NS - 1
    assert all(value.position[pacing.SCALARS.index("period_s")] > 0.0 for value in ticks)
    fresh = [value.position[pacing.SCALARS.index("fresh")] for value in ticks]
    share = ticks[-1].position[pacing.SCALARS.index("fresh_share")]
    assert share == pytest.approx(np.mean(fresh), abs=1e-12)
    assert names == {f"slip_vic_controller: {part}" for part in ("mode", "timing")}
