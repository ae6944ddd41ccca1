"""The slip observer: the model predicts slip at control rate, sensor samples correct it at their own time stamps.

Two hypotheses share one filter per axis. In stick the slip velocity is zero at every tick, from which the filters learn
the model's errors (wrench bias, wrong mass). In slip the velocity is free,

    v_s[k+1] = v_s[k] + dv_ee - T (G^T a_o + Phi1' v_s + Phi2), with the model's errors b + c f removed,

and a sample of stamp t_m corrects the estimate at t_m; the ticks since then are recomputed. A test of the normalised
innovation squared, of the model and of the samples, decides between the two, so that noise does not activate the
compensation.

The filters learn from a tick only once it has passed as stick. Otherwise the beginning of a slip would be learnt as a
model error.

On pad axes {ee} throughout; only the axes in which the contact can slip are filtered. Arrays over axes have six
entries, linear x, y, z, then angular; those of axes that are not filtered are zero. Stamps are whole nanoseconds.
"""

from __future__ import annotations

import math
from typing import Annotated

from slip_core.arrays import Array
from slip_core.cholesky import LARGEST
from slip_core.compiled import part
from slip_core.records import Mat3, Real, Record, Records, Vec3, Vec6, Whole, dtype_of, records
from slip_core.vectors import ZERO, Spatial, Vec, mat, put, put_spatial, spatial, vec
from slip_vic_controller.contact.axis import Axis, correct, correct_within, excess, forget_errors, predict, put_velocity
from slip_vic_controller.law.contact import StampedSlip

CONTRADICTIONS = 3
"""Consecutive samples required from a real sensor: two outliers in a row occur every minute."""


class ObserverConfig(Record):
    """Tuning; speeds and accelerations in m/s, m/s^2 on linear and rad/s, rad/s^2 on angular axes."""

    axes: Vec6  # 1 where the axis is filtered
    measurement_variance: Vec6  # R of a slip sample
    information: Vec6  # 1 / R on the axes that are filtered, 0 on the others
    process_variance: Vec6  # Q of v per tick, from wrench noise and model
    model_variance: Vec6  # what of it the model gives
    of_force: Vec6  # and what each N^2 and (N m)^2 of wrench noise
    of_torque: Vec6
    drift_variance: Vec6  # Q of b per tick
    prior_P_bb: Vec6  # noqa: N815 - what is known of the model's errors at the beginning
    prior_P_cc: Vec6  # noqa: N815
    onset_gain: Vec6  # 1, 1/m; standard deviation that b gains when slip begins, per acceleration of the object
    floor_variance: Vec6  # of a slip velocity that means nothing
    stick_P_bb: Vec6  # noqa: N815 - variances above which nothing is taken for stick
    stick_P_vv: Vec6  # noqa: N815
    quantum: Real  # m/s; step of the linear readings
    dead_band: Vec6  # speed below which the sensor reads zero
    nis_slip: Real  # normalised innovation squared above which slip begins
    nis_stick: Real  # and below which it is over
    smoothing: Real  # weight of a new sample in the mean that is tested in stick
    mean_share: Real  # variance of that mean over R
    most_step: Real  # how far one sample may move that mean, over what is significant
    outlier_deviations: Real  # beyond which a sample pulls no harder
    friction_spread: Real  # rad; how far friction may point away from the slip, 0 = its direction is not used
    friction_memory_ticks: Real  # over which that error stays the same
    dwell_ticks: Whole  # below nis_stick until slip is over
    window_ticks: Whole  # over which slip must show in the model
    memory_ns: Whole  # how late a sample may be


OBSERVER_CONFIG = dtype_of(ObserverConfig)


class Motion(Record):
    """Input of the observer in a tick; {w}."""

    rotation: Mat3  # R_ee
    v_ee: Vec6  # m/s, rad/s; twist of the pad
    follow: Vec6  # m/s^2, rad/s^2; G^T a_o + Phi2: acceleration of the object's material point under the pad
    force: Vec6  # m/s^2, rad/s^2; the part of it that the wrench gives, without gravity
    drag: Vec3  # m/s^2; acceleration that the pad gives to the centre of mass
    w_o: Vec3  # rad/s; turning of the object
    velocity_variance: Vec6  # {ee}; of v_ee, zeros without an estimate of the joint state
    change_variance: Vec6  # {ee}; of the noise in the change of v_ee since the tick before


