"""What a bridge measures, handed to a controller without topics."""

from __future__ import annotations

from slip_sim_bridge.session import BridgeSession, TickOutputs
from slip_vic_controller.session.cycle_result import CycleResult
from test.campaigns.faults.trial import START_NS
from test.support.one_arm import OneArm, one_arm


def begun_bridge(scenario) -> BridgeSession:
    """Return the bridge of a scenario at the campaign's wall clock."""
    bridge = BridgeSession(scenario.bridges, scenario.urdfs)
    bridge.start_at(START_NS)
    return bridge


def realtime(scenario) -> OneArm:
    return OneArm(one_arm(scenario.controller, scenario.urdf, lockstep=False))


def deliver(controller: OneArm, outputs: TickOutputs, now_ns: int) -> None:
    """Hand over wrenches and slip velocities; the joint state, which starts a cycle, is left to the caller."""
    for wrench in outputs.arms[0].wrenches:
        controller.add_wrench(0, wrench, now_ns)
    for slip in outputs.arms[0].slips:
        controller.add_slip(0, slip, now_ns)


def answered_outputs(controller: OneArm, outputs: TickOutputs, now_ns: int) -> CycleResult:
    """Hand over everything and return the answer."""
    deliver(controller, outputs, now_ns)
    controller.add_joint(outputs.arms[0].joint, now_ns)
    result = controller.cycle(now_ns)
    assert result is not None
    return result
