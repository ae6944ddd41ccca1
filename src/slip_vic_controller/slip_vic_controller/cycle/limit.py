"""The way of every effort to the drives: limit avoidance, the effort limiter, then the command that they take."""

from __future__ import annotations

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_vic_controller.arm.command import (
    Interface,
    advance_motion,
    ignored_joint,
    joint_acceleration,
    return_to,
    start_motion,
    stop_motion,
)
from slip_vic_controller.arm.disturbance import oppose_disturbance
from slip_vic_controller.arm.estimator import remember_input
from slip_vic_controller.arm.joint_estimate import find
from slip_vic_controller.cycle.wrench import put_own_wrench
from slip_vic_controller.safety.conditions import Reason, because, see
from slip_vic_controller.safety.effort_limiter import limit_effort, needs_restart, start_limiter
from slip_vic_controller.safety.limit_avoidance import avoid_limits
from slip_vic_controller.safety.modes import follows
from slip_vic_controller.sizes import MAX_JOINTS
from slip_vic_controller.state import ArmCycle, ArmState, ControllerConfig, CycleInputs


@part
def finish(c: ArmCycle, q: Array, qd: Array, law_at_work: bool) -> None:
    """Add limit avoidance, pass the effort limiter, and write the outcome.

    Args:
        c: of the arm; `outputs.wanted` is what goes in.
        q, qd: joint state [rad], [rad/s].
        law_at_work: whether the effort is the law's.
    """
    config, state, inputs, outputs = c.config, c.state, c.inputs, c.outputs
    n, now_ns, limits, sent = config.law.joints, inputs.now_ns, config.command, state.sent
    by_effort = limits.interface == Interface.EFFORT
    passed_s, h = 1e-9 * min(max(now_ns - state.now_ns, 0), limits.longest_step_ns), np.empty(6)
    moves_s = passed_s
    put_own_wrench(config, state, inputs, h)
    if needs_restart(limits, sent, now_ns):
        begins = sent.started == 0
        # Loops of the drives overcome friction, which the model does not have: there it begins with gravity.
        felt = np.zeros(MAX_JOINTS)
        if by_effort:
            felt[:] = state.joint.answers.effort
        start_limiter(limits, sent, n, felt, state.law.gravity, now_ns)
        known = begins or inputs.arm.M[0, 0] > 0.0  # else nothing tells where the drives are by now
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
        _oppose_disturbance(config, state, inputs, h, passed_s, torque)
    avoid_limits(limits, n, q, qd, inputs.arm.M, torque)
    finite = limit_effort(limits, sent, n, torque, now_ns, clipped, outputs.limited)
    if not by_effort:
        _move(config, state, inputs, h, moves_s)
    _remember_input(config, state, inputs, h)
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
        outputs.saturated[j] = 1 if clipped[j] != 0 or (law_at_work and outputs.law.saturated[j] != 0) else 0
        saturated += outputs.saturated[j]
    see(state.conditions, because(Reason.SATURATED.value, 0), saturated != 0, now_ns)
    state.now_ns, outputs.answered, outputs.ok = now_ns, 1, 1 if law_at_work and finite else 0


@part
def _oppose_disturbance(
    config: ControllerConfig, state: ArmState, inputs: CycleInputs, h: Array, dt: float, torque: Array
) -> None:
    """Take what the model of the arm leaves out off the effort; without a good joint state as in the cycle before."""
    arm, of_wrench = inputs.arm, np.zeros(MAX_JOINTS)
    if arm.M[0, 0] > 0.0:
        for j in range(config.law.joints):
            for i in range(6):
                of_wrench[j] += arm.J[i, j] * h[i]
        judged = config.tare.duration_ns == 0 or state.tare.rough != 0
        oppose_disturbance(config.estimator, state.estimate, arm.M, of_wrench, dt, judged, torque)
    else:
        for j in range(config.law.joints):
            torque[j] += state.estimate.taken_off[j]


@part
def _move(config: ControllerConfig, state: ArmState, inputs: CycleInputs, h: Array, dt: float) -> None:
    """Let the commanded motion be what the effort makes of the last one; without the law it comes to rest.

    A pause counts no longer than in the effort limiter, and not at all where the command begins again: drives that have
    come to rest at the last command meanwhile would take what it is worth in one period. dt: time that the command
    moves on [s].
    """
    motion, estimate, limited, qdd = state.sent, state.estimate, np.zeros(MAX_JOINTS, np.int64), np.zeros(MAX_JOINTS)
    if follows(state.mode.mode):
        _put_acceleration(config, state, inputs, h, qdd)
        advance_motion(config.command, motion, qdd, estimate.velocity, dt, limited)
        ignored = ignored_joint(config.command, motion, estimate.velocity, dt)
        if ignored >= 0:
            find(estimate, Reason.IGNORED.value, ignored, estimate.velocity[ignored], motion.velocity[ignored])
    else:
        stop_motion(config.command, motion, dt, limited)
        if estimate.found.reason == Reason.IGNORED:
            return_to(config.command, motion, estimate.position, dt)


@part
def _put_acceleration(config: ControllerConfig, state: ArmState, inputs: CycleInputs, h: Array, qdd: Array) -> None:
    """Write the acceleration that the effort gives the joints (n,) [rad/s^2]; as it is without a good joint state."""
    arm = inputs.arm
    seen, n, effort = arm.M[0, 0] > 0.0, config.law.joints, state.sent.effort
    if seen and not joint_acceleration(n, arm.M, arm.bias, arm.J, h, effort, qdd):
        qdd[:] = 0.0


@part
def _remember_input(config: ControllerConfig, state: ArmState, inputs: CycleInputs, h: Array) -> None:
    """Keep what the joints are known to do: the acceleration by the effort, or the velocity that drives follow.

    Without a good joint state the effort stays as it was, and so does the acceleration.
    """
    u = state.estimate.inputs[state.estimate.newest].copy()
    if config.command.interface == Interface.EFFORT:
        _put_acceleration(config, state, inputs, h, u)
    else:
        u[:] = state.sent.velocity
    remember_input(config.estimator, state.estimate, u)