MOTION = dtype_of(Motion)


class Observer(Record):
    """State between ticks; the outputs for the law are on {ee}."""

    stamp_ns: Whole  # of the last tick
    sliding: Whole  # 0 stick, 1 slip
    since_ns: Whole  # when stick began
    quiet: Whole  # ticks in a row without significant slip
    against: Whole  # samples in a row that contradict the estimate
    first: Whole  # where the history begins in its ring
    rows: Whole  # and its length
    twist: Vec6  # m/s, rad/s {ee}; slip velocity, zero in stick
    error: Vec6  # m/s^2, rad/s^2 {ee}; b + c f of `follow`
    variance: Vec6  # of the slip velocity
    significance: Real  # normalised innovation squared
    v_ee: Vec6  # m/s, rad/s {w}; twist of the pad at the last tick
    sample_mean: Vec6  # of the samples in stick, weighted, or those from which slip has restarted
    axes: Annotated[Records[Axis], 6]  # the filters


OBSERVER = dtype_of(Observer)


class Row(Record):
    """A row of the history: a tick, and the samples that count at it."""

    stamp_ns: Whole
    samples: Whole  # how many
    reads: Vec6  # their sum
    contradicts: Whole  # whether their mean contradicts the estimate before it
    dt: Real  # s; since the tick before
    turn_linear: Vec3  # rad/s; w_ee + 2 w_o
    turn_angular: Vec3  # rad/s; w_ee + w_o
    drag: Vec3  # m/s^2
    step: Vec6  # change of the slip velocity as the uncorrected model has it
    force: Vec6  # specific force
    velocity_variance: Vec6  # of the pad's velocity
    change_variance: Vec6  # of the noise in `step`
    axes: Annotated[Records[Axis], 6]  # in slip: the estimate with this row taken in


ROW = dtype_of(Row)

ROW_SIZE = ROW.itemsize // 8
"""Numbers of a row."""

# -- history: ticks in a ring, oldest first, each with the samples that count at it -------------------


@part
def slot(state: Observer, capacity: int, i: int) -> int:
    """Return where row number i, from the oldest, lies in the ring."""
    j = state.first + i
    return j if j < capacity else j - capacity


@part
def row_at(state: Observer, rows: Records[Row], i: int) -> Row:
    """Return row number i, from the oldest."""
    return rows[slot(state, len(rows), i)]


@part
def drop_oldest(state: Observer, rows: Records[Row]) -> None:
    """Forget the oldest row."""
    state.first = slot(state, len(rows), 1)
    state.rows -= 1


@part
def append(state: Observer, history: Array, rows: Records[Row]) -> Row:
    """Return a new last row of zeros; if there is no room, the oldest one is dropped."""
    if state.rows == len(rows):
        drop_oldest(state, rows)
    state.rows += 1
    history[slot(state, len(rows), state.rows - 1), :] = 0.0
    return row_at(state, rows, state.rows - 1)


@part
def place_samples(
    config: ObserverConfig, state: Observer, rows: Records[Row], samples: Records[StampedSlip], count: int
) -> int:
    """Add samples to the ticks at which they apply; return the first row that is new or has changed.

    A sample applies at the first tick not before its stamp, else at the last one. One that is not younger than the
    oldest row is too late.
    """
    first = state.rows - 1
    for k in range(count):
        sample, i = samples[k], state.rows - 1
        if sample.stamp_ns <= row_at(state, rows, 0).stamp_ns:
            continue
        while row_at(state, rows, i - 1).stamp_ns >= sample.stamp_ns:
            i -= 1
        row, first = row_at(state, rows, i), min(first, i)
        row.samples += 1
        for j in range(6):
            row.reads[j] += sample.twist[j] if config.axes[j] else 0.0
    return first


