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

Position and velocity are compared with each other as well: where their difference grows beyond noise, one of them is
wrong, and the joint continues with the other. A joint that moves and reads the same to the last bit is not measured:
the model tells where it is.
"""

from __future__ import annotations

import math
from enum import IntEnum, unique
from typing import Annotated, Final, NamedTuple, Protocol

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.records import Real, Record, Whole, dtype_of
from slip_vic_controller.law.arm import Arm
from slip_vic_controller.sizes import MAX_JOINTS, Joints, WholeJoints

MAX_LATENCY: Final = 32
"""Control periods by which the joint sensor may be late."""
LONGEST_STEP: Final = 20
LONGEST_S: Final = 0.05
"""Control periods, and time [s], after which a sample begins the estimate again: what the arm did is not known."""
BLIND_S: Final = 0.5
"""Time for which the model tells where a joint is that is not measured [s]: enough to come to rest, not to hold it."""
REPEATED: Final = 1e-3
UNMOVED: Final = 3e-4
"""Velocity of a sensor without noise [rad/s], and way by any velocity [rad] (of an encoder that is read in steps two of
them), with which a joint that is measured does not read the same to the last bit."""
RING: Final = MAX_LATENCY + LONGEST_STEP + 1
"""Inputs that are kept: of so many control periods."""
MEMORY_S: Final = 0.5
"""Time over which position and velocity are compared [s]."""
GAP: Final = 1.5
"""Sensor periods between two samples from which one is missing."""
LATELY: Final = 3.0
LATELY_S: Final = 0.006
"""Sensor periods, and least time [s], over which it is judged which of the two is wrong."""
STUCK: Final = 3
"""Positions in a row that are equal to the last bit while the velocity is not zero: then they are stuck."""
REVERSALS, DEAD = 20, 10
"""Reversals of the velocity from one sample to the next, without repetitions, which show that an encoder has noise:
motion alone does not make them. And repetitions in a row that it has not then: it has died."""
OPPOSED, SAME_SIZE = 0.3, 0.8
"""Share of the longer of two ways in opposite directions from which the shorter one is no noise, and from which both
are one way with a wrong sign."""
LAG_S: Final = 0.01
"""Time by which a velocity may be behind its position before they contradict each other, as behind a low-pass of 16 Hz
[s]; more where more has been found."""
LEAST_LAG_S, LATE, ALIKE, BEYOND_NOISE = 0.002, 10, 0.9, 5.0
"""Time by which velocities are late [s], from which positions are used alone, and samples in a row that must show it;
square of the correlation of all joints with it, and their difference over its noise."""
DOUBTFUL: Final = 0.3
"""Share of the difference between position and velocity from which a jump may be a wrong measurement."""
FAR: Final = 0.5
FAST: Final = 20.0
"""Distance from the measurement [rad], [rad/s] from which an estimate is none: the forces of the model grow with the
square of velocity, so one that runs away doubles its exponent in every cycle."""
MOVES: Final = 0.02
"""Speed from which the sign of a joint's friction is known [rad/s]."""
SLOW_S: Final = 0.2
"""Time constant of the disturbance that is no collision [s]."""
WITH_WRENCH: Final = 0.5
"""Share of a jump of the disturbance from which the wrench that has jumped too explains it, ..."""
NOTICED: Final = 0.3
"""... where that is this share of what is a collision: an object that is accelerated jumps less."""
DISTURBED: Final = 0.02
"""Share of the effort limit from which a disturbance is said beside what went wrong."""


@unique
class Trust(IntEnum):
    """Which measurement of a joint is used."""

    BOTH = 0
    POSITION = 1
    VELOCITY = 2
    NEITHER = 3  # the model alone


QUICK: Final = 4
"""Row of the gains for both measurements while the disturbance changes fast, after those by Trust."""


