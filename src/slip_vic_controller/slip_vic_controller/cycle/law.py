"""What the law commands: the desired motion, the evaluation of the law, and whether the arm follows."""

from __future__ import annotations

from typing import Final

import numpy as np

from slip_core.cholesky import all_finite
from slip_core.compiled import part
from slip_core.vectors import mat
from slip_vic_controller.arm.command import Interface
from slip_vic_controller.contact.wrench_evidence import Handover, pull
from slip_vic_controller.cycle.contact import held
from slip_vic_controller.cycle.governing import follow_goal, give_way, governed_reference, guard
from slip_vic_controller.cycle.holding import fail, keep_joints
from slip_vic_controller.cycle.judging import pulls
from slip_vic_controller.cycle.limit import finish
from slip_vic_controller.cycle.sensing import put_twist_of_joints
from slip_vic_controller.cycle.wrench import put_own_wrench
from slip_vic_controller.governor.plan import Governing
from slip_vic_controller.law.law import evaluate, finite_pose, scale_acceleration
from slip_vic_controller.path.path_scaling import scaled
from slip_vic_controller.path.paths import carried, put_reference, read_reference, reference_at
from slip_vic_controller.safety.conditions import NOTHING, Reason, because, see
from slip_vic_controller.safety.motion import observe_motion, rests_far_off, what_keeps
from slip_vic_controller.state import ArmCycle

FOLLOWS_M_S: Final = 0.25
"""Largest speed along an axis with which the pad follows a hand [m/s]: the reduced speed of ISO 10218-1."""


@part
def follow(c: ArmCycle) -> None:
    """Let the law command the arm, on what `sense` has found."""
    config, task, state, inputs, outputs = c.config, c.task, c.state, c.inputs, c.outputs
    follows_hand = c.lead and pulls(config, state, Handover.FOLLOW.value, inputs.now_ns)
    if follows_hand:
        give_way(config, task, inputs.arm)
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
    factor = guard(config, task, state, inputs.arm, outputs, held(config, state, outputs.gains))
    if factor < 1.0 and law.ok != 0:
        scale_acceleration(config.law, inputs.arm, q, qd, own.posture, factor, outputs)
    if law.ok == 0:
        fail(c, Reason.NO_TORQUE.value)
        return
    own.e_previous[:] = law.e[3:]
    for k in range(config.law.contacts):
        own.slips[k] = outputs.slips[k]
    keep_joints(config, state, inputs)
    outputs.wanted[:n] = law.effort[:n]
    observe_motion(config.drop, axes, state.observed, inputs.arm, law, outputs.reference, dt_ns * 1e-9)
    _watch_following(c)
    finish(c, q, qd, True)


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
        desired = governed_reference(config, task, state, c.lead)
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


@part
def _watch_following(c: ArmCycle) -> None:
    """Look whether the arm moves as commanded; its velocity of now is not that of the commands under way."""
    config, state, inputs, outputs = c.config, c.state, c.inputs, c.outputs
    twist, why = inputs.arm.twist.copy(), NOTHING
    if config.command.interface != Interface.EFFORT:
        put_twist_of_joints(config, state, inputs, twist)
    if rests_far_off(outputs.law, twist):
        h, n, effort = np.empty(6), config.law.joints, state.sent.effort
        put_own_wrench(config, state, inputs, h)
        commanded = state.sent.velocity  # zeros where efforts are commanded
        why = what_keeps(n, inputs.arm, outputs.law, h, effort, commanded)
    kept = why.reason != Reason.NONE
    see(state.conditions, why if kept else because(Reason.NOT_FOLLOWING.value, 0), kept, inputs.now_ns)
