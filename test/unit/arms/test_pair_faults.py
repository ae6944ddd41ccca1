"""Campaign with two arms: every fault has its turn, and the monitor sees an arm that goes on alone."""

from __future__ import annotations

import pytest

from test.campaigns.faults.campaign import judge_pair
from test.campaigns.faults.monitors import TogetherMonitor
from test.campaigns.faults.pair import CASES, PERIOD_S, SCENARIOS, SIDES, PairTrial, make_plan
from test.campaigns.faults.plan import JOINT, SLIP, WRENCH, Fault


def test_every_fault_is_drawn() -> None:
    plans = [make_plan(1, trial) for trial in range(len(CASES))]
    assert plans == [make_plan(1, trial) for trial in range(len(CASES))]
    assert {name for name, _, _ in plans} == set(SCENARIOS)
    drawn = {(fault.kind, fault.target) for _, faults, _ in plans for fault in faults}
    assert drawn == set(CASES)


def test_monitor_sees_one_arm_follow() -> None:
    monitor = TogetherMonitor(SIDES, PERIOD_S)
    for k, follows in enumerate(((True, True), (True, False), (False, False), (False, True), (True, True))):
        monitor.check(k * PERIOD_S, follows)
    assert monitor.violations == []
    for k in range(3):
        monitor.check(1.0 + k * PERIOD_S, (False, True))
    assert len(monitor.violations) == 1
    assert "right arm follows" in monitor.violations[0]


@pytest.mark.parametrize("topic", [JOINT, WRENCH, SLIP])
def test_silent_input_stops_both(topic: str) -> None:
    """Without wrench or slip velocity of one arm both come to rest along the path first."""
    trial = PairTrial(SCENARIOS[1], (Fault("drop", f"right/{topic}", 0.2, 0.7, 0.9),), 1, 0)
    assert trial.run() == []
    assert trial.modes["HOLD" if topic == JOINT else "DEGRADED"] > 20


@pytest.mark.parametrize(("seed", "number"), [(7, 0), (1, 43)])
def test_drawn_trials_are_clean(seed: int, number: int) -> None:
    assert judge_pair(seed, number).violations == ()
