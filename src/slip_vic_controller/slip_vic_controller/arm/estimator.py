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
not. It restarts at zero, so that the distances since then are those of the fault, and show which of the two it is. A
joint that moves and reads the same to the last bit is not measured: its position is the model's.
"""

from __future__ import annotations

import math
from enum import IntEnum, unique
from typing import Annotated, Final, NamedTuple

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.records import Real, Record, Whole, dtype_of
from slip_vic_controller.safety.conditions import NOTHING, Reason, WhyRecord, find, put_why
from slip_vic_controller.sizes import MAX_JOINTS, Joints, WholeJoints

MAX_LATENCY: Final = 32
"""Control periods by which the joint sensor may be late."""
LONGEST_STEP: Final = 20
"""Control periods after which a sample restarts the estimate, because the arm's motion is unknown."""
RING: Final = MAX_LATENCY + LONGEST_STEP + 1
"""Inputs that are kept: of so many control periods."""
FAST: Final = 20.0
"""Distance of the velocity from the measured one [rad/s] from which an estimate is none: the forces of the model grow
with the square of velocity, so one that runs away doubles its exponent in every cycle."""
BLIND_S: Final = 0.5
"""Time for which the model replaces a joint that is not measured [s]: enough to come to rest, not to hold it."""
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
SLOW_S: Final = 0.2
"""Time constant of the disturbance that is no collision [s]."""
WITH_WRENCH: Final = 0.5
"""Share of a jump of the disturbance from which the wrench that has jumped too explains it, ..."""
NOTICED: Final = 0.3
"""... where that is this share of what is a collision: an object that is accelerated jumps less. And share of the
parity that contradicts from which a jump may be a wrong measurement."""


@unique
class Trust(IntEnum):
    """Which measurement of a joint is used."""

    BOTH = 0
    POSITION = 1
    VELOCITY = 2
    NEITHER = 3  # the model alone


BothWays = Annotated[Array, (2, MAX_JOINTS)]
QUICK: Final = len(Trust)
"""Row of the gains for both measurements while innovations show that the disturbance changes fast, after those by
Trust."""


class JointRecord(Record):
    """A joint state."""

    stamp_ns: Whole
    position: Joints  # rad
    velocity: Joints  # rad/s
    effort: Joints  # N m


class EstimatorConfig(Record):
    """What does not change while the controller runs."""

    on: Whole  # 0: samples are used as they are, until one contradicts another
    joints: Whole
    period: Real  # s; of control
    bandwidth: Real  # rad/s; of velocity drives, 0 = efforts
    noise: Real  # rad; of positions, a standard deviation
    more_noise: Real  # rad/s; of velocities, from counts and a filter
    drift: Real  # rad/s^2; of the disturbance after one second
    late_ticks: Whole  # latency of the sensor, whole control periods
    drive_ticks: Whole  # control periods from an input to its effect
    sensor_ticks: Whole  # control periods for which the sensor repeats a sample; 1 = each is new
    sensor_period: Real  # s; between new samples
    gain: Annotated[Array, (5, 3, 2)]  # of (q, v, d) for innovations of position and velocity; by Trust, and QUICK
    quick_ticks: Whole  # control periods for which QUICK is used after the innovations have said so
    scale: Annotated[Array, 2]  # 1/rad, s/rad; over the standard deviation of an innovation
    weight: Real  # of a new innovation in their mean
    gate: Real  # square of the mean of scaled innovations that is no noise
    velocity_variance: Real  # (rad/s)^2; of the predicted velocity
    change_variance: Real  # (rad/s)^2; noise of its change over a period
    difference: Real  # rad; sum of the parity that is no noise
    late: Real  # s; by which velocities may be behind positions
    unmoved: (
        Real  # rad; way by its velocity after which a joint that is measured does not read the same to the last bit
    )
    bound: Joints  # N m; most of the disturbance that is taken off the effort
    rate: Joints  # N m/s; of what is taken off
    settling: Real  # s; time constant with which it follows the estimate
    collision: Joints  # N m; jump of the disturbance that is a collision
    friction: Joints  # N m; of the joints, as configured: it changes its sign with the velocity


class JointEstimate(Record):
    """The estimate and its memory."""

    started: Whole
    stamp_ns: Whole  # of the last sample
    renewed_ns: Whole  # of the last one that was new
    since: Whole  # control periods since one corrected the estimate
    q: Joints  # rad; when the last sample was measured
    v: Joints  # rad/s
    d: Joints  # rad/s^2; disturbance
    position: Joints  # rad; now
    velocity: Joints  # rad/s; now
    newest: Whole  # place of the last input in its ring
    inputs: Annotated[Array, (RING, MAX_JOINTS)]  # rad/s^2 or rad/s; one per control period
    remembered: Whole  # inputs since the last sample
    measured_position: Joints  # rad; of the last sample
    measured_velocity: Joints  # rad/s
    mean_q: Joints  # mean of scaled innovations of position
    mean_v: Joints  # and of velocity
    quick: WholeJoints  # control periods for which the gains QUICK are used still
    parity: BothWays  # rad; sum of what position shows beyond velocity, and of the opposite
    moved: BothWays  # rad; way of the position since the sum was zero
    swept: BothWays  # rad; way of the velocity
    began: BothWays  # rad/s; the velocity then
    same_position: WholeJoints  # samples in a row that are equal to the last bit
    same_velocity: WholeJoints
    reversals: WholeJoints  # of the velocity from sample to sample, since a sample after one that repeated another
    unmeasured: WholeJoints  # control periods for which it has read the same, though it moves or never did before
    trust: WholeJoints  # Trust
    alone: Whole  # whether positions alone are measured
    effort: Joints  # N m; disturbance
    slow_effort: Joints  # N m; its low-pass
    slow_wrench: Joints  # N m; low-pass of the measured wrench's torque
    wrench_jump: Joints  # N m; how far that has been off its low-pass, faded
    taken_off: Joints  # N m; added to the effort against it
    jumped_s: Joints  # s; for how long the disturbance has been off its low-pass
    beyond_s: Joints  # s; for how long it has been beyond its bound
    found: WhyRecord  # what is wrong with a joint, the first thing; kept until `clear_findings`