@unique
class Finding(IntEnum):
    """What is wrong with a joint."""

    NONE = 0
    VELOCITY_SIGN = 1  # velocity and position move in opposite directions
    VELOCITY_STUCK = 2
    POSITION_STUCK = 3
    POSITION_DRIFTS = 4  # position moves more than velocity explains
    VELOCITY_BIASED = 5  # velocity says more than position moves
    COLLISION = 6  # the disturbance has jumped
    DISTURBED = 7  # the disturbance stays above its bound
    EFFORTS_LATE = 8  # all joints follow efforts later than told
    STUCK = 9  # neither position nor velocity changes, though that says that the joint moves
    IGNORED = 10  # a joint does not move as commanded


class EstimatorConfig(Record):
    """What does not change while the controller runs."""

    on: Whole  # 0: samples are used as they are, until one contradicts another
    joints: Whole
    period: Real  # s; of control
    bandwidth: Real  # rad/s; of velocity drives, 0 = efforts
    late_ticks: Whole  # latency of the sensor, whole control periods
    late_rest: Real  # s; and what is left of it
    drive_ticks: Whole  # control periods from an input to its effect
    block_ticks: Whole  # control periods over which efforts and motion are compared for a delay; 0 = they are not
    sensor_ticks: Whole  # control periods for which the sensor repeats a sample; 1 = each is new
    sensor_period: Real  # s; between new samples
    gain: Annotated[Array, (5, 3, 2)]  # of (q, v, d) for innovations of position and velocity; by Trust, and QUICK
    quick_ticks: Whole  # control periods for which QUICK is used after the innovations have said so
    scale: Annotated[Array, 2]  # 1/rad, s/rad; over the standard deviation of an innovation
    weight: Real  # of a new innovation in their mean
    significant: Real  # mean of scaled innovations that is no noise
    velocity_variance: Real  # (rad/s)^2; of the predicted velocity
    change_variance: Real  # (rad/s)^2; noise of its change over a period
    difference: Real  # rad; between position and integrated velocity that is no noise
    spread: Real  # rad; standard deviation that noise gives it
    least_lag: Real  # s; by which velocities are later than told
    repeated: Real  # rad/s; velocity with which a joint that is measured does not read the same
    unmoved: Real  # rad; and way by its velocity
    compensates: Whole  # whether the disturbance is taken off the effort
    bound: Joints  # N m; most that is taken off
    rate: Joints  # N m/s; of what is taken off
    settling: Real  # s; time constant with which it follows the estimate
    settling_fault: Real  # s; and in FAULT
    collision: Joints  # N m; jump of the disturbance that is a collision
    friction: Joints  # N m; of the joints, as configured: it changes its sign with the velocity
    collision_s: Real  # s; that it must last
    disturbed_s: Real  # s; that a disturbance may stay beyond its bound


class JointEstimate(Record):
    """The estimate, and what it needs of the past."""

    started: Whole
    stamp_ns: Whole  # of the last sample
    renewed_ns: Whole  # of the last one that was new
    repeats: Whole  # control periods since then
    missing: Whole  # whether one has been missing since then, or before it so that it is not known when it was measured
    corrected_ns: Whole  # of the last one that corrected the estimate
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
    moved: Joints  # rad; way that position shows, faded
    swept: Joints  # rad; way that velocity shows, faded
    moved_lately: Joints  # rad; the same of the last samples
    swept_lately: Joints  # rad
    same_position: WholeJoints  # samples in a row that are equal to the last bit
    same_velocity: WholeJoints
    reversals: WholeJoints  # of the velocity from sample to sample, since a sample after one that repeated another
    unmeasured: WholeJoints  # control periods for which it has read the same, though it moves or never did before
    trust: WholeJoints  # Trust
    alone: Whole  # whether positions alone are measured
    late: Whole  # samples in a row that show velocities behind positions
    lag: Real  # s; by which velocities are behind positions, which are used alone then; 0 = they are not
    effort: Joints  # N m; disturbance
    slow_effort: Joints  # N m; its low-pass
    slow_wrench: Joints  # N m; low-pass of the measured wrench's torque
    wrench_jump: Joints  # N m; how far that has been off its low-pass, faded
    taken_off: Joints  # N m; added to the effort against it
    jumped_s: Joints  # s; for how long the disturbance has been off its low-pass
    beyond_s: Joints  # s; for how long it has been beyond its bound
    finding: Whole  # Finding, the first one; kept until `clear_findings`
    joint: Whole  # its joint
    value: Real  # rad, N m, rad/s or ms
    limit: Real  # rad, N m, rad/s or ms


