"""Whether what a joint's sensors say can be true: parity of position and velocity, and readings that do not change.

The parity of a joint is the change of its position less the integral of its velocity. A random walk of the disturbance
swallows a velocity that lies slowly; the cumulative sum of the parity does not. It begins again wherever nothing is
left of it, so that the ways since then are those of what is wrong, and tell which of the two it is. A joint that moves
and reads the same to the last bit is not measured: the model tells where it is.
"""

from __future__ import annotations

from typing import Final

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_vic_controller.arm.joint_estimate import LONGEST_STEP, EstimatorConfig, JointEstimate, Trust, find
from slip_vic_controller.safety.conditions import Reason

BLIND_S: Final = 0.5
"""Time for which the model tells where a joint is that is not measured [s]: enough to come to rest, not to hold it."""
DIFFERENCE, BIAS = 5e-3, 0.01
"""Sum of the parity that contradicts [rad], beyond a difference of the velocities that may last [rad/s]."""
OUTRUN: Final = 3.0
"""Way that positions show over that of the velocities from which it is the position that drifts. Else the velocity is
wrong: damping by it would throw the joint, while a position that drifts moves it no faster than that."""
REVERSALS: Final = 20
"""Reversals of the velocity from one sample to the next, without repetitions, which show that an encoder has noise:
motion alone does not make them. As many repetitions in a row it has not then: it has died."""
MEAN_S, SIGNIFICANT = 0.01, 4.5
"""Time over which innovations are averaged, a jump of the disturbance must last, and a velocity may be behind its
position, as behind a low-pass of 16 Hz [s]; and standard deviations of a mean that are no noise."""
LASTS_S: Final = 0.3
"""Time for which a joint may be disturbed beyond its bound, or not move as commanded [s]."""
MOVES: Final = 0.02
"""Speed from which neither friction nor noise hides that a joint moves [rad/s]."""


@part
def count_unmeasured(
    config: EstimatorConfig, state: JointEstimate, stamp_ns: int, periods: int, q: Array, qd: Array, all_repeat: bool,
    measured: bool,
) -> None:  # fmt: skip
    """Count for how long every joint has read the same (n,) [rad], [rad/s] though it moves, or never did before.

    All of them where all read the same and one moves, or nothing was measured. What a joint did for longer than
    LONGEST_STEP is not known: then it begins again at what it reads. periods: since the sample before, of control;
    all_repeat: whether all joints read the same; the others: see `estimate_joints`.
    """
    dt, renewed_s = (stamp_ns - state.stamp_ns) * 1e-9, (stamp_ns - state.renewed_ns) * 1e-9
    moves = not measured
    for j in range(config.joints):
        moves = moves or abs(qd[j]) * renewed_s > config.unmoved
    for j in range(config.joints):
        unknown = state.trust[j] == Trust.NEITHER
        dead = abs(qd[j]) > MOVES or has_noise(config, state, j) or unknown
        if (all_repeat and moves) or (dead and joint_repeats(state, j, q, qd)):
            state.unmeasured[j] += periods
            continue
        if unknown or state.unmeasured[j] > LONGEST_STEP:
            state.q[j], state.v[j] = q[j] - dt * qd[j], qd[j]
        if unknown:  # how it got there is no contradiction
            state.trust[j], state.parity[:, j], state.measured_position[j] = Trust.BOTH.value, 0.0, q[j]
        state.unmeasured[j] = 0


@part
def is_unmeasured(config: EstimatorConfig, state: JointEstimate, j: int) -> bool:
    """Return whether joint j reads the same for longer than its sensor repeats itself, which nothing measured does."""
    return bool(state.unmeasured[j] >= config.sensor_ticks)


@part
def unseen_ns(config: EstimatorConfig, state: JointEstimate) -> float:
    """Return for how long a joint has not been measured [ns]."""
    return float(1e9 * (state.unmeasured.max() * config.period))


@part
def joint_repeats(state: JointEstimate, j: int, q: Array, qd: Array) -> bool:
    """Return whether joint j reads the same as in the sample before, to the last bit; (n,) [rad], [rad/s]."""
    return bool(q[j] == state.measured_position[j] and qd[j] == state.measured_velocity[j])


