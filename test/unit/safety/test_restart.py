"""A controller that goes on after a pause, or starts anew in motion, begins at what the joints feel."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from slip_core.types import EffortCommand, JointSample
from slip_vic_controller.safety.faults import Fault
from slip_vic_controller.safety.modes import Mode
from slip_vic_controller.safety.validation import ACCEPT_AFTER
from test.campaigns.faults.plan import BRIDGE, CONTROLLER, JOINT, SLIP, WRENCH, Plan
from test.campaigns.faults.plan import Fault as Planned
from test.campaigns.faults.trial import PERIOD_S, STEADY_NS, prepared, run_trial
from test.support.delivery import begun_bridge, deliver
from test.support.one_arm import OneArm

ROUNDING = 1e-9  # [N m]
STEP = PERIOD_S * 1000.0  # [N m]: what the default slope allows in a control period
AFTER_PAUSE = 5.0  # [N m]: and in the longest step that a pause counts
PAUSE_NS = 400_000_000


class Loop:
    """Bridge and controller without topics, by virtual steady time."""

    def __init__(self, drive: str = "ideal") -> None:
        scenario, self.law = prepared("paper_planar", True, "vic", drive=drive)
        assert scenario.controller.safety.limits.effort_rate * PERIOD_S == STEP
        self.bridge = begun_bridge(scenario)
        self.controller = OneArm(self.law)
        self.now_ns = STEADY_NS
        self.effort = np.zeros(0)

    def observe(self) -> JointSample:
        """Deliver all samples but the joint state, which is returned."""
        outputs = self.bridge.observe()
        deliver(self.controller, outputs, self.now_ns)
        return outputs.arms[0].joint

    def cycle(self, joint: JointSample) -> np.ndarray:
        """Answer a joint state, advance the bridge, and return the effort."""
        self.controller.add_joint(joint, self.now_ns)
        self.fault = Fault(self.controller.state.joint.pending_fault)
        result = self.controller.cycle(self.now_ns)
        assert result is not None
        self.bridge.advance([result.command])
        self.now_ns += round(1e9 * PERIOD_S)
        return result.command.numbers

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
    loop.bridge.advance([None])
    loop.controller = OneArm(loop.law)
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
    assert loop.fault == Fault.RESTARTED
    limit = loop.law.first.robot.effort_limit
    assert np.abs(effort - np.clip(jumped.effort, -limit, limit)).max() <= STEP + ROUNDING


def test_after_a_pause_without_joint_states_efforts_go_on_from_the_last_ones() -> None:
    """Found by the campaign with two arms: they began at gravity compensation, of a mass that was told wrong."""
    loop = Loop()
    loop.run(60)
    for _ in range(2):
        joint = loop.observe()
        last = loop.cycle(dataclasses.replace(joint, velocity=joint.velocity + 0.2))
    loop.now_ns += PAUSE_NS
    result = loop.controller.watchdog(loop.now_ns)
    assert result is not None
    assert np.abs(loop.controller.gravity - last).max() > 2 * STEP, (
        "gravity must differ for this test to mean something"
    )
    assert np.abs(result.command.numbers - last).max() <= AFTER_PAUSE + ROUNDING


def test_after_a_pause_velocities_begin_at_those_of_the_joints_and_brake_for_one_period() -> None:
    """Found by the campaign: the first command braked for as long as the longest step of a pause."""
    loop = Loop("velocity_500")
    loop.run(150)
    loop.now_ns += PAUSE_NS
    joint = loop.observe()
    moves = dataclasses.replace(joint, velocity=np.full(7, 0.2), stamp_ns=joint.stamp_ns + PAUSE_NS)
    velocity = loop.cycle(moves)
    assert loop.controller.mode == Mode.HOLD
    assert np.abs(velocity - moves.velocity).max() > 0.0
    most = loop.law.first.params.command.acceleration_limit * PERIOD_S
    assert np.abs(velocity - moves.velocity).max() <= most + ROUNDING


def test_hold_begins_anew_where_the_arm_is_after_a_pause() -> None:
    """Somebody else held the arm while the controller did not run: it is not pulled back to where it was before."""
    loop = Loop()
    loop.run(60)
    loop.controller.set_publishers({}, 2)
    loop.run(100)
    assert loop.controller.mode == Mode.FAULT
    kept = loop.controller.state.hold.posture[:7].copy()
    loop.run(5)
    np.testing.assert_array_equal(loop.controller.state.hold.posture[:7], kept)
    loop.now_ns += PAUSE_NS
    joint = loop.observe()
    moved = dataclasses.replace(
        joint, position=joint.position + 0.01, velocity=joint.velocity + 0.025, stamp_ns=joint.stamp_ns + PAUSE_NS
    )
    loop.cycle(moved)
    assert loop.fault == Fault.NONE
    np.testing.assert_array_equal(loop.controller.state.hold.posture[:7], moved.position)


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


def test_a_source_that_starts_anew_begins_a_new_trajectory_without_a_step() -> None:
    """The clock of the joint states goes back: WAITING_INPUT for the samples that agree, then the path from here."""
    loop = Loop()
    last = loop.run(20)  # before it moves fast: without commands the bridge stops the arm, and the object would slide
    begun_ns = int(loop.controller.task.start_ns)
    back_ns = 500_000_000_000
    modes = []
    for _ in range(60):
        outputs = loop.bridge.observe()
        for add, samples in (
            (loop.controller.add_wrench, outputs.arms[0].wrenches),
            (loop.controller.add_slip, outputs.arms[0].slips),
        ):
            for sample in samples:
                add(0, dataclasses.replace(sample, stamp_ns=sample.stamp_ns - back_ns), loop.now_ns)
        joint = dataclasses.replace(outputs.arms[0].joint, stamp_ns=outputs.arms[0].joint.stamp_ns - back_ns)
        loop.controller.add_joint(joint, loop.now_ns)
        result = loop.controller.cycle(loop.now_ns)
        command = None if result is None else result.command
        loop.bridge.advance([command and EffortCommand(command.stamp_ns + back_ns, command.effort)])
        loop.now_ns += round(1e9 * PERIOD_S)
        if result is not None and len(result.command.effort):
            assert np.abs(result.command.effort - last).max() <= 5 * STEP
            last = result.command.effort
        modes.append(None if result is None else result.mode)
    accept = ACCEPT_AFTER
    assert modes[: accept - 1] == [None] * (accept - 1)  # stamps that jump are not answered
    assert modes[-1] in (Mode.ACTIVE, Mode.DEGRADED)
    assert loop.controller.task.start_ns < begun_ns - back_ns // 2


def test_until_everything_was_seen_there_is_no_effort() -> None:
    loop = Loop()
    outputs = loop.bridge.observe()
    loop.controller.add_joint(outputs.arms[0].joint, loop.now_ns)
    result = loop.controller.cycle(loop.now_ns)
    assert result is not None
    assert result.command.effort.size == 0
    assert (result.mode, result.reason) == (Mode.WAITING_INPUT, "waits for wrench of contact 0, slip of contact 0")
    assert not loop.controller.begun
    loop.controller.set_active(False)
    deliver(loop.controller, outputs, loop.now_ns)
    result = loop.controller.answer(outputs.arms[0].joint, Fault.NONE, loop.now_ns, 1, None)
    assert (result.mode, result.reason) == (Mode.WAITING_INPUT, "waits for activation")


def test_after_a_stall_the_law_goes_on_by_itself() -> None:
    """Nodes that a loaded machine does not run for a while, and inputs that stay away as long."""
    resumes_s = prepared("vertical_plane", False, "governed")[0].controller.safety.resume_after_s
    for kind, target in (("stop", CONTROLLER), ("stop", BRIDGE), ("drop", JOINT), ("drop", WRENCH), ("drop", SLIP)):
        for stall_s in (0.06, 0.2):
            stall = Planned(kind, target, 0.4, stall_s, 0.9)
            outcome = run_trial(Plan(0, 1, "vertical_plane", False, "governed", (stall,)))
            assert outcome.violations == [], stall
            assert outcome.modes["DEGRADED" if target == WRENCH else "HOLD"] > 0 or target == SLIP, stall
            assert outcome.recovery_s is not None, stall
            assert outcome.recovery_s < resumes_s + 3 * PERIOD_S, stall