class PublishedJoints(Record):
    """What is published of the estimate; zeros without one."""

    position: Joints  # rad
    velocity: Joints  # rad/s
    disturbance: Joints  # N m


ESTIMATOR_CONFIG, JOINT_ESTIMATE = dtype_of(EstimatorConfig), dtype_of(JointEstimate)
PUBLISHED_JOINTS = dtype_of(PublishedJoints)


class PadVariances(Protocol):
    """Variances of a pad's twist and of the noise in its change over a period; (6,) [m/s, rad/s]^2."""

    velocity_variance: Array
    change_variance: Array


class JointSampleLike(Protocol):
    """A joint state: stamp [ns], position [rad] and velocity [rad/s]."""

    stamp_ns: int
    position: Array
    velocity: Array


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
def start_estimate(config: EstimatorConfig, state: JointEstimate, stamp_ns: int, q: Array, qd: Array) -> None:
    """Begin at a sample; (n,) [rad], [rad/s]. The disturbance stays: friction and offset outlast a pause."""
    state.started, state.stamp_ns, state.renewed_ns, state.corrected_ns = 1, stamp_ns, stamp_ns, stamp_ns
    state.repeats, state.missing, state.newest, state.remembered = 0, 0, 0, 0
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
        state.moved[j] = state.swept[j] = state.moved_lately[j] = state.swept_lately[j] = 0.0
        state.same_position[j] = state.same_velocity[j] = 0
        state.mean_q[j], state.mean_v[j], state.quick[j] = 0.0, 0.0, 0
        if config.bandwidth > 0.0:
            for k in range(RING):
                state.inputs[k, j] = velocity


@part
def clear_findings(state: JointEstimate) -> None:
    """Forget what was wrong: both measurements of every joint are used again, from the next sample on."""
    if state.trust.any():
        state.started = 0
    state.finding, state.joint, state.value, state.limit = 0, 0, 0.0, 0.0
    state.trust[:] = 0
    state.moved[:] = 0.0
    state.swept[:] = 0.0
    state.jumped_s[:] = 0.0
    state.beyond_s[:] = 0.0
    state.late, state.lag = 0, 0.0


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
def go_on_with_input(config: EstimatorConfig, state: JointEstimate, periods: int) -> None:
    """Let the last input last for the control periods since the last sample in which there was no new one."""
    for _ in range(state.remembered, periods):
        remember_input(config, state, state.inputs[state.newest])
    state.remembered = 0


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
    go_on_with_input(config, state, periods)
    repeated = repeats(config, state, q, qd)
    count_unmeasured(config, state, stamp_ns, periods, q, qd, repeated, measured)
    new = measured and is_new(config, state, periods, repeated)
    if periods > 1:
        state.missing = 1
    # Of a slow sensor a missing sample may have been the first with what is new: nothing says when that was measured.
    corrects = new and (periods == 1 or config.sensor_ticks == 1) and not all_unmeasured(config, state)
    if new and not repeated:
        compare_measurements(config, state, (stamp_ns - state.renewed_ns) * 1e-9, q, qd)
        find_late_velocities(config, state)
        state.renewed_ns, state.missing = stamp_ns, 0 if corrects else 1
    # After a missing sample an innovation has had longer to grow from a wrong velocity or disturbance.
    passed, share = (stamp_ns - state.corrected_ns) * 1e-9, 1.0
    if passed > GAP * config.sensor_period:
        share = config.sensor_period / passed
    if corrects:
        state.corrected_ns = stamp_ns
    state.stamp_ns = stamp_ns
    step = dt / periods
    m, rest = config.late_ticks, min(config.late_rest, step)
    older, newer = transition(config.bandwidth, rest), transition(config.bandwidth, step - rest)
    whole = transition(config.bandwidth, config.period)
    for j in range(config.joints):
        x_q, x_v, x_d = state.q[j], state.v[j], state.d[j]
        for ago in range(m + periods - 1, m - 1, -1):
            if rest > 0.0:
                u = input_of(config, state, ago + 1, j)
                x_q, x_v = (
                    x_q + older.qv * x_v + older.qd * x_d + older.qu * u,
                    (older.vv * x_v + older.vd * x_d + older.vu * u),
                )
            u = input_of(config, state, ago, j)
            x_q, x_v = (
                x_q + newer.qv * x_v + newer.qd * x_d + newer.qu * u,
                (newer.vv * x_v + newer.vd * x_d + newer.vu * u),
            )
        of_q, of_v, trust = q[j] - x_q, qd[j] - x_v, state.trust[j]
        if trust == Trust.BOTH and (state.lag > 0.0 or state.alone != 0):
            trust = Trust.POSITION.value
        if not corrects or is_unmeasured(config, state, j):  # what is known stays
            of_q, of_v = 0.0, 0.0
        else:
            state.mean_q[j] += config.weight * (config.scale[0] * of_q - state.mean_q[j])
            state.mean_v[j] += config.weight * (config.scale[1] * of_v - state.mean_v[j])
            if max(abs(state.mean_q[j]), abs(state.mean_v[j])) > config.significant:
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
        if rest > 0.0:
            u = input_of(config, state, m, j)
            x_q, x_v = (
                x_q + older.qv * x_v + older.qd * x_d + older.qu * u,
                (older.vv * x_v + older.vd * x_d + older.vu * u),
            )
        for ago in range(m - 1, -1, -1):
            u = input_of(config, state, ago, j)
            x_q, x_v = (
                x_q + whole.qv * x_v + whole.qd * x_d + whole.qu * u,
                (whole.vv * x_v + whole.vd * x_d + whole.vu * u),
            )
        state.position[j], state.velocity[j] = x_q, x_v
    if far_off(config, state, q, qd):
        start_estimate(config, state, stamp_ns, q, qd)
        state.d[:] = 0.0