# -- slip ---------------------------------------------------------------------------------------------


@part
def component(s: Spatial, i: int) -> float:
    """Return one of six components."""
    return s.linear[i] if i < 3 else s.angular[i - 3]


@part
def slip_velocity(axes: Records[Axis]) -> Spatial:
    """Return the estimated slip velocity; [m/s, rad/s] {ee}."""
    return Spatial(Vec(axes[0].v, axes[1].v, axes[2].v), Vec(axes[3].v, axes[4].v, axes[5].v))


@part
def predict_tick(config: ObserverConfig, ahead: Records[Axis], row: Row) -> None:
    """Predict the estimate `ahead` of a tick over it.

    step - dt (w_ee x + Phi1') v_s: rotating axes and Coriolis terms rotate the slip velocity.
    """
    v = slip_velocity(ahead)
    turning = Spatial(vec(row.turn_linear).cross(v.linear), vec(row.turn_angular).cross(v.angular))
    for i in range(6):
        if config.axes[i]:
            row.axes[i] = ahead[i]
            step = row.step[i] - row.dt * component(turning, i)
            q_v, q_b = config.process_variance[i] + row.change_variance[i], config.drift_variance[i]
            predict(row.axes[i], step, row.force[i], row.dt, q_v, q_b)


@part
def friction_direction_update(config: ObserverConfig, row: Row) -> None:
    """Correct with the direction of friction, which opposes slip: the pad slides over the object in the direction d of
    its drag.

    v is corrected towards (v.d)+ d / d^2 with d = drag + b + c f, where the axis is not along d. The friction
    coefficient does not matter. The correction is weak, because pads are anisotropic.
    """
    x, y, z = row.axes[0], row.axes[1], row.axes[2]
    v, b = Vec(x.v, y.v, z.v), Vec(x.b, y.b, z.b)
    d = vec(row.drag) + b + Vec(x.c * row.force[0], y.c * row.force[1], z.c * row.force[2])
    square = d.dot(d)
    if config.friction_spread == 0.0 or square == 0.0:
        return
    along = v.dot(d) / square
    spread = config.friction_spread * v.norm()
    for i in range(3):
        if config.axes[i]:
            # Where the direction is possible nothing is said of the speed along it: only the share across counts.
            across = 1.0 - d[i] * d[i] / square if along > 0.0 else 1.0
            if across > 0.0:
                R = config.friction_memory_ticks * (spread * spread + config.floor_variance[i]) / across
                correct(row.axes[i], max(along, 0.0) * d[i], R)


@part
def read_part(config: ObserverConfig, row: Row, i: int) -> tuple[float, float, float]:
    """Return reading and variance of a row's samples on an axis, and the dead band, 0 unless they read zero."""
    first = 0 if i < 3 else 3
    size = abs(row.reads[first]) + abs(row.reads[first + 1]) + abs(row.reads[first + 2])
    band = config.dead_band[i] if size == 0.0 else 0.0
    return row.reads[i] / row.samples, config.measurement_variance[i] / row.samples, band


@part
def correct_samples(config: ObserverConfig, row: Row) -> None:
    """Correct with the samples of a row; a component that reads zero lies anywhere within the dead band."""
    row.contradicts, limit = 0, config.outlier_deviations
    for i in range(6):
        if config.axes[i]:
            x = row.axes[i]
            z, R, band = read_part(config, row, i)
            beyond = excess(x, z if band == 0.0 else min(max(x.v, -band), band), R, limit)
            if beyond > 0.0:
                row.contradicts = 1
            if band > 0.0:
                correct_within(x, band, R)
            else:
                correct(x, z, R + beyond / (limit * limit))


@part
def rerun(config: ObserverConfig, state: Observer, rows: Records[Row], ahead: Records[Axis], first: int) -> None:
    """Compute the rows from number `first` on, again or for the first time; `ahead`: the filters before it."""
    for i in range(first, state.rows):
        row = row_at(state, rows, i)
        predict_tick(config, ahead, row)
        friction_direction_update(config, row)
        if row.samples > 0:
            correct_samples(config, row)
        ahead = row.axes
    for i in range(6):
        state.axes[i] = ahead[i]


