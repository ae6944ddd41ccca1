"""What each mode does: how it is entered, its step in a cycle, and how it is left.

WAITING_INPUT   wait, give_nothing: no command where the arm's position is unknown
HOLD, FAULT     hold, which begins where the arm is then; leave_hold
the law         begin_law, follow; fail where it could not be evaluated
"""

from __future__ import annotations

from typing import Final

import numpy as np

from slip_core.cholesky import all_finite
from slip_core.compiled import part
from slip_core.vectors import IDENTITY, ZERO, mat, put, put_mat, vec
from slip_vic_controller.arm.estimator import BLIND_S, remember_input, unseen_ns
from slip_vic_controller.contact.observer import reset
from slip_vic_controller.contact.wrench_evidence import pull, start_evidence
from slip_vic_controller.cycle.governing import follow_goal, governed_reference, guard, pad_now, rest_on_path, yield_to
from slip_vic_controller.cycle.limit import finish
from slip_vic_controller.cycle.sensing import arm_of_load, begin_pad, held, pulls
from slip_vic_controller.governor.governor import discard_plan, start_governor
from slip_vic_controller.governor.grip import Handover
from slip_vic_controller.governor.plan import Governing
from slip_vic_controller.law.contact import pad_rotation
from slip_vic_controller.law.law import evaluate, finite_pose, scale_acceleration
from slip_vic_controller.path.goals import rest_at
from slip_vic_controller.path.paths import carried, put_reference, read_reference, reference_at, scaled
from slip_vic_controller.path.stream import rest_stream
from slip_vic_controller.safety.conditions import Mode, Reason, Request, Why, because, holds_for, next_mode
from slip_vic_controller.safety.hold import carry_load, hold_effort, keep_posture
from slip_vic_controller.safety.motion import forget, observe_motion
from slip_vic_controller.sizes import MAX_CONTACTS, MAX_JOINTS, NEVER
from slip_vic_controller.state import ArmCycle

FOLLOWS_M_S: Final = 0.25
"""Largest speed along an axis with which the pad follows a hand [m/s]: the reduced speed of ISO 10218-1."""


@part
def give_nothing(c: ArmCycle) -> None:
    """Give no command: drives hold the arm, or let it move; HOLD then restarts from the pose found.

    The joints rest where the model has them. They no longer feel the last command, so the effort limiter restarts.
    """
    c.state.now_ns, c.state.hold.known, c.state.sent.started = c.inputs.now_ns, 0, 0
    c.state.estimate.v[:] = 0.0
    remember_input(c.config.estimator, c.state.estimate, np.zeros(MAX_JOINTS))


@part
def wait(c: ArmCycle, why: Why) -> None:
    """Wait for the missing inputs without a command; afterwards everything restarts."""
    state = c.state
    next_mode(c.config.conditions, state.mode, why, c.inputs.request, c.inputs.now_ns)
    give_nothing(c)
    state.law.known, state.estimate.started, state.tare.watched = 0, 0, 0