@part
def count_unmeasured(
    config: EstimatorConfig, state: JointEstimate, stamp_ns: int, periods: int, q: Array, qd: Array, all_repeat: bool,
    measured: bool,
) -> None:  # fmt: skip
    """Count for how long every joint has read the same (n,) [rad], [rad/s] though it moves, or never did before.

    All of them where all read the same and one moves, or nothing was measured. What a joint did for longer than
    LONGEST_S is not known: then it begins again at what it reads. periods: since the sample before, of control;
    all_repeat: see `repeats`; the others: see `estimate_joints`.
    """
    dt, renewed_s = (stamp_ns - state.stamp_ns) * 1e-9, (stamp_ns - state.renewed_ns) * 1e-9
    moves = not measured
    for j in range(config.joints):
        moves = moves or abs(qd[j]) > config.repeated or abs(qd[j]) * renewed_s > config.unmoved
    for j in range(config.joints):
        unknown = state.trust[j] == Trust.NEITHER
        dead = abs(qd[j]) > MOVES or never_same(config, state, j) or unknown
        if (all_repeat and moves) or (dead and joint_repeats(state, j, q, qd)):
            state.unmeasured[j] += periods
            continue
        if unknown or state.unmeasured[j] * config.period > LONGEST_S:
            state.q[j], state.v[j] = q[j] - dt * qd[j], qd[j]
        if unknown:
            state.trust[j] = Trust.BOTH.value
        state.unmeasured[j] = 0


@part
def is_unmeasured(config: EstimatorConfig, state: JointEstimate, j: int) -> bool:
    """Return whether joint j reads the same for longer than its sensor repeats itself, which nothing measured does."""
    return bool(state.unmeasured[j] >= config.sensor_ticks)


@part
def all_unmeasured(config: EstimatorConfig, state: JointEstimate) -> bool:
    """Return whether that holds of all joints: then nothing corrects the estimate, and innovations grow longer."""
    return bool(state.unmeasured[: config.joints].min() >= config.sensor_ticks)


@part
def is_blind(config: EstimatorConfig, state: JointEstimate) -> bool:
    """Return whether a joint has not been measured for so long that the model cannot tell where it is."""
    return unseen_ns(config, state) > 1e9 * BLIND_S