@part
def slip_significance(config: ObserverConfig, state: Observer) -> float:
    """Return v^T P^-1 v of the estimate against v = 0, chi-squared distributed without slip; [1]."""
    total = 0.0
    for i in range(6):
        if config.axes[i]:
            x = state.axes[i]
            total += x.v * x.v / (x.P_vv + config.floor_variance[i])
    return total


@part
def is_confirmed(config: ObserverConfig, state: Observer, row: Row) -> bool:
    """Return whether the estimate is certain enough for a slip velocity near zero to mean stick.

    Control keeps the estimate near zero, so only a confirmed model can show stick, and an insignificant speed may be
    large while its variance is.
    """
    confirmed = True
    for i in range(6):
        if config.axes[i]:
            x = state.axes[i]
            # Noise of the joints leaves this much doubt, however long it is at rest.
            noise, time = row.velocity_variance[i], config.window_ticks * row.dt
            doubt = noise + math.sqrt(row.change_variance[i] * config.measurement_variance[i])
            confirmed = confirmed and x.P_vv < config.stick_P_vv[i] + doubt
            # Of b and c apart little is known where the force is steady: what counts is b + c f.
            f = row.force[i]
            P_error = x.P_bb + 2.0 * f * x.P_bc + f * f * x.P_cc
            confirmed = confirmed and P_error * time * time < config.stick_P_bb[i] * time * time + 2.0 * noise
    return confirmed


@part
def begin_stick(config: ObserverConfig, state: Observer) -> None:
    """End the slip: v = 0 exactly; the learnt model errors stay."""
    state.sliding, state.quiet, state.against, state.since_ns = 0, 0, 0, state.stamp_ns
    state.first, state.rows = 0, 0
    for i in range(6):
        if config.axes[i]:
            state.sample_mean[i] = 0.0
            correct(state.axes[i], 0.0, config.floor_variance[i])
            put_velocity(state.axes[i], 0.0, 0.0)


@part
def begin_slip_of_samples(config: ObserverConfig, state: Observer, rows: Records[Row], first: int) -> None:
    """Start slip at row `first` with `sample_mean`, and with the initial uncertainty of the model's errors.

    The model is wrong: it has missed the slip, or takes every sample for an outlier and would never recover.
    """
    state.sliding, state.against = 1, 0
    for _ in range(first):
        drop_oldest(state, rows)
    row = row_at(state, rows, 0)
    for i in range(6):
        if config.axes[i]:
            m, band = state.sample_mean[i], config.dead_band[i]
            row.axes[i] = state.axes[i]
            put_velocity(row.axes[i], m, config.measurement_variance[i] + m * m + band * band)
            forget_errors(row.axes[i], config.prior_P_bb[i], config.prior_P_cc[i])
    rerun(config, state, rows, row.axes, 1)


@part
def observe_slip(
    config: ObserverConfig, state: Observer, rows: Records[Row], samples: Records[StampedSlip], count: int
) -> None:
    """Predict, correct, and test whether the slip is over, or never was; the tick's row is the last one."""
    first = place_samples(config, state, rows, samples, count)
    rerun(config, state, rows, row_at(state, rows, first - 1).axes, first)
    if count > 0:
        state.against = state.against + 1 if row_at(state, rows, first).contradicts else 0
    if state.against == CONTRADICTIONS:
        sample = row_at(state, rows, first)
        state.sample_mean[:] = sample.reads / sample.samples
        begin_slip_of_samples(config, state, rows, first)
    state.significance = slip_significance(config, state)
    at_rest = is_confirmed(config, state, row_at(state, rows, state.rows - 1)) and state.significance < config.nis_stick
    state.quiet = state.quiet + 1 if at_rest else 0
    if state.quiet >= config.dwell_ticks:
        begin_stick(config, state)


# -- stick --------------------------------------------------------------------------------------------


