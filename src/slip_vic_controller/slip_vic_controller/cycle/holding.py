"""What an arm does without the law: HOLD, the bridge over a gap of joint states, or no command at all."""

from __future__ import annotations

import numpy as np

from slip_core.compiled import part
from slip_core.vectors import mat
from slip_vic_controller.arm.estimator import stay_blind
from slip_vic_controller.arm.plausibility import BLIND_S, is_blind
from slip_vic_controller.contact.observer import reset
from slip_vic_controller.cycle.contact import begin_pad
from slip_vic_controller.cycle.finishing import finish
from slip_vic_controller.cycle.gains import gains_now
from slip_vic_controller.cycle.governing import rest_on_path
from slip_vic_controller.cycle.wrench import arm_of_load, own_wrench
from slip_vic_controller.governor.governor import discard_plan
from slip_vic_controller.governor.plan import Governing
from slip_vic_controller.law.contact import pad_rotation
from slip_vic_controller.safety.conditions import Reason, because, of_fault
from slip_vic_controller.safety.drop_detection import forget
from slip_vic_controller.safety.effort_limiter import needs_restart
from slip_vic_controller.safety.hold import begin_posture, carry_load, hold_effort, keep_posture, update_load_error
from slip_vic_controller.safety.modes import Mode, Request, follows, holds_for, next_mode
from slip_vic_controller.safety.validation import all_finite, fine
from slip_vic_controller.sizes import MAX_JOINTS, NEVER
from slip_vic_controller.state import ArmState, ControllerConfig, CycleInputs, CycleOutputs, Step, TaskState

JOINT_DAMPING = 2.0
"""Joint damping where only gravity is compensated [N m s/rad]."""


@part
def prepare(
    config: ControllerConfig, task: TaskState, state: ArmState, inputs: CycleInputs, outputs: CycleOutputs, lead: bool
) -> None:
    """Do what comes before the law in this cycle, or instead of it."""
    decision = outputs.decision
    if decision.step == Step.BRIDGE:
        _bridge(config, task, state, inputs, outputs, outputs.health.joint)
    elif decision.step == Step.ANSWER and not follows(state.mode.mode):
        known_anew = decision.request == Request.RESET_FAULT or decision.reweighed != 0
        if known_anew and config.governor.mode != Governing.OFF:
            gains_now(state, state.joint.answers.stamp_ns, outputs)
            # A push makes a held object slip at a load that friction carries, and that load has been learnt.
            begin_pad(config, state, inputs.arm, outputs.gains)
            if lead:
                discard_plan(config.governor, task.governor)
        frozen_s = 1e-9 * (inputs.now_ns - state.joint.equal_since_ns)
        blind = frozen_s > BLIND_S and holds_for(state.mode, Reason.JOINT_STATE.value, Reason.FROZEN.value)
        if blind or is_blind(config.estimator, state.estimate):
            leave_to_drives(config, state, inputs)
        else:
            hold(config, task, state, inputs, outputs, fine(outputs.health.wrench) and decision.freezes == 0, lead)
    elif decision.step == Step.ANSWER and not follows(decision.entered):
        # After a HOLD the path starts from rest; and the time that passed in it is not part of the path.
        if lead:
            task.path.scale, task.path.rate = (1.0 if decision.entered == Mode.WAITING_INPUT else 0.0), 0.0
            rest_on_path(config, task, inputs.arm, decision.entered != Mode.WAITING_INPUT)
        state.hold.known, state.hold.load_error[:] = 0, 0.0
        forget(state.observed)
        if config.cycle.has_observer != 0:
            reset(config.observer, state.observer, state.joint.answers.stamp_ns, inputs.arm.twist)


@part
def hold(
    config: ControllerConfig,
    task: TaskState,
    state: ArmState,
    inputs: CycleInputs,
    outputs: CycleOutputs,
    wrench_good: bool,
    lead: bool,
) -> None:
    """Keep the posture in which HOLD began; what the wrench has shown of the load stays until the law begins."""
    law, sample = state.law, state.joint.answers
    # After a pause something else has held the arm.
    if state.hold.known == 0 or inputs.now_ns - state.now_ns > config.conditions.gap_ns:
        begin_posture(config.hold, state.hold, sample)
    dt_ns = max(sample.stamp_ns - law.stamp_ns, 0)
    friction, limit = config.estimator.friction, config.motion.velocity
    keep_posture(config.hold, state.hold, sample, limit, inputs.arm.M, friction)
    pad = pad_rotation(config.law.contact[0], law.slips[0])
    r = arm_of_load(config, state, pad)
    if wrench_good:
        measured = own_wrench(config, state, mat(inputs.arm.rotation))
        update_load_error(config.hold, state.hold, inputs.arm, r, measured, dt_ns * 1e-9)
    late_s = state.latency.most_ns * 1e-9
    hold_effort(config.hold, state.hold, inputs.arm, sample, pad, r, late_s, outputs.wanted)
    if not (state.mode.reason.reason == Reason.FALLS and state.mode.reason.prefix == 0):
        carry_load(config.hold, state.hold, inputs.arm, r, outputs.wanted)
    if lead:
        task.start_ns += dt_ns
    keep_joints(config, state, inputs)
    task.path.scale, task.path.rate = 0.0, 0.0
    forget(state.observed)
    state.conditions[Reason.SATURATED].since_ns, state.conditions[Reason.NOT_FOLLOWING].since_ns = NEVER, NEVER
    finish(config, state, inputs, outputs, sample.position, sample.velocity, False)