@part
def unseen_ns(config: EstimatorConfig, state: JointEstimate) -> float:
    """Return for how long a joint has not been measured [ns]."""
    return float(1e9 * (state.unmeasured.max() * config.period))


@part
def stay_blind(config: EstimatorConfig, state: JointEstimate) -> None:
    """Let the joints rest where the model has them: the drives hold them."""
    state.v[:] = 0.0
    remember_input(config, state, np.zeros(MAX_JOINTS))


@part
def far_off(config: EstimatorConfig, state: JointEstimate, q: Array, qd: Array) -> bool:
    """Return whether the estimate of a joint is not finite, or far from a measurement that is used; [rad], [rad/s]."""
    far = False
    for j in range(config.joints):
        trust = Trust.NEITHER.value if is_unmeasured(config, state, j) else state.trust[j]
        elsewhere = trust == Trust.VELOCITY or trust == Trust.NEITHER
        far = far or not (elsewhere or abs(state.position[j] - q[j]) < FAR)
        # Where velocity is not used it is at least a speed that joints have.
        measured = 0.0 if trust == Trust.POSITION or trust == Trust.NEITHER else qd[j]
        far = far or not abs(state.velocity[j] - measured) < FAST
    return far


@part
def is_new(config: EstimatorConfig, state: JointEstimate, periods: int, repeated: bool) -> bool:
    """Return whether a sample has been measured since the one before; a sensor slower than the cycle repeats itself.

    For no longer than its period: an arm at rest may read the same for ever. periods: since then, of control.
    """
    state.repeats += periods
    if repeated and state.repeats < config.sensor_ticks:
        return False
    state.repeats = 0
    return True


@part
def repeats(config: EstimatorConfig, state: JointEstimate, q: Array, qd: Array) -> bool:
    """Return whether a sample (n,) [rad], [rad/s] is equal to the one before to the last bit."""
    repeated = True
    for j in range(config.joints):
        repeated = repeated and joint_repeats(state, j, q, qd)
    return repeated


@part
def joint_repeats(state: JointEstimate, j: int, q: Array, qd: Array) -> bool:
    """Return whether joint j reads the same as in the sample before, to the last bit; (n,) [rad], [rad/s]."""
    return bool(q[j] == state.measured_position[j] and qd[j] == state.measured_velocity[j])


@part
def use_estimate(config: EstimatorConfig, state: JointEstimate, sample: JointSampleLike) -> None:
    """Take a joint state in, and put the estimate of now in its place; where it is off, from a finding on."""
    n = config.joints
    estimate_joints(config, state, sample.stamp_ns, sample.position[:n], sample.velocity[:n], True)
    if config.on != 0 or state.finding != Finding.NONE or state.unmeasured.max() >= config.sensor_ticks:
        put_estimate(config, state, sample)


@part
def goes_on(config: EstimatorConfig, state: JointEstimate, stamp_ns: int) -> bool:
    """Return whether a sample follows the one before closely enough to go on with the estimate."""
    dt = (stamp_ns - state.stamp_ns) * 1e-9
    return bool(state.started != 0 and 0.0 < dt <= min(LONGEST_STEP * config.period, LONGEST_S))


@part
def replace_sample(config: EstimatorConfig, state: JointEstimate, sample: JointSampleLike) -> bool:
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
def put_estimate(config: EstimatorConfig, state: JointEstimate, sample: JointSampleLike) -> None:
    """Put the estimate of now in the place of a joint state.

    Of drives with loops of their own it is the state to which the commands that have been sent lead: then the law
    commands what is free of their lag, and the joint does the same that much later.
    """
    n = config.joints
    if config.bandwidth > 0.0:
        foresee(config, state, sample)
    else:
        sample.position[:n], sample.velocity[:n] = state.position[:n], state.velocity[:n]


