"""What an arm does without the law: HOLD from its beginning to its end, and no command where none is right."""

from __future__ import annotations

import numpy as np

from slip_core.cholesky import all_finite
from slip_core.compiled import part
from slip_core.vectors import mat
from slip_vic_controller.arm.estimator import BLIND_S, remember_input, unseen_ns
from slip_vic_controller.contact.observer import reset
from slip_vic_controller.cycle.contact import begin_pad
from slip_vic_controller.cycle.governing import rest_on_path
from slip_vic_controller.cycle.limit import finish
from slip_vic_controller.cycle.sensing import gains_now
from slip_vic_controller.cycle.wrench import arm_of_load, own_wrench
from slip_vic_controller.governor.governor import discard_plan
from slip_vic_controller.governor.plan import Governing
from slip_vic_controller.law.contact import pad_rotation
from slip_vic_controller.safety.conditions import Reason, Why, because
from slip_vic_controller.safety.hold import carry_load, hold_effort, keep_posture, update_load_error
from slip_vic_controller.safety.latency import forget_latency
from slip_vic_controller.safety.modes import Mode, Request, holds_for, next_mode
from slip_vic_controller.safety.motion import forget
from slip_vic_controller.safety.validation import frozen
from slip_vic_controller.sizes import MAX_JOINTS, NEVER
from slip_vic_controller.state import ArmCycle, ArmState, ControllerConfig, CycleInputs


@part
def give_nothing(c: ArmCycle) -> None:
    """Give no command: drives hold the arm by themselves, or let it move; HOLD begins again where it is then.

    The joints rest where the model has them.
    """
    c.state.now_ns, c.state.hold.known = c.inputs.now_ns, 0
    c.state.estimate.v[:] = 0.0
    remember_input(c.config.estimator, c.state.estimate, np.zeros(MAX_JOINTS))


@part
def wait(c: ArmCycle, why: Why) -> None:
    """Wait for what is missing, without a command; everything begins again after it."""
    state = c.state
    next_mode(c.config.conditions, state.mode, why, c.inputs.request, c.inputs.now_ns)
    give_nothing(c)
    state.law.known, state.estimate.started, state.tare.watched = 0, 0, 0
    state.hold.load_error[:] = 0.0
    forget_latency(state.latency)


@part
def hold(c: ArmCycle) -> None:
    """Keep the posture in which HOLD began; what the wrench has shown of the load stays until the law begins.

    Where neither a joint state nor the model tells where the arm is, efforts go to gravity compensation there: from the
    last command, however old, since nothing else tells what the joints feel. Where that lasts, or joints have read the
    same for so long that HOLD would lose the arm, there is no command.
    """
    config, task, state, inputs, outputs = c.config, c.task, c.state, c.inputs, c.outputs
    law, sample, n = state.law, state.joint.answers, config.law.joints
    task.path.scale, task.path.rate = 0.0, 0.0
    state.grip.command = max(state.grip.command, config.grip.nominal_force)
    seen = inputs.arm.M[0, 0] > 0.0
    blind = unseen_ns(config.estimator, state.estimate) > 1e9 * BLIND_S or (not seen and state.sent.started == 0)
    if holds_for(state.mode, Reason.JOINT_STATE.value, Reason.FROZEN.value):
        blind = blind or (seen and 1e-9 * (inputs.now_ns - state.joint.equal_since_ns) > BLIND_S)
    if blind:
        give_nothing(c)
        return
    if not seen:
        state.hold.known, rest = 0, np.zeros(MAX_JOINTS)
        outputs.wanted[:n] = law.gravity[:n]
        state.sent.now_ns = max(state.sent.now_ns, inputs.now_ns - config.command.longest_step_ns)
        finish(c, law.position, rest, False)
        return
    # After a pause something else has held the arm.
    if state.hold.known == 0 or inputs.now_ns - state.now_ns > config.conditions.gap_ns:
        state.hold.known, state.hold.posture[:n] = 1, sample.position[:n]
    dt_ns = max(sample.stamp_ns - law.stamp_ns, 0)
    keep_posture(config.hold, state.hold, sample, config.command.velocity, inputs.arm.M, config.estimator.friction)
    pad = pad_rotation(config.law.contact[0], law.slips[0])
    r = arm_of_load(config, state, pad)
    measured, good = own_wrench(config, state, mat(inputs.arm.rotation)), outputs.health.wrench == Reason.NONE
    if good and measured.dot(measured) < np.inf and not frozen(config.joint, state.joint, inputs.now_ns):
        update_load_error(config.hold, state.hold, inputs.arm, r, measured, dt_ns * 1e-9)
    late_s = state.latency.most_ns * 1e-9
    hold_effort(config.hold, state.hold, inputs.arm, sample, pad, r, late_s, outputs.wanted)
    if not (state.mode.reason.reason == Reason.FALLS and state.mode.reason.prefix == 0):
        carry_load(config.hold, state.hold, inputs.arm, r, outputs.wanted)
    if c.lead:
        task.start_ns += dt_ns
    keep_joints(config, state, inputs)
    forget(state.observed)
    state.conditions[Reason.SATURATED].since_ns = NEVER
    finish(c, sample.position, sample.velocity, False)


@part
def fail(c: ArmCycle, cause: int) -> None:
    """Hold because the law could not be evaluated; cause: why."""
    next_mode(c.config.conditions, c.state.mode, because(cause, 0), Request.NONE.value, c.inputs.now_ns)
    if cause == Reason.BAD_REFERENCE or cause == Reason.NO_TORQUE:
        c.task.forgets = 1
    c.state.hold.known = 0
    hold(c)


@part
def leave_hold(c: ArmCycle) -> None:
    """Let the path start from rest after a HOLD; the time that passed in it is not part of the path."""
    config, task, state = c.config, c.task, c.state
    if c.lead:
        waited = c.outputs.before.mode == Mode.WAITING_INPUT
        task.path.scale, task.path.rate = (1.0 if waited else 0.0), 0.0
        rest_on_path(config, task, c.inputs.arm, not waited)
    state.hold.known, state.hold.load_error[:] = 0, 0.0
    forget(state.observed)
    if config.has_observer != 0:
        reset(config.observer, state.observer, state.joint.answers.stamp_ns, c.inputs.arm.twist)


@part
def forget_pad(c: ArmCycle) -> None:
    """Begin again with the configured friction: a user wants it, or a tare has found another weight of the object."""
    if c.config.governor.mode != Governing.OFF:
        gains_now(c.state, c.state.joint.answers.stamp_ns, c.outputs)
        # A push makes a held object slip at a load that friction carries, and that load has been learnt.
        begin_pad(c.config, c.state, c.inputs.arm, c.outputs.gains)
        if c.lead:
            discard_plan(c.config.governor, c.task.governor)


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