ESTIMATOR_CONFIG = dtype_of(EstimatorConfig)


@part
def clear_findings(state: JointEstimate) -> None:
    """Clear the findings: both measurements of every joint are used again from the next sample on."""
    if state.trust.any():
        state.started = 0
    put_why(state.found, NOTHING)
    state.trust[:] = 0
    state.parity[:] = 0.0
    state.jumped_s[:] = 0.0
    state.beyond_s[:] = 0.0


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
            # It is still where the model had it, and something has held it in between.
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
            state.inputs[:, j] = velocity


@part
def input_of(config: EstimatorConfig, state: JointEstimate, ago: int, j: int) -> float:
    """Return the input of joint j that was in effect `ago` periods before the last one; drives respond late."""
    k = state.newest - ago - config.drive_ticks
    return state.inputs[k if k >= 0 else k + RING, j]


@part
def remember_input(config: EstimatorConfig, state: JointEstimate, u: Array) -> None:
    """Store the motion of the joints from now on; (n,) [rad/s^2], with velocity drives [rad/s]."""
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
        measured: whether they were, at the stamp; else they are those of the last sample, and only the model continues.

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
    m, b = config.late_ticks, config.bandwidth
    step, whole = transition(b, dt / periods), transition(b, config.period)
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
    """Return the larger parity of joint j [rad], minus what a late velocity explains: its change in that time."""
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
    """Let joint j continue with its remaining measurements, and record the fault of the others."""
    if state.trust[j] == Trust.BOTH:
        state.trust[j] = trust
        reason = Reason.VELOCITY.value + trust - Trust.POSITION.value  # in the same order
        find(state.found, reason, j, contradiction(config, state, j), config.difference)


# -- compensation of the disturbance, and when a jump of it is a collision --------------------------------


@part
def oppose_disturbance(
    config: EstimatorConfig, state: JointEstimate, M: Array, of_wrench: Array, dt: float, judged: bool, torque: Array
) -> None:
    """Take the disturbance off the effort, inside its bound and rate, and look for jumps and lasting excess.

    Without a good joint state, where M is zero, it stays as it is.

    A wrench that is measured wrongly looks like a disturbance, since the joints do not feel it. So a disturbance that
    jumps together with the wrench is no collision, and is not taken off.

    Args:
        config: what does not change.
        state: changed.
        M: inertia (n, n) [kg m2].
        of_wrench: J^T h, torque of the measured wrench; (n,) [N m].
        dt: since the cycle before [s].
        judged: whether the noise of joint velocities is known by now; before, a jump may be noise.
        torque: changed; (n,) [N m].

    Implements: ours: tau -= M d.
    """
    n, weight, follow = config.joints, 1.0 - math.exp(-dt / SLOW_S), 1.0 - math.exp(-dt / config.settling)
    if M[0, 0] == 0.0:
        torque[:] += state.taken_off
        return
    # The inertia carries a joint that is measured wrongly, or not at all, into the torques of the others.
    unmeasured = bool(state.unmeasured.max() >= config.sensor_ticks)
    doubtful = unmeasured or not judged
    for j in range(n):
        differs = contradiction(config, state, j) > NOTICED * config.difference
        doubtful = doubtful or state.trust[j] != Trust.BOTH or differs
    for j in range(n):
        effort = 0.0
        for k in range(n):
            effort += M[j, k] * state.d[k]
        if is_unmeasured(config, state, j):
            # What is known of it is its torque: the acceleration depends on the other joints, too.
            state.d[j] += (state.effort[j] - effort) / M[j, j]
            effort = state.effort[j]
        state.effort[j] = effort
        jump, wrench_jump = effort - state.slow_effort[j], of_wrench[j] - state.slow_wrench[j]
        state.wrench_jump[j] = max(abs(wrench_jump), (1.0 - weight) * state.wrench_jump[j])
        most = config.collision[j] + 2.0 * config.friction[j]  # which turns round
        with_wrench = state.wrench_jump[j] > max(WITH_WRENCH * abs(jump), NOTICED * config.collision[j])
        lasting = state.slow_effort[j] if with_wrench else effort
        # Neither low-pass may run to a wrench of some hundred newtons: it would get there in a few cycles.
        pull = NOTICED * config.collision[j] if with_wrench else math.inf
        state.slow_effort[j] += weight * min(max(jump, -pull), pull)
        state.slow_wrench[j] += weight * min(max(wrench_jump, -pull), pull)
        jumped = abs(jump) > most and not with_wrench and not doubtful
        state.jumped_s[j] = state.jumped_s[j] + dt if jumped else 0.0
        bound, step = config.bound[j], config.rate[j] * dt
        wanted = state.taken_off[j] if unmeasured else min(max(-lasting, -bound), bound)
        state.taken_off[j] += min(max(follow * (wanted - state.taken_off[j]), -step), step)
        torque[j] += state.taken_off[j]
        state.beyond_s[j] = state.beyond_s[j] + dt if abs(effort) > bound else 0.0
        if state.jumped_s[j] > MEAN_S:
            find(state.found, Reason.COLLISION.value, j, jump, most)
        elif state.beyond_s[j] > LASTS_S:
            find(state.found, Reason.DISTURBED.value, j, effort, bound)