@part
def learn_model_errors(config: ObserverConfig, state: Observer, row: Row) -> None:
    """Learn the model's errors from a tick that has passed as stick, in which the predicted velocity was zero."""
    for i in range(6):
        if config.axes[i]:
            x, q_v = state.axes[i], config.process_variance[i] + row.change_variance[i]
            predict(x, row.step[i], row.force[i], row.dt, q_v, config.drift_variance[i])
            correct(x, 0.0, 0.0)


@part
def stick_significance(config: ObserverConfig, state: Observer, rows: Records[Row]) -> float:
    """Return v^T S^-1 v of the velocity accumulated over the window from v = 0; chi-squared without slip; [1].

    S: its variance from the model's errors and the process noise of the window.
    """
    first, last = row_at(state, rows, 0), row_at(state, rows, state.rows - 1)
    total = 0.0
    for i in range(6):
        if config.axes[i]:
            x, time, impulse, steps = state.axes[i], 0.0, 0.0, 0.0
            for k in range(state.rows):
                row = row_at(state, rows, k)
                time, impulse, steps = time + row.dt, impulse + row.dt * row.force[i], steps + row.step[i]
            v = steps - time * x.b - impulse * x.c
            S = time * time * x.P_bb + 2.0 * time * impulse * x.P_bc + impulse * impulse * x.P_cc
            S += state.rows * config.process_variance[i] + config.floor_variance[i]
            total += v * v / (S + first.velocity_variance[i] + last.velocity_variance[i])
    return total


@part
def average_and_test_samples(
    config: ObserverConfig, state: Observer, samples: Records[StampedSlip], count: int
) -> bool:
    """Update the weighted mean with samples in order; return whether it was significant after one of them.

    One sample moves the mean no further than `most_step`, so an outlier alone is not significant.
    """
    most, mean, seen = config.most_step * math.sqrt(config.nis_slip), spatial(state.sample_mean), False
    axes, weights = spatial(config.axes), (1.0 / config.mean_share) * spatial(config.information)
    for k in range(count):
        if samples[k].stamp_ns > state.since_ns:
            z = axes * spatial(samples[k].twist)
            d = config.smoothing * (z - mean)
            step = d.dot(weights * d)
            outlier = step > most * most
            mean = mean + (most / math.sqrt(step) if outlier else 1.0) * d
            if mean.dot(weights * mean) > config.nis_slip:
                seen, mean = True, z if outlier else mean  # no outlier then, but a slip that lasts
    put_spatial(state.sample_mean, mean)
    return seen


@part
def begin_slip_of_model(config: ObserverConfig, state: Observer, rows: Records[Row]) -> None:
    """Recompute the window as slip, with increased uncertainty: the learnt errors apply to the forces of stick.

    The proportions of forces and torques change in slip, and with them the effect of a wrong centre of mass.
    """
    state.sliding = 1
    drag = vec(row_at(state, rows, state.rows - 1).drag).norm()
    for i in range(6):
        if config.axes[i]:
            deviation = config.onset_gain[i] * drag
            state.axes[i].P_bb += deviation * deviation
    rerun(config, state, rows, state.axes, 0)


@part
def observe_stick(
    config: ObserverConfig, state: Observer, rows: Records[Row], samples: Records[StampedSlip], count: int,
) -> None:  # fmt: skip
    """Learn from the tick that leaves the window, and test whether slip has begun; the tick's row is the last one."""
    while state.rows > config.window_ticks:
        learn_model_errors(config, state, row_at(state, rows, 0))
        drop_oldest(state, rows)
    state.significance = stick_significance(config, state, rows)
    seen = average_and_test_samples(config, state, samples, count)
    if state.significance > config.nis_slip:
        begin_slip_of_model(config, state, rows)
    elif seen:
        begin_slip_of_samples(config, state, rows, state.rows - 1)


# -- a tick -------------------------------------------------------------------------------------------