@part
def foresee(config: EstimatorConfig, state: JointEstimate, sample: JointSampleLike) -> None:
    """Write the commanded state q + v / b + what is under way, and its velocity; [rad], [rad/s].

    Implements: ours: with q' = v, v' = b (u - v) it is (q + v / b)' = u: a predictor after O. J. M. Smith, 1957.
    """
    for j in range(config.joints):
        ahead = state.position[j] + state.velocity[j] / config.bandwidth
        for k in range(1, config.drive_ticks + 1):
            ahead += config.period * input_of(config, state, -k, j)
        sample.position[j], sample.velocity[j] = ahead, state.inputs[state.newest, j]


@part
def compare_measurements(config: EstimatorConfig, state: JointEstimate, dt: float, q: Array, qd: Array) -> None:
    """Compare the way that positions show with that of the velocities, both faded over MEMORY_S.

    Between two samples the velocity may have had any value between theirs; where one is missing, any at all, and that
    way is not compared.
    Where they differ, the joint continues with the measurement that is not to blame: one that is equal to the last bit
    while the other moves is stuck, one that moves alone drifts. Where they move in opposite directions, in the newest
    sample or lately, it is the velocity: damping by it would throw the joint, while a position that drifts moves the
    joint no faster than that. Where both are stuck, or an encoder with noise repeats itself, it continues by the model
    alone, until it reads something else.
    """
    fade, fade_lately = math.exp(-dt / MEMORY_S), math.exp(-dt / max(LATELY * config.sensor_period, LATELY_S))
    for j in range(config.joints):
        before_q, before_v = state.measured_position[j], state.measured_velocity[j]
        way_q = way_v = 0.0
        if state.missing == 0 and dt < GAP * config.sensor_period:
            way_q = q[j] - before_q
            way_v = min(max(way_q, dt * min(qd[j], before_v)), dt * max(qd[j], before_v)) if state.alone == 0 else way_q
        state.moved[j], state.swept[j] = fade * state.moved[j] + way_q, fade * state.swept[j] + way_v
        state.moved_lately[j] = fade_lately * state.moved_lately[j] + way_q
        state.swept_lately[j] = fade_lately * state.swept_lately[j] + way_v
        if same(state, j) > 0 and not (q[j] == before_q and qd[j] == before_v):
            state.reversals[j] = 0
        elif before_v * qd[j] < 0.0:
            state.reversals[j] += 1
        state.same_position[j] = state.same_position[j] + 1 if q[j] == before_q else 0
        state.same_velocity[j] = state.same_velocity[j] + 1 if qd[j] == before_v else 0
        state.measured_position[j], state.measured_velocity[j] = q[j], qd[j]
        moved, swept = state.moved_lately[j], state.swept_lately[j]
        difference = abs(contradiction(state, j))
        if state.trust[j] == Trust.BOTH and never_same(config, state, j) and same(state, j) >= DEAD:
            state.trust[j] = Trust.NEITHER.value
            find(state, Finding.STUCK.value, j, 0.0, 0.0)
        if state.trust[j] != Trust.BOTH or not difference > config.difference:
            continue
        finding, trust = Finding.VELOCITY_BIASED.value, Trust.POSITION.value
        if state.same_velocity[j] > 0 and way_q != 0.0:
            finding = Finding.VELOCITY_STUCK.value
        elif same(state, j) >= STUCK:
            finding, trust = Finding.STUCK.value, Trust.NEITHER.value
        elif state.same_position[j] >= STUCK:
            finding, trust = Finding.POSITION_STUCK.value, Trust.VELOCITY.value
        elif opposed(way_q, dt * qd[j], OPPOSED) or opposed(moved, swept, OPPOSED):
            if opposed(way_q, dt * qd[j], SAME_SIZE) or opposed(moved, swept, SAME_SIZE):
                finding = Finding.VELOCITY_SIGN.value
        elif abs(moved) > abs(swept):
            finding, trust = Finding.POSITION_DRIFTS.value, Trust.VELOCITY.value
        state.trust[j] = trust
        find(state, finding, j, difference, config.difference)


@part
def contradiction(state: JointEstimate, j: int) -> float:
    """Return what position shows beyond velocity [rad] that a velocity which is up to LAG_S late does not explain."""
    difference = state.moved[j] - state.swept[j]
    late = max(LAG_S, 2.0 * state.lag) * gained(state, j)
    return float(difference - min(max(difference, min(late, 0.0)), max(late, 0.0)))


