"""A controller that goes on after a pause, or starts anew in motion, begins at what the joints feel."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from slip_campaigns.faults.trial import PERIOD_S, START_NS, STEADY_NS, prepared
from slip_core.types import JointSample
from slip_sim_bridge.session import BridgeSession
from slip_vic_controller.core.modes import Mode
from slip_vic_controller.core.session import ControllerSession
from slip_vic_controller.core.trouble import Trouble

from .delivery import deliver

ROUNDING = 1e-9  # [N m]
STEP = PERIOD_S * 1000.0  # [N m]: what the default slope allows in a control period
PAUSE_NS = 400_000_000


class Loop:
    """Bridge and controller without topics, by virtual steady time."""

    def __init__(self) -> None:
        scenario, self.law = prepared("paper_planar", True)
        assert scenario.controller.safety.limits.effort_rate * PERIOD_S == STEP
        self.bridge = BridgeSession(scenario.bridge, scenario.urdf)
        self.bridge.start_at(START_NS)
        self.controller = ControllerSession(self.law, lockstep=False)
        self.now_ns = STEADY_NS
        self.effort = np.zeros(0)

    def observe(self) -> JointSample:
        """Deliver all samples but the joint state, which is returned."""
        outputs = self.bridge.observe()
        deliver(self.controller, outputs, self.now_ns)
        return outputs.joint

    def cycle(self, joint: JointSample) -> np.ndarray:
        """Answer a joint state, advance the bridge, and return the effort."""
        self.controller.inputs.add_joint(joint, self.now_ns)
        result = self.controller.cycle(self.now_ns)
        assert result is not None
        self.bridge.advance(result.command)
        self.now_ns += round(1e9 * PERIOD_S)
        return result.command.effort

    def run(self, ticks: int) -> np.ndarray:
        """Run and return the last effort."""
        for _ in range(ticks):
            effort = self.cycle(self.observe())
        return effort


def test_restart_in_motion_makes_no_step() -> None:
    """The new controller knows nothing; its first command differs from the last one by no more than one step."""
    loop = Loop()
    before = loop.run(150)
    joint = loop.observe()
    assert np.abs(joint.velocity).max() > 0.05, "the arm must move for this test to mean something"
    loop.bridge.advance(None)
    loop.controller = ControllerSession(loop.law, lockstep=False)
    efforts = []
    for _ in range(50):
        joint = loop.observe()
        effort = loop.cycle(joint)
        if len(effort):
            start = joint.effort if not efforts else efforts[-1]
            assert np.abs(effort - start).max() <= STEP + ROUNDING
            efforts.append(effort)
    assert len(efforts) > 40
    assert np.abs(efforts[0] - before).max() <= 3 * STEP  # the bridge held for two ticks in between


@pytest.mark.parametrize("felt", [6.0, -20.0])
def test_after_a_pause_efforts_begin_where_the_joints_are_though_positions_jumped(felt: float) -> None:
    """Found by the campaign over DDS: a process that was stopped began at gravity compensation of an old position."""
    loop = Loop()
    loop.run(100)
    loop.now_ns += PAUSE_NS
    joint = loop.observe()
    jumped = dataclasses.replace(joint, position=joint.position + 0.4, effort=joint.effort + felt)
    jumped = dataclasses.replace(jumped, stamp_ns=joint.stamp_ns + PAUSE_NS)
    effort = loop.cycle(jumped)
    assert loop.controller.inputs.joint_trouble == Trouble.JUMP
    limit = loop.law.arm.effort_limit
    assert np.abs(effort - np.clip(jumped.effort, -limit, limit)).max() <= STEP + ROUNDING


def test_hold_begins_anew_where_the_arm_is_after_a_pause() -> None:
    """Somebody else held the arm while the controller did not run: it is not pulled back to where it was before."""
    loop = Loop()
    loop.run(60)
    loop.controller.monitor.set_publishers({}, 2)
    loop.run(100)
    assert loop.controller.mode == Mode.FAULT
    loop.now_ns += PAUSE_NS
    joint = loop.observe()
    moved = dataclasses.replace(
        joint, position=joint.position + 0.01, velocity=joint.velocity + 0.025, stamp_ns=joint.stamp_ns + PAUSE_NS
    )
    loop.cycle(moved)
    assert loop.controller.inputs.joint_trouble == Trouble.NONE
    assert loop.controller.safety is not None
    assert loop.controller.safety.posture is not None
    np.testing.assert_array_equal(loop.controller.safety.posture, moved.position)


def test_after_a_pause_a_bad_joint_state_is_not_bridged() -> None:
    """The machine stood still, and the first joint state after that is a bad one: the last effort is old."""
    for pause_ns, mode in ((0, Mode.ACTIVE), (PAUSE_NS, Mode.HOLD)):
        loop = Loop()
        loop.run(50)
        assert loop.controller.mode == Mode.ACTIVE
        loop.now_ns += pause_ns
        bad = dataclasses.replace(loop.observe(), velocity=np.full(7, np.nan))
        loop.cycle(bad)
        assert loop.controller.mode == mode
