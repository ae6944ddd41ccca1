"""Wrench and slip whose stamps are ahead of the joint state: it was long on its way, or two clocks differ."""

from __future__ import annotations

import pytest

from slip_campaigns.faults.trial import PERIOD_S, START_NS, STEADY_NS, prepared
from slip_core.types import JointSample
from slip_sim_bridge.session import BridgeSession
from slip_vic_controller.core.input_monitor import Health
from slip_vic_controller.core.modes import Mode
from slip_vic_controller.core.session import ControllerSession, CycleResult
from slip_vic_controller.core.trouble import WORDS, Trouble, say

from .delivery import deliver

PERIOD_NS = round(PERIOD_S * 1e9)
FUTURE_S = 0.05  # default of `inputs.future_s`


def start() -> tuple[BridgeSession, ControllerSession]:
    scenario, law = prepared("paper_planar", False)
    bridge = BridgeSession(scenario.bridge, scenario.urdf)
    bridge.start_at(START_NS)
    return bridge, ControllerSession(law, lockstep=False)


def run(bridge: BridgeSession, controller: ControllerSession, ticks: int, late_ticks: int) -> list[CycleResult]:
    """Run with joint states that come later than wrench and slip; the arm is held by the bridge."""
    way: list[JointSample] = []
    results = []
    for tick in range(ticks):
        now_ns = STEADY_NS + tick * PERIOD_NS
        outputs = bridge.observe()
        deliver(controller, outputs, now_ns)
        way.append(outputs.joint)
        if len(way) > late_ticks:
            controller.inputs.add_joint(way.pop(0), now_ns)
            result = controller.cycle(now_ns)
            assert result is not None
            results.append(result)
        bridge.advance(None)
    return results


@pytest.mark.parametrize("late_s", [0.06, 0.12])
def test_the_law_does_not_begin_with_joint_states_that_are_already_late(late_s: float) -> None:
    results = run(*start(), 100, round(late_s / PERIOD_S))
    assert len(results) > 50
    assert {result.mode.mode for result in results} == {Mode.HOLD}
    assert results[-1].mode.reason == say("wrench", Trouble.FUTURE)
    assert all(result.command.effort.size for result in results)


def test_the_law_begins_where_they_are_less_late() -> None:
    results = run(*start(), 100, round(0.8 * FUTURE_S / PERIOD_S))
    assert results[-1].mode.mode == Mode.ACTIVE


def test_one_sample_ahead_is_its_own_fault_and_two_are_not() -> None:
    bridge, controller = start()
    run(bridge, controller, 50, 0)
    now_ns = STEADY_NS + 50 * PERIOD_NS
    outputs = bridge.observe()
    deliver(controller, outputs, now_ns)
    controller.inputs.add_joint(outputs.joint, now_ns)
    wrench = outputs.wrenches[0][-1]
    ahead = type(wrench)(wrench.stamp_ns + 10**9, wrench.wrench + 0.1)

    def health() -> Health:
        return controller.monitor.health(Trouble.NONE, outputs.joint.stamp_ns, now_ns)

    controller.inputs.add_wrench(0, ahead, now_ns)
    assert health().wrench == Trouble.NONE
    controller.inputs.add_wrench(0, ahead, now_ns)
    assert health().wrench == Trouble.FUTURE
    controller.inputs.add_wrench(0, type(wrench)(wrench.stamp_ns + 1, wrench.wrench + 0.1), now_ns)
    assert health().wrench == Trouble.NONE


def test_every_trouble_has_words() -> None:
    """A finding without words would be none."""
    assert set(WORDS) == set(Trouble) - {Trouble.NONE}
    assert all(say("x", trouble) for trouble in WORDS)
    assert say("x", Trouble.NONE) == ""