@part
def has_noise(config: EstimatorConfig, state: JointEstimate, j: int) -> bool:
    """Return whether the encoder of joint j has noise, and so never reads the same twice."""
    return bool(config.on != 0 and state.reversals[j] >= REVERSALS)


@part
def compare_measurements(config: EstimatorConfig, state: JointEstimate, dt: float, q: Array, qd: Array) -> None:
    """Take a new sample (n,) [rad], [rad/s], `dt` [s] after the one before, into the parity of every joint.

    Between two samples the velocity may have had any value between theirs; where one is missing, any at all, and that
    way is not compared.
    """
    compared = state.alone == 0 and round(dt / config.sensor_period) <= 1
    for j in range(config.joints):
        before_q, before_v = state.measured_position[j], state.measured_velocity[j]
        if min(state.same_position[j], state.same_velocity[j]) > 0 and not joint_repeats(state, j, q, qd):
            state.reversals[j] = 0
        elif before_v * qd[j] < 0.0:
            state.reversals[j] += 1
        state.same_position[j] = state.same_position[j] + 1 if q[j] == before_q else 0
        state.same_velocity[j] = state.same_velocity[j] + 1 if qd[j] == before_v else 0
        state.measured_position[j], state.measured_velocity[j] = q[j], qd[j]
        if has_noise(config, state, j) and min(state.same_position[j], state.same_velocity[j]) >= REVERSALS:
            _reject(config, state, j, Trust.NEITHER.value)
        elif compared:
            way_q = q[j] - before_q
            way_v = min(max(way_q, dt * min(qd[j], before_v)), dt * max(qd[j], before_v))
            _add_parity(state, j, dt, way_q, way_q - way_v)
            if contradiction(config, state, j) > config.difference:
                _reject(config, state, j, _believed(config, state, j, dt))


@part
def _add_parity(state: JointEstimate, j: int, dt: float, way: float, beyond: float) -> None:
    """Add to the parity of joint j what position shows over `dt` [s], and what of it is beyond the velocity [rad].

    Implements: E. S. Page, 1954: S = max(0, S + beyond - BIAS dt), and the same of the opposite.
    """
    for side in range(2):
        state.parity[side, j] += (1 - 2 * side) * beyond - BIAS * dt
        state.moved[side, j] += way
        state.swept[side, j] += dt * state.measured_velocity[j]
        if state.parity[side, j] <= 0.0:
            state.parity[side, j] = state.moved[side, j] = state.swept[side, j] = 0.0
            state.began[side, j] = state.measured_velocity[j]


@part
def contradiction(config: EstimatorConfig, state: JointEstimate, j: int) -> float:
    """Return the larger parity of joint j [rad], less what a velocity that is late explains: its gain by that time."""
    gain = state.measured_velocity[j] - state.began[:, j]
    above = state.parity[0, j] - config.late * max(gain[0], 0.0)
    below = state.parity[1, j] - config.late * max(-gain[1], 0.0)
    return float(max(above, below))


@part
def _believed(config: EstimatorConfig, state: JointEstimate, j: int, dt: float) -> int:
    """Return the Trust in a joint whose parity contradicts; dt: between samples [s].

    What is equal to the last bit on its way is stuck, and does not count; else see OUTRUN.
    """
    side = 0 if state.parity[0, j] > state.parity[1, j] else 1
    way = dt * abs(state.measured_velocity[j])
    if way * min(state.same_position[j], state.same_velocity[j]) > config.unmoved:
        return Trust.NEITHER.value
    drifts = state.same_velocity[j] == 0 and abs(state.moved[side, j]) > OUTRUN * abs(state.swept[side, j])
    if drifts or way * state.same_position[j] > config.unmoved:
        return Trust.VELOCITY.value
    return Trust.POSITION.value


@part
def _reject(config: EstimatorConfig, state: JointEstimate, j: int, trust: int) -> None:
    """Let joint j continue with what is left of its measurements, and note what is wrong with the others."""
    if state.trust[j] == Trust.BOTH:
        state.trust[j] = trust
        reason = Reason.VELOCITY.value + trust - Trust.POSITION.value  # in the same order
        find(state, reason, j, contradiction(config, state, j), config.difference)