@part
def _bridge(
    config: ControllerConfig, task: TaskState, state: ArmState, inputs: CycleInputs, outputs: CycleOutputs, fault: int
) -> None:
    """Bridge a short gap of good joint states, in which nothing tells where the arm is, with the last effort.

    Then let it go to gravity compensation, and give no command where the gap is a pause.
    """
    n, now_ns, rest = config.law.joints, inputs.now_ns, np.zeros(MAX_JOINTS)
    if bridges_gap(config, state, now_ns):
        # `finish` takes the disturbance off once more.
        outputs.wanted[:n] = state.limiter.effort[:n] - state.estimate.taken_off[:n]
    else:
        outputs.wanted[:n] = state.law.gravity[:n]
        next_mode(config.modes, state.mode, of_fault(Reason.JOINT_STATE.value, fault), inputs.request, now_ns)
        task.path.scale, task.path.rate, state.hold.known = 0.0, 0.0, 0
        if is_blind(config.estimator, state.estimate):
            leave_to_drives(config, state, inputs)
            return
    if needs_restart(config.motion.drive, state.limiter, now_ns):  # the drives go on as in the pause
        leave_to_drives(config, state, inputs)
        return
    finish(config, state, inputs, outputs, state.law.position, rest, False)


@part
def bridges_gap(config: ControllerConfig, state: ArmState, now_ns: int) -> bool:
    """Return whether a gap of good joint states is bridged: shortly, and not after a pause of the controller."""
    ran = now_ns - state.now_ns <= config.conditions.gap_ns
    return ran and state.limiter.started != 0 and now_ns - state.joint_bad_ns <= config.conditions.bridge_ns


@part
def leave_to_drives(config: ControllerConfig, state: ArmState, inputs: CycleInputs) -> None:
    """Give no command: without feedback HOLD would lose the arm; drives hold it by themselves."""
    state.limiter.started, state.now_ns, state.hold.known = 0, inputs.now_ns, 0
    stay_blind(config.estimator, state.estimate)


@part
def keep_joints(config: ControllerConfig, state: ArmState, inputs: CycleInputs) -> None:
    """Keep stamp and position of a good joint state, and gravity there.

    With other arms on the object its share of the weight belongs to it: an arm that loses sight must not let them
    carry all of it at once.
    """
    law, sample, n = state.law, state.joint.answers, config.law.joints
    law.stamp_ns = max(sample.stamp_ns, law.stamp_ns)
    law.position[:n] = sample.position[:n]
    if all_finite(inputs.arm.gravity[:n]):
        law.gravity[:n] = inputs.arm.gravity[:n]
    if config.hold.carriers > 1 and state.mode.reason.reason != Reason.FALLS:
        r = arm_of_load(config, state, pad_rotation(config.law.contact[0], law.slips[0]))
        carry_load(config.hold, state.hold, inputs.arm, r, law.gravity)


@part
def hold_without_law(
    config: ControllerConfig, task: TaskState, state: ArmState, inputs: CycleInputs, outputs: CycleOutputs, cause: int
) -> None:
    """Hold because the law could not be evaluated: gravity compensation with damping in this cycle, and HOLD."""
    law, sample, n = state.law, state.joint.answers, config.law.joints
    keep_joints(config, state, inputs)
    for j in range(n):
        torque = law.gravity[j] - JOINT_DAMPING * sample.velocity[j]
        outputs.wanted[j] = min(max(torque, -config.law.effort_limit[j]), config.law.effort_limit[j])
    next_mode(config.modes, state.mode, because(cause, 0), Request.NONE.value, inputs.now_ns)
    if cause == Reason.BAD_REFERENCE or cause == Reason.NO_TORQUE:
        task.forgets = 1
    task.path.scale, task.path.rate = 0.0, 0.0
    begin_posture(config.hold, state.hold, sample)
    finish(config, state, inputs, outputs, sample.position, sample.velocity, False)