@part
def hold(c: ArmCycle) -> None:
    """Hold the posture in which HOLD began.

    If neither a joint state nor the model gives the arm's position, efforts go to gravity compensation there, from the
    last command, however old, since nothing else shows the joints' load. If that lasts, or joints have read the
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
        finish(c, law.position, rest)
        return
    # After a pause something else has held the arm.
    if state.hold.known == 0 or inputs.now_ns - state.now_ns > config.joint.age_ns:
        state.hold.known, state.hold.posture[:n] = 1, sample.position[:n]
    pad = pad_rotation(config.law.contact[0], law.slips[0])
    r = arm_of_load(config, state)
    hold_effort(config.hold, state.hold, inputs.arm, sample, pad, r, outputs.wanted)
    if state.mode.reason.reason != Reason.FALLS:
        carry_load(config.hold, inputs.arm, r, outputs.wanted)
    if c.lead:
        task.start_ns += max(sample.stamp_ns - law.stamp_ns, 0)
    keep_joints(c)
    forget(state.observed)
    state.conditions[Reason.SATURATED].since_ns = NEVER
    finish(c, sample.position, sample.velocity)
    friction, period_s = config.estimator.friction, 1e-9 * config.period_ns
    keep_posture(config.hold, state.hold, sample, outputs.saturated, inputs.arm.M, friction, period_s)


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
        rest_on_path(c, not waited)
    state.hold.known = 0
    forget(state.observed)
    start_evidence(state.pad.evidence)  # how the pad has moved since then is unknown
    if config.has_observer != 0:
        reset(config.observer, state.observer, state.joint.answers.stamp_ns, c.inputs.arm.twist)


@part
def forget_pad(c: ArmCycle) -> None:
    """Begin again with the configured friction: a user wants it, or a tare has found another weight of the object."""
    if c.config.governor.mode != Governing.OFF:
        # A push makes a held object slip at a load that friction carries, and that load has been learnt.
        begin_pad(c)
        if c.lead:
            discard_plan(c.config.governor, c.task.governor)


@part
def keep_joints(c: ArmCycle) -> None:
    """Keep stamp and position of a good joint state, and gravity there.

    With other arms on the object its share of the weight belongs to it: an arm that loses sight must not let them
    carry all of it at once.
    """
    config, state, inputs = c.config, c.state, c.inputs
    law, sample, n = state.law, state.joint.answers, config.law.joints
    law.stamp_ns = max(sample.stamp_ns, law.stamp_ns)
    law.position[:n] = sample.position[:n]
    if all_finite(inputs.arm.gravity[:n]):
        law.gravity[:n] = inputs.arm.gravity[:n]
    if config.hold.carriers > 1 and state.mode.reason.reason != Reason.FALLS:
        carry_load(config.hold, inputs.arm, arm_of_load(config, state), law.gravity)


@part
def begin_law(c: ArmCycle) -> None:
    """Begin the law: the arm where it is, no slip; of the first arm also the trajectory, starting here and now."""
    config, task, state = c.config, c.task, c.state
    law, sample, n, arm = state.law, state.joint.answers, config.law.joints, c.inputs.arm
    law.known, law.stamp_ns = 1, sample.stamp_ns
    law.start_position[:], law.start_rotation[:] = arm.position, arm.rotation
    law.posture[:n] = sample.position[:n]
    law.position[:n], law.gravity[:n], law.e_previous[:] = sample.position[:n], arm.gravity[:n], 0.0
    for k in range(MAX_CONTACTS):
        put(law.slips[k].position, ZERO)
        put_mat(law.slips[k].rotation, IDENTITY)
    law.given_up.left_s, law.given_up.fast_s = 0.0, 0.0
    law.ramp = state.tuned
    law.ramp.begin_ns = sample.stamp_ns
    begin_pad(c)
    if c.lead:
        task.start_ns = sample.stamp_ns
        if config.follows_stream != 0:
            rest_stream(task.stream, vec(arm.position), mat(arm.rotation))
        if config.follows_goals != 0:
            rest_at(task.goal, pad_now(c))
        if config.governor.mode != Governing.OFF:
            start_governor(config.governor, task.governor, state.pad)


@part
def follow(c: ArmCycle) -> None:
    """Let the law command the arm, on what `sense` has found."""
    config, state, inputs, outputs = c.config, c.state, c.inputs, c.outputs
    follows_hand = c.lead and pulls(config, state, Handover.FOLLOW.value, inputs.now_ns)
    if follows_hand:
        yield_to(c)
    sample, n, axes, law = state.joint.answers, config.law.joints, config.law.contact[0].slip_axes, outputs.law
    dt_ns = max(sample.stamp_ns - state.law.stamp_ns, 0)
    if not _reference(c):
        fail(c, Reason.BAD_REFERENCE.value)
        return
    if follows_hand:  # the law cancels the wrench: what the hand adds to it is to move M_D
        push = mat(inputs.arm.rotation) @ pull(state.pad.evidence).linear
        for i in range(3):
            most = FOLLOWS_M_S * outputs.gains.gains.D_D[i]
            outputs.reference.acceleration[i] += min(max(push[i], -most), most) / outputs.gains.gains.M_D[i]
    q, qd, own = sample.position, sample.velocity, state.law
    evaluate(config.law, inputs.arm, q, qd, own.posture, own.e_previous, outputs)
    factor = guard(c, held(config, state, outputs.gains))
    if factor < 1.0 and law.ok != 0:
        scale_acceleration(config.law, inputs.arm, q, qd, own.posture, factor, outputs)
    if law.ok == 0:
        fail(c, Reason.NO_TORQUE.value)
        return
    own.e_previous[:] = law.e[3:]
    for k in range(config.law.contacts):
        own.slips[k] = outputs.slips[k]
    keep_joints(c)
    outputs.wanted[:n] = law.effort[:n]
    observe_motion(config.drop, axes, state.observed, inputs.arm, law, outputs.reference, dt_ns * 1e-9)
    finish(c, q, qd)


@part
def _reference(c: ArmCycle) -> bool:
    """Write the desired motion of this cycle; return whether it is finite.

    A path by topic or towards a goal is that of the first pad; the other pads keep to the object as they held it when
    the law began. A built-in path each pad runs through from where it was then.
    """
    config, task, state, outputs, law = c.config, c.task, c.state, c.outputs, c.state.law
    by_topic = config.follows_stream != 0 or config.follows_goals != 0
    keeps = not c.lead and (task.reference_known != 0 or by_topic)
    if keeps:
        desired = carried(read_reference(task.desired), state.grasp)
    elif task.reference_known != 0:
        desired = read_reference(task.reference)
    elif config.governor.mode != Governing.OFF:
        desired = governed_reference(c)
    elif config.follows_goals != 0:
        desired = follow_goal(task, state.joint.answers.stamp_ns)
    else:
        t = (state.joint.answers.stamp_ns - task.start_ns) * 1e-9 - config.start_s
        desired = reference_at(config.path, t, law.start_position, law.start_rotation)
    if not keeps and (task.path.scale != 1.0 or task.path.rate != 0.0):
        desired = scaled(desired, task.path)
    put_reference(outputs.reference, desired)
    if c.lead:
        task.desired = outputs.reference
    finite = all_finite(outputs.reference.twist) and all_finite(outputs.reference.acceleration)
    return finite and finite_pose(outputs.reference.position, outputs.reference.rotation)
