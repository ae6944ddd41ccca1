"""Campaign with two arms: every fault has its turn, and the monitor sees an arm that goes on alone."""

from __future__ import annotations

import pytest

from test.campaigns.faults.campaign import judge_pair
from test.campaigns.faults.monitors import TogetherMonitor
from test.campaigns.faults.pair import CASES, PERIOD_S, SCENARIOS, SIDES, PairTrial, make_plan
from test.campaigns.faults.plan import JOINT, SLIP, WRENCH, Fault
from test.support.two_arms_paused import fastest_joint


def test_every_fault_on_either_arm_has_its_turn() -> None:
    plans = [make_plan(1, trial) for trial in range(len(CASES))]
    assert plans == [make_plan(1, trial) for trial in range(len(CASES))]
    assert {name for name, _, _ in plans} == set(SCENARIOS)
    drawn = {(fault.kind, fault.target) for _, faults, _ in plans for fault in faults}
    assert drawn == set(CASES)


def test_the_monitor_sees_one_arm_that_goes_on() -> None:
    monitor = TogetherMonitor(SIDES, PERIOD_S)
    for k, follows in enumerate(((True, True), (True, False), (False, False), (False, True), (True, True))):
        monitor.check(k * PERIOD_S, follows)
    assert monitor.violations == []
    for k in range(3):
        monitor.check(1.0 + k * PERIOD_S, (False, True))
    assert len(monitor.violations) == 1
    assert "right arm follows" in monitor.violations[0]


@pytest.mark.parametrize("topic", [JOINT, WRENCH, SLIP])
def test_an_input_of_one_arm_that_falls_silent_stops_both(topic: str) -> None:
    """Without wrench or slip velocity of one arm both come to rest along the path first."""
    trial = PairTrial(SCENARIOS[1], (Fault("drop", f"right/{topic}", 0.2, 0.7, 0.9),), 1, 0)
    assert trial.run() == []
    assert trial.modes["HOLD" if topic == JOINT else "DEGRADED"] > 20


@pytest.mark.parametrize(("seed", "number"), [(7, 0), (7, 9), (1, 43)])
def test_trials_keep_the_promises(seed: int, number: int) -> None:
    assert judge_pair(seed, number).violations == ()


@pytest.mark.parametrize(("topic", "mode", "least"), [(JOINT, "HOLD", 21), (WRENCH, "DEGRADED", 5)])
def test_both_resume_together(topic: str, mode: str, least: int) -> None:
    trial = PairTrial(SCENARIOS[1], (Fault("drop", f"left/{topic}", 0.2, 0.1, 0.9),), 1, 0)
    assert trial.run() == []
    assert trial.modes[mode] >= least
    assert trial.follows == (True, True)


@pytest.mark.parametrize(("name", "pause"), [(SCENARIOS[0], (0.3, 0.5)), (SCENARIOS[1], (0.3, 0.4))])
def test_at_50_hz_both_rest_after_a_pause_that_has_thrown_them(name: str, pause: tuple[float, float]) -> None:
    fastest, at_the_end = fastest_joint(name, 50, (pause,))
    assert fastest > 3.0, "else there is nothing to bring to rest"
    assert at_the_end < 0.2


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("kind", ["duplicate", "reorder"])
def test_joint_states_of_one_arm_that_come_twice_or_late_do_not_disturb_the_law(kind: str, side: str) -> None:
    """They come while a good one waits for the partner's; its terms were missing then, and the arm fell."""
    trial = PairTrial(SCENARIOS[1], (Fault(kind, f"{side}/{JOINT}", 0.2, 0.5, 0.4),), 1, 0)
    assert trial.run() == []
    assert set(trial.modes) <= {"ACTIVE", "DEGRADED"}