@part
def reset(config: ObserverConfig, state: Observer, stamp_ns: int, v_ee: Array) -> None:
    """Start without slip, with unknown model errors.

    Args:
        config: tuning.
        state: overwritten.
        stamp_ns: of the tick before the first one.
        v_ee: twist of the pad at it; (6,) [m/s, rad/s] {w}.
    """
    state.stamp_ns, state.since_ns = stamp_ns, stamp_ns
    state.sliding, state.quiet, state.against, state.first, state.rows = 0, 0, 0, 0, 0
    state.significance = 0.0
    state.twist[:], state.error[:], state.variance[:], state.sample_mean[:] = 0.0, 0.0, 0.0, 0.0
    state.v_ee[:] = v_ee
    for i in range(6):
        x, shown = state.axes[i], config.axes[i]
        put_velocity(x, 0.0, 0.0)
        forget_errors(x, shown * config.prior_P_bb[i], shown * config.prior_P_cc[i])
        x.b, x.c = 0.0, 0.0


@part
def observe(
    config: ObserverConfig, state: Observer, history: Array, motion: Motion, stamp_ns: int,
    samples: Records[StampedSlip], count: int,
) -> bool:  # fmt: skip
    """Update with one tick and its samples; return whether every number of the state is finite.

    Args:
        config: tuning.
        state: overwritten; where the result is False it is undefined.
        history: (capacity, ROW_SIZE) float64, zeros in the beginning; belongs to the state, overwritten.
        motion: of this tick.
        stamp_ns: of this tick, not before the last one.
        samples: of the own contact, in the order of their stamps.
        count: how many of them there are.
    """
    rows, to_pad = records(history, ROW), mat(motion.rotation).T()
    dt, state.stamp_ns = (stamp_ns - state.stamp_ns) * 1e-9, stamp_ns
    force = spatial(config.axes) * (to_pad @ spatial(motion.force))
    while state.sliding and state.rows > 1 and row_at(state, rows, 0).stamp_ns < stamp_ns - config.memory_ns:
        drop_oldest(state, rows)
    row = append(state, history, rows)
    describe_tick(config, state, motion, dt, row)
    put_spatial(row.force, force)
    state.v_ee[:] = motion.v_ee
    if state.sliding:
        observe_slip(config, state, rows, samples, count)
    else:
        observe_stick(config, state, rows, samples, count)
    return publish(state, force)


@part
def describe_tick(config: ObserverConfig, state: Observer, motion: Motion, dt: float, row: Row) -> None:
    """Write the change of slip velocity in a tick, dv_ee - dt (G^T a_o + Phi2), and Phi1'; {ee}."""
    to_pad, axes, v_ee = mat(motion.rotation).T(), spatial(config.axes), spatial(motion.v_ee)
    w_ee, w_o = to_pad @ v_ee.angular, to_pad @ vec(motion.w_o)
    step = v_ee - spatial(state.v_ee) - dt * spatial(motion.follow)
    row.stamp_ns, row.dt = state.stamp_ns, dt
    put(row.turn_linear, w_ee + 2.0 * w_o)
    put(row.turn_angular, w_ee + w_o)
    put(row.drag, (axes * Spatial(to_pad @ vec(motion.drag), ZERO)).linear)
    put_spatial(row.step, axes * (to_pad @ step))
    row.velocity_variance[:], row.change_variance[:] = motion.velocity_variance, motion.change_variance


@part
def publish(state: Observer, force: Spatial) -> bool:
    """Write the outputs for the law; return whether every number of the state and its square are finite.

    They are the slip velocity, zero in stick, the error b + c f of `follow` at a specific force, and the variance.
    """
    size = state.significance
    for i in range(6):
        x = state.axes[i]
        state.twist[i] = x.v if state.sliding else 0.0
        state.error[i] = x.b + x.c * (force.linear[i] if i < 3 else force.angular[i - 3])
        state.variance[i] = x.P_vv
        size += abs(x.v) + abs(x.b) + abs(x.c) + x.P_vv + x.P_bb + x.P_cc
        size += abs(state.error[i]) + abs(state.v_ee[i]) + abs(state.sample_mean[i])
    return size <= LARGEST
