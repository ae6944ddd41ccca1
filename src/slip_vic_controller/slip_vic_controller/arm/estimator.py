"""Joint state estimator: position, velocity and disturbance of every joint, from noisy samples and the arm's model.

Per joint a Kalman filter in steady state. Its state is x = (q, v, d); d is the acceleration that the model leaves out:
friction, torque offset, a push. Its input u is what the joint is known to do. With efforts that is the acceleration

    u = M^-1 (tau_sent - C qd - g + J^T h_ee)

with a velocity drive the commanded velocity, which the drive follows with bandwidth b:

    q' = v,   v' = u + d  (efforts, b = 0),   v' = b (u - v) + d  (velocity drive),   d' = noise.

The disturbance is slow, except where friction turns round or something touches the arm: then innovations of one sign
come in a row, and a filter with a faster drift takes over.

Measured are q and v, by a sensor that is late by a known latency: the filter runs at the time of measurement, with the
inputs of that time, and its estimate is predicted to now with the inputs since then. Everything that follows in a cycle
works with this prediction.

Which measurements of a joint are used follows from their parity, the change of its position less the integral of its
velocity. A random walk of the disturbance swallows a velocity that lies slowly; the cumulative sum of the parity does
not. It begins again wherever nothing is left of it, so that the ways since then are those of what is wrong, and tell
which of the two it is. A joint that moves and reads the same to the last bit is not measured: the model tells where it
is.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_vic_controller.arm.joint_estimate import (
    LONGEST_STEP,
    QUICK,
    RING,
    EstimatorConfig,
    JointEstimate,
    JointRecord,
    Trust,
    find,
)
from slip_vic_controller.safety.conditions import Reason

FAST: Final = 20.0
"""Distance of the velocity from the measured one [rad/s] from which an estimate is none: the forces of the model grow
with the square of velocity, so one that runs away doubles its exponent in every cycle."""
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


class Transition(NamedTuple):
    """q <- q + qv v + qd d + qu u, v <- vv v + vd d + vu u over a time."""

    qv: float
    qd: float
    qu: float
    vv: float
    vd: float
    vu: float


@part
def transition(bandwidth: float, dt: float) -> Transition:
    """Return the exact transition of a joint over `dt` [s] with constant input and disturbance; bandwidth [rad/s]."""
    if bandwidth == 0.0:
        return Transition(dt, 0.5 * dt * dt, 0.5 * dt * dt, 1.0, dt, dt)
    kept = math.exp(-bandwidth * dt)
    qv = (1.0 - kept) / bandwidth
    return Transition(qv, (dt - qv) / bandwidth, dt - qv, kept, qv, 1.0 - kept)


@part
def move_on(step: Transition, q: float, v: float, d: float, u: float) -> tuple[float, float]:
    """Return position [rad] and velocity [rad/s] after a transition with input u and disturbance d."""
    return q + step.qv * v + step.qd * d + step.qu * u, step.vv * v + step.vd * d + step.vu * u


@part
def start_estimate(config: EstimatorConfig, state: JointEstimate, stamp_ns: int, q: Array, qd: Array) -> None:
    """Begin at a sample; (n,) [rad], [rad/s]. The disturbance stays: friction and offset outlast a pause."""
    state.started, state.stamp_ns, state.renewed_ns = 1, stamp_ns, stamp_ns
    state.since, state.newest, state.remembered = 0, 0, 0
    state.inputs[:] = 0.0
    for j in range(config.joints):
        position, velocity = q[j], qd[j]
        if state.unmeasured[j] > 0 and joint_repeats(state, j, q, qd) and math.isfinite(state.position[j]):
            # It is still where the model had it, and something has held it meanwhile.
            position, velocity = state.position[j], 0.0
        else:
            state.unmeasured[j] = 0
        state.q[j] = state.position[j] = position
        state.v[j] = state.velocity[j] = velocity
        state.measured_position[j], state.measured_velocity[j] = q[j], qd[j]
        state.parity[:, j] = state.moved[:, j] = state.swept[:, j] = 0.0
        state.began[:, j] = qd[j]
        state.same_position[j] = state.same_velocity[j] = 0
        state.mean_q[j], state.mean_v[j], state.quick[j] = 0.0, 0.0, 0
        if config.bandwidth > 0.0:
            for k in range(RING):
                state.inputs[k, j] = velocity


@part
def input_of(config: EstimatorConfig, state: JointEstimate, ago: int, j: int) -> float:
    """Return the input of joint j that was at work `ago` periods before the last one; drives take it up late."""
    k = state.newest - ago - config.drive_ticks
    return state.inputs[k if k >= 0 else k + RING, j]


@part
def remember_input(config: EstimatorConfig, state: JointEstimate, u: Array) -> None:
    """Keep what the joints do from now on; (n,) [rad/s^2], with velocity drives [rad/s]."""
    state.newest = state.newest + 1 if state.newest + 1 < RING else 0
    state.remembered += 1
    for j in range(config.joints):
        state.inputs[state.newest, j] = u[j]


@part
def estimate_joints(
    config: EstimatorConfig, state: JointEstimate, stamp_ns: int, q: Array, qd: Array, measured: bool
) -> None:
    """Take a sample in; the estimate of now is `position` and `velocity` of the state.

    Args:
        config: what does not change.
        state: changed.
        stamp_ns: of the sample.
        q, qd: measured; (n,) [rad], [rad/s].
        measured: whether they were, at the stamp; else they are those of the last sample, and the model alone goes on.

    Implements: ours; the filter is Kalman's in steady state, as in R. E. Kalman, 1960.
    """
    dt = (stamp_ns - state.stamp_ns) * 1e-9
    if not goes_on(config, state, stamp_ns):
        start_estimate(config, state, stamp_ns, q, qd)
        return
    periods = max(1, round(dt / config.period))
    for _ in range(state.remembered, periods):  # the last input lasts where there was no new one
        remember_input(config, state, state.inputs[state.newest])
    state.remembered = 0
    repeated = True
    for j in range(config.joints):
        repeated = repeated and joint_repeats(state, j, q, qd)
    count_unmeasured(config, state, stamp_ns, periods, q, qd, repeated, measured)
    state.since += periods
    # A sensor slower than the cycle repeats itself for its period; an arm at rest may read the same for any time.
    # Where no joint is measured nothing corrects the estimate, and innovations grow longer.
    seen = state.unmeasured[: config.joints].min() < config.sensor_ticks
    corrects = measured and seen and not (repeated and state.since < config.sensor_ticks)
    if measured and not repeated:
        compare_measurements(config, state, (stamp_ns - state.renewed_ns) * 1e-9, q, qd)
        state.renewed_ns = stamp_ns
    # After a missing sample an innovation has had longer to grow from a wrong velocity or disturbance.
    share = min(1.0, config.sensor_ticks / state.since)
    if corrects:
        state.since = 0
    state.stamp_ns = stamp_ns
    m, step, whole = (
        config.late_ticks,
        transition(config.bandwidth, dt / periods),
        transition(config.bandwidth, config.period),
    )
    for j in range(config.joints):
        x_q, x_v, x_d = state.q[j], state.v[j], state.d[j]
        for ago in range(m + periods - 1, m - 1, -1):
            x_q, x_v = move_on(step, x_q, x_v, x_d, input_of(config, state, ago, j))
        of_q, of_v, trust = q[j] - x_q, qd[j] - x_v, state.trust[j]
        if trust == Trust.BOTH and state.alone != 0:
            trust = Trust.POSITION.value
        if not corrects or is_unmeasured(config, state, j):  # what is known stays
            of_q, of_v = 0.0, 0.0
        else:
            state.mean_q[j] += config.weight * (config.scale[0] * of_q - state.mean_q[j])
            state.mean_v[j] += config.weight * (config.scale[1] * of_v - state.mean_v[j])
            if max(state.mean_q[j] * state.mean_q[j], state.mean_v[j] * state.mean_v[j]) > config.gate:
                state.quick[j] = config.quick_ticks
            elif state.quick[j] > 0:
                state.quick[j] -= 1
        K = config.gain[QUICK if trust == Trust.BOTH and state.quick[j] > 0 else trust]
        x_q, x_v, x_d = (
            x_q + K[0, 0] * of_q + K[0, 1] * of_v,
            x_v + share * K[1, 0] * of_q + K[1, 1] * of_v,
            x_d + share * (share * K[2, 0] * of_q + K[2, 1] * of_v),
        )
        state.q[j], state.v[j], state.d[j] = x_q, x_v, x_d
        for ago in range(m - 1, -1, -1):
            x_q, x_v = move_on(whole, x_q, x_v, x_d, input_of(config, state, ago, j))
        state.position[j], state.velocity[j] = x_q, x_v
    far = False
    for j in range(config.joints):
        unused = is_unmeasured(config, state, j) or state.trust[j] == Trust.POSITION or state.trust[j] == Trust.NEITHER
        far = far or not abs(state.velocity[j] - (0.0 if unused else qd[j])) < FAST
    if far:
        start_estimate(config, state, stamp_ns, q, qd)
        state.d[:] = 0.0


@part
def use_estimate(config: EstimatorConfig, state: JointEstimate, sample: JointRecord) -> None:
    """Take a joint state in, and put the estimate of now in its place; where it is off, from a finding on."""
    n = config.joints
    estimate_joints(config, state, sample.stamp_ns, sample.position[:n], sample.velocity[:n], True)
    if config.on != 0 or state.found.reason != Reason.NONE or state.unmeasured.max() >= config.sensor_ticks:
        put_estimate(config, state, sample)


@part
def goes_on(config: EstimatorConfig, state: JointEstimate, stamp_ns: int) -> bool:
    """Return whether a sample follows the one before closely enough to go on with the estimate."""
    dt = (stamp_ns - state.stamp_ns) * 1e-9
    return bool(state.started != 0 and 0.0 < dt <= LONGEST_STEP * config.period)


@part
def replace_sample(config: EstimatorConfig, state: JointEstimate, sample: JointRecord) -> bool:
    """Put where the model has the joints in the place of a joint state that cannot be used.

    Returns:
        Whether that is known: not after a pause, nor where its stamp is as wrong as its values.
    """
    n, q, qd = config.joints, state.measured_position.copy(), state.measured_velocity.copy()
    if not goes_on(config, state, sample.stamp_ns):
        state.unmeasured[:n] += 1
        return False
    estimate_joints(config, state, sample.stamp_ns, q[:n], qd[:n], False)
    put_estimate(config, state, sample)
    return True


@part
def put_estimate(config: EstimatorConfig, state: JointEstimate, sample: JointRecord) -> None:
    """Put the estimate of now in the place of a joint state.

    Of drives with loops of their own it is the state to which the commands that have been sent lead, q + v / b + what
    is under way: then the law commands what is free of their lag, and the joint does the same that much later.

    Implements: ours: with q' = v, v' = b (u - v) it is (q + v / b)' = u: a predictor after O. J. M. Smith, 1957.
    """
    n = config.joints
    if config.bandwidth > 0.0:
        for j in range(n):
            ahead = state.position[j] + state.velocity[j] / config.bandwidth
            for k in range(1, config.drive_ticks + 1):
                ahead += config.period * input_of(config, state, -k, j)
            sample.position[j], sample.velocity[j] = ahead, state.inputs[state.newest, j]
    else:
        sample.position[:n], sample.velocity[:n] = state.position[:n], state.velocity[:n]


# -- what is measured ---------------------------------------------------------------------------------


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