@part
def gained(state: JointEstimate, j: int) -> float:
    """Return the faded sum of the changes of the velocity of joint j [rad/s]; a second behind, its way lacks as much.

    Implements: ours: by parts it is the velocity now, less its faded mean.
    """
    return float(state.measured_velocity[j] - state.swept[j] / MEMORY_S)


@part
def find_late_velocities(config: EstimatorConfig, state: JointEstimate) -> None:
    """Find velocities that all are behind the positions by one time, as those of a low-pass that nobody told.

    Implements: ours: least squares of the differences of all joints over what their velocities gained.
    """
    if config.on == 0 or state.alone != 0 or state.lag > 0.0:
        return
    along = square = differences = 0.0
    for j in range(config.joints):
        if state.trust[j] == Trust.BOTH:
            difference, gain = state.moved[j] - state.swept[j], gained(state, j)
            along += difference * gain
            square += gain * gain
            differences += difference * difference
    noise = BEYOND_NOISE * config.spread
    clear = differences > config.joints * noise * noise and along * along > ALIKE * differences * square
    state.late = state.late + 1 if clear and along > config.least_lag * square else 0
    if state.late >= LATE:
        state.lag = along / square


@part
def same(state: JointEstimate, j: int) -> int:
    """Return for how many samples in a row joint j has read the same to the last bit."""
    return int(min(state.same_position[j], state.same_velocity[j]))


@part
def never_same(config: EstimatorConfig, state: JointEstimate, j: int) -> bool:
    """Return whether the encoder of joint j has noise, and so never reads the same twice."""
    return bool(config.on != 0 and state.reversals[j] >= REVERSALS)


@part
def opposed(a: float, b: float, share: float) -> bool:
    """Return whether two ways [rad] go in opposite directions, the shorter by more than a share of the longer."""
    return a * b < 0.0 and min(abs(a), abs(b)) > share * max(abs(a), abs(b))


@part
def find(state: JointEstimate, finding: int, j: int, value: float, limit: float) -> None:
    """Note what is wrong with joint j; the first finding stays."""
    if state.finding == Finding.NONE:
        state.finding, state.joint, state.value, state.limit = finding, j, value, limit


@part
def publish_joints(state: JointEstimate, out: PublishedJoints) -> None:
    """Write what is published."""
    out.position[:], out.velocity[:], out.disturbance[:] = state.position, state.velocity, state.effort


@part
def disturbance(config: EstimatorConfig, state: JointEstimate, M: Array, j: int) -> float:
    """Return the disturbance M d of joint j [N m]; M: inertia (n, n) [kg m2]."""
    effort = 0.0
    for k in range(config.joints):
        effort += M[j, k] * state.d[k]
    return effort


