"""Wrench and slip whose stamps are ahead of the joint state: it was long on its way, or two clocks differ."""

from __future__ import annotations

import pytest

from slip_core.types import JointSample
from slip_vic_controller.safety.faults import Fault, Input, describe_fault
from slip_vic_controller.safety.modes import Mode
from slip_vic_controller.safety.validation import FUTURE_S
from slip_vic_controller.session.cycle_result import CycleResult
from test.campaigns.faults.trial import PERIOD_S, STEADY_NS, prepared
from test.support.delivery import begun_bridge, deliver
from test.support.one_arm import OneArm

PERIOD_NS = round(PERIOD_S * 1e9)


def run(late_s: float) -> list[CycleResult]:
    """Run with joint states that come later than wrench and slip; the arm is held by the bridge."""
    scenario, law = prepared("paper_planar", False, "vic")
    bridge, controller = begun_bridge(scenario), OneArm(law)
    way: list[JointSample] = []
    results = []
    for tick in range(100):
        now_ns = STEADY_NS + tick * PERIOD_NS
        outputs = bridge.observe()
        deliver(controller, outputs, now_ns)
        way.append(outputs.arms[0].joint)
        if len(way) > round(late_s / PERIOD_S):
            controller.add_joint(way.pop(0), now_ns)
            result = controller.cycle(now_ns)
            assert result is not None
            results.append(result)
        bridge.advance([None])
    return results


@pytest.mark.parametrize("late_s", [0.06, 0.12])
def test_the_law_does_not_begin_with_joint_states_that_are_already_late(late_s: float) -> None:
    results = run(late_s)
    assert len(results) > 50
    assert {result.mode for result in results} == {Mode.HOLD}
    assert results[-1].reason == describe_fault(Input.WRENCH, Fault.FUTURE)
    assert all(result.command.effort.size for result in results)


def test_the_law_begins_where_they_are_less_late() -> None:
    assert run(0.8 * FUTURE_S)[-1].mode == Mode.ACTIVE
