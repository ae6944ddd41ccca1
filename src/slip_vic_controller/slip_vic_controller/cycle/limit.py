"""The way of every effort to the drives: limit avoidance, the effort limiter, then the command that they take."""

from __future__ import annotations

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.vectors import mat, put_spatial
from slip_vic_controller.arm.command import (
    Interface,
    advance_motion,
    ignored_joint,
    joint_acceleration,
    return_to,
    start_motion,
    stop_motion,
)
from slip_vic_controller.arm.estimator import oppose_disturbance, remember_input
from slip_vic_controller.cycle.sensing import own_wrench
from slip_vic_controller.safety.conditions import Reason, because, find, follows, see
from slip_vic_controller.safety.limits import avoid_limits, limit_effort, needs_restart, start_limiter
from slip_vic_controller.sizes import MAX_JOINTS
from slip_vic_controller.state import ArmCycle


@part
def finish(c: ArmCycle, q: Array, qd: Array) -> None:
    """Add limit avoidance, pass the effort limiter, and write the outcome.

    Args:
        c: of the arm; `outputs.wanted` is what goes in.
        q, qd: joint state [rad], [rad/s].
    """
    config, state, inputs, outputs = c.config, c.state, c.inputs, c.outputs
    n, now_ns, limits, sent = config.law.joints, inputs.now_ns, config.command, state.sent
    by_effort, at_work = limits.interface == Interface.EFFORT, follows(state.mode.mode)
    moves_s = passed_s = 1e-9 * min(max(now_ns - state.now_ns, 0), limits.longest_step_ns)
    arm, h = inputs.arm, np.empty(6)
    R_ee = mat(arm.rotation)
    put_spatial(h, R_ee @ own_wrench(config, state, R_ee))
    if needs_restart(limits, sent, now_ns):
        begins = sent.started == 0
        # Loops of the drives overcome friction, which the model does not have: there it begins with gravity.
        felt = np.zeros(MAX_JOINTS)
        if by_effort:
            felt[:] = state.joint.answers.effort
        start_limiter(limits, sent, felt, state.law.gravity, now_ns)
        known = begins or arm.M[0, 0] > 0.0  # else the state of the drives is unknown
        if known and not by_effort:
            # After a pause where the joints are, not where the last command led: drives may have braked.
            if config.estimator.on != 0 and state.estimate.started != 0 and not begins:
                start_motion(limits, sent, state.estimate.position, state.estimate.velocity)
                state.estimate.started = 0
            else:
                start_motion(limits, sent, q, qd)
            moves_s = min(moves_s, 1e-9 * limits.period_ns)
    torque, clipped, saturated = np.empty(MAX_JOINTS), np.zeros(MAX_JOINTS, np.int64), 0
    torque[:n] = outputs.wanted[:n]
    if config.estimator.on != 0 and by_effort:  # what a drive with a loop of its own does not follow is no torque
        of_wrench = np.zeros(MAX_JOINTS)
        for j in range(n):
            for i in range(6):
                of_wrench[j] += arm.J[i, j] * h[i]
        judged = config.tare.duration_ns == 0 or state.tare.rough != 0
        oppose_disturbance(config.estimator, state.estimate, arm.M, of_wrench, passed_s, judged, torque)
    avoid_limits(limits, q, qd, arm.M, torque)
    finite = limit_effort(limits, sent, torque, now_ns, clipped)
    # Without a good joint state the effort stays as it was, and so does the acceleration.
    u = state.estimate.inputs[state.estimate.newest].copy()
    moved = (by_effort or at_work) and arm.M[0, 0] > 0.0  # else drives with loops of their own come to rest
    if moved and not joint_acceleration(n, arm.M, arm.bias, arm.J, h, sent.effort, u):
        u[:] = 0.0
    if not by_effort:
        _move(c, u, moves_s)
        u[:] = sent.velocity
    remember_input(config.estimator, state.estimate, u)
    if config.estimator.on != 0:
        joints, estimate = outputs.joints, state.estimate
        joints.position[:], joints.velocity[:], joints.effort[:] = estimate.position, estimate.velocity, estimate.effort
    for j in range(n):
        outputs.effort[j] = sent.effort[j]
        if config.leaves_gravity != 0:
            outputs.effort[j] -= state.law.gravity[j]
        outputs.command[j] = outputs.effort[j]
        if limits.interface == Interface.POSITION:
            outputs.command[j] = sent.position[j]
        elif limits.interface == Interface.VELOCITY:
            outputs.command[j] = sent.velocity[j]
        outputs.saturated[j] = 1 if clipped[j] != 0 or (at_work and outputs.law.saturated[j] != 0) else 0
        saturated += outputs.saturated[j]
    see(state.conditions, because(Reason.SATURATED.value, 0), saturated != 0, now_ns)
    state.now_ns, outputs.answered, outputs.ok = now_ns, 1, 1 if at_work and finite else 0


@part
def _move(c: ArmCycle, qdd: Array, dt: float) -> None:
    """Integrate the acceleration that the effort gives the joints (n,) [rad/s^2]; without the law it comes to rest.

    A pause counts no longer than in the effort limiter, and not at all where the command begins again: drives that have
    come to rest at the last command in between would take what it is worth in one period. dt: time that the command
    moves on [s].
    """
    limits, motion, estimate = c.config.command, c.state.sent, c.state.estimate
    if follows(c.state.mode.mode):
        advance_motion(limits, motion, qdd, estimate.velocity, dt)
        ignored = ignored_joint(limits, motion, estimate.velocity, dt)
        if ignored >= 0:
            find(estimate.found, Reason.IGNORED.value, ignored, estimate.velocity[ignored], motion.velocity[ignored])
    else:
        stop_motion(limits, motion, dt)
        if estimate.found.reason == Reason.IGNORED:
            return_to(limits, motion, estimate.position, dt)