@part
def oppose_disturbance(
    config: EstimatorConfig,
    state: JointEstimate,
    M: Array,
    of_wrench: Array,
    dt: float,
    fault: bool,
    judged: bool,
    torque: Array,
) -> None:
    """Take the disturbance off the effort, inside its bound and rate, and look for jumps and lasting excess.

    A wrench that is measured wrongly looks like a disturbance, since the joints do not feel it. So a disturbance that
    jumps together with the wrench is no collision, and is not taken off.

    Args:
        config: what does not change.
        state: changed.
        M: inertia (n, n) [kg m2].
        of_wrench: J^T h, torque of the measured wrench; (n,) [N m].
        dt: since the cycle before [s].
        fault: whether the mode is FAULT.
        judged: whether the noise of joint velocities is known by now; before, a jump may be noise.
        torque: changed; (n,) [N m].

    Implements: ours: tau -= M d.
    """
    settling = config.settling_fault if fault else config.settling
    n, weight, follow = config.joints, 1.0 - math.exp(-dt / SLOW_S), 1.0 - math.exp(-dt / settling)
    # The inertia carries a joint that is measured wrongly, or not at all, into the torques of the others.
    unmeasured = bool(state.unmeasured.max() >= config.sensor_ticks)
    doubtful = unmeasured or not judged
    for j in range(n):
        differs = abs(contradiction(state, j)) > DOUBTFUL * config.difference
        doubtful = doubtful or state.trust[j] != Trust.BOTH or differs
    for j in range(n):
        effort = disturbance(config, state, M, j)
        if is_unmeasured(config, state, j):
            # What is known of it is its torque: the acceleration depends on the other joints, too.
            state.d[j] += (state.effort[j] - effort) / M[j, j]
            effort = state.effort[j]
        state.effort[j] = effort
        jump, wrench_jump = effort - state.slow_effort[j], of_wrench[j] - state.slow_wrench[j]
        state.wrench_jump[j] = max(abs(wrench_jump), (1.0 - weight) * state.wrench_jump[j])
        most = config.collision[j] + friction_jump(config, state, j, jump)
        with_wrench = state.wrench_jump[j] > max(WITH_WRENCH * abs(jump), NOTICED * config.collision[j])
        lasting = state.slow_effort[j] if with_wrench else effort
        # Neither low-pass may run to a wrench of some hundred newtons: it would get there in a few cycles.
        pull = NOTICED * config.collision[j] if with_wrench else math.inf
        state.slow_effort[j] += weight * min(max(jump, -pull), pull)
        state.slow_wrench[j] += weight * min(max(wrench_jump, -pull), pull)
        jumped = abs(jump) > most and not with_wrench and not doubtful
        state.jumped_s[j] = state.jumped_s[j] + dt if jumped else 0.0
        bound, step = config.bound[j], config.rate[j] * dt
        wanted = min(max(-lasting, -bound), bound) if config.compensates != 0 else 0.0
        before = state.taken_off[j]
        if unmeasured:
            wanted = before
        state.taken_off[j] = min(max(before + follow * (wanted - before), before - step), before + step)
        torque[j] += state.taken_off[j]
        state.beyond_s[j] = state.beyond_s[j] + dt if abs(effort) > bound else 0.0
        if state.jumped_s[j] > config.collision_s:
            find(state, Finding.COLLISION.value, j, jump, most)
        elif state.beyond_s[j] > config.disturbed_s:
            find(state, Finding.DISTURBED.value, j, effort, bound)


@part
def most_disturbed(config: EstimatorConfig, state: JointEstimate, M: Array, limit: Array) -> tuple[int, float]:
    """Return the joint whose disturbance is most beside its effort limit, and that disturbance [N m].

    Also where samples are used as they are: then nothing is done against it.

    Args:
        config, state: of the estimator.
        M: inertia (n, n) [kg m2].
        limit: effort limits (n,) [N m].
    """
    joint, torque, most = 0, 0.0, -1.0
    for j in range(config.joints):
        effort = disturbance(config, state, M, j)
        if abs(effort) > most * limit[j]:
            joint, torque, most = j, effort, abs(effort) / limit[j]
    return joint, torque


@part
def friction_jump(config: EstimatorConfig, state: JointEstimate, j: int, jump: float) -> float:
    """Return how much of a jump of the disturbance a change of sign of the friction of joint j explains [N m].

    Friction turns round against the velocity; a joint that comes to rest may be held in either direction.
    """
    along = jump * state.velocity[j] > 0.0 and abs(state.velocity[j]) > MOVES
    return 0.0 if along else 2.0 * float(config.friction[j])


@part
def pad_variances(config: EstimatorConfig, arm: Arm, out: PadVariances) -> None:
    """Write the variances of the pad's twist and of the noise in its change over a period, on pad axes; (6,), (6,).

    Args:
        config: variances of the joint velocities, alike and independent.
        arm: at this joint state.
        out: result.

    Implements: ours: diag(A A^T) sigma^2 with A = R^T J.
    """
    J, R = arm.J, arm.rotation
    for i in range(6):
        total, first = 0.0, 3 if i >= 3 else 0
        axis = i - first
        for j in range(config.joints):
            a = R[0, axis] * J[first, j] + R[1, axis] * J[first + 1, j] + R[2, axis] * J[first + 2, j]
            total += a * a
        out.velocity_variance[i] = total * config.velocity_variance
        out.change_variance[i] = total * config.change_variance
