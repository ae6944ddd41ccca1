"""The slip observer: the model predicts slip at control rate, sensor samples correct it at their own time stamps.

Two hypotheses share one filter per axis. In stick the slip velocity is zero at every tick, which teaches the filters
the model's errors (wrench bias, wrong mass). In slip the velocity is free,

    v_s[k+1] = v_s[k] + dv_ee - T (G^T a_o + Phi1' v_s + Phi2), with the model's errors b + c f taken out,

and a sample of stamp t_m corrects the estimate as it was at t_m; the ticks since then are run again. A test of the
normalised innovation squared, on what the model says and on the samples, decides between the two, so that noise does
not activate the compensation.

What the model says of the last ticks counts only once they have passed as stick. Were it taken in at once, the
beginning of a slip would be learnt as an error of the model.

On pad axes throughout; only the axes in which the contact can slip are filtered.
"""

from __future__ import annotations

import math

from slip_core.arrays import Array
from slip_core.cholesky import LARGEST
from slip_core.compiled import part
from slip_core.records import Records, records
from slip_core.vectors import NOTHING, ZERO, Spatial, Vec, mat, put, put_spatial, spatial, vec
from slip_vic_controller.contact.axis import (
    Axis,
    correct,
    correct_within,
    excess,
    forget_errors,
    predict,
    put_velocity,
)
from slip_vic_controller.contact.layouts import ROW, WITNESSES, Motion, Observer, ObserverConfig, Row
from slip_vic_controller.law.contact import StampedSlip

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
    """Return a new last row of zeros; where there is no room the oldest one goes."""
    if state.rows == len(rows):
        drop_oldest(state, rows)
    state.rows += 1
    history[slot(state, len(rows), state.rows - 1), :] = 0.0
    return row_at(state, rows, state.rows - 1)


@part
def place_samples(
    config: ObserverConfig, state: Observer, rows: Records[Row], samples: Records[StampedSlip], count: int
) -> int:
    """Add samples to the ticks at which they count; return the first row that is new or has changed.

    A sample counts at the first tick not before its stamp, else at the last one. One that is not younger than the
    oldest row is too late.
    """
    first = state.rows - 1
    for k in range(count):
        sample, i = samples[k], state.rows - 1
        if sample.stamp_ns <= row_at(state, rows, 0).stamp_ns:
            state.late += 1
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

    step - dt (w_ee x + Phi1') v_s: turning axes and Coriolis take from the slip velocity what they turn it by.
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
    """Take in that friction opposes slip: the pad slides over the object in the direction d in which it drags it.

    v is corrected towards (v.d)+ d / d^2 with d = drag + b + c f, where the axis is not along d. The friction
    coefficient does not matter. The correction is weak, because pads are not alike in all directions.
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
    """Return what the samples of a row read on an axis, its variance, and the dead band, 0 where they read a number."""
    first = 0 if i < 3 else 3
    size = abs(row.reads[first]) + abs(row.reads[first + 1]) + abs(row.reads[first + 2])
    band = config.dead_band[i] if size == 0.0 else 0.0
    return row.reads[i] / row.samples, config.measurement_variance[i] / row.samples, band


@part
def correct_samples(config: ObserverConfig, row: Row) -> None:
    """Correct with the samples of a row; a part that reads zero is only known to lie within the dead band."""
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
    """Run the rows from number `first` on, again or for the first time; `ahead`: the filters before it."""
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
    """Return v^T P^-1 v of the estimate against v = 0, chi-squared where there is no slip; [1]."""
    total = 0.0
    for i in range(6):
        if config.axes[i]:
            x = state.axes[i]
            total += x.v * x.v / (x.P_vv + config.floor_variance[i])
    return total


@part
def is_confirmed(config: ObserverConfig, state: Observer, row: Row) -> bool:
    """Return whether the estimate is certain enough for a slip velocity near zero to mean stick.

    Control holds the estimate near zero, so only a confirmed model can show stick, and an insignificant speed is not a
    small one while its variance is large.
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
    """End the slip: v = 0 exactly; what was learnt of the model's errors stays."""
    state.sliding, state.quiet, state.since_ns = 0, 0, state.stamp_ns
    state.first, state.rows = 0, 0
    for i in range(6):
        if config.axes[i]:
            state.sample_mean[i] = 0.0
            correct(state.axes[i], 0.0, config.floor_variance[i])
            put_velocity(state.axes[i], 0.0, 0.0)


@part
def contradicted_since(state: Observer, rows: Records[Row]) -> int:
    """Return the number of the first of the WITNESSES newest rows with samples, -1 where not all contradict.

    Where so many samples in a row contradict the estimate it is the model that is wrong, and they are no outliers.
    """
    count, i = 0, state.rows
    while i > 0 and count < WITNESSES:
        i -= 1
        row = row_at(state, rows, i)
        if row.samples > 0:
            if row.contradicts == 0:
                return -1
            count += 1
    return i if count == WITNESSES else -1


@part
def samples_show_rest(config: ObserverConfig, state: Observer, rows: Records[Row], first: int) -> bool:
    """Return whether the mean of the samples from row `first` on is insignificant against v = 0."""
    added, n = NOTHING, 0
    for k in range(first, state.rows):
        row = row_at(state, rows, k)
        added, n = added + spatial(row.reads), n + row.samples
    return added.dot(spatial(config.information) * added) < n * config.nis_slip


@part
def restart_from_samples(config: ObserverConfig, state: Observer, rows: Records[Row], first: int) -> None:
    """Begin again at the samples of row `first`: the model's errors are as unknown as in the beginning.

    A filter that is sure of a wrong model takes every sample for an outlier, and so would never come back.
    """
    for _ in range(first):
        drop_oldest(state, rows)
    row = row_at(state, rows, 0)
    for i in range(6):
        if config.axes[i]:
            z, R, band = read_part(config, row, i)
            put_velocity(row.axes[i], z, R + band * band)
            forget_errors(row.axes[i], config.prior_P_bb[i], config.prior_P_cc[i])
    rerun(config, state, rows, row.axes, 1)


@part
def observe_slip(
    config: ObserverConfig, state: Observer, rows: Records[Row], samples: Records[StampedSlip], count: int
) -> None:
    """Predict, correct, and test whether the slip is over, or never was; the tick's row is the last one."""
    first = place_samples(config, state, rows, samples, count)
    rerun(config, state, rows, row_at(state, rows, first - 1).axes, first)
    since = contradicted_since(state, rows) if count > 0 else -1
    if since >= 0 and samples_show_rest(config, state, rows, since):  # a slip that the samples never saw
        begin_stick(config, state)
        for i in range(6):
            if config.axes[i]:
                forget_errors(state.axes[i], config.prior_P_bb[i], config.prior_P_cc[i])
        return
    if since >= 0:
        restart_from_samples(config, state, rows, since)
    state.significance = slip_significance(config, state)
    at_rest = is_confirmed(config, state, row_at(state, rows, state.rows - 1)) and state.significance < config.nis_stick
    state.quiet = state.quiet + 1 if at_rest else 0
    if state.quiet >= config.dwell_ticks:
        begin_stick(config, state)


# -- stick --------------------------------------------------------------------------------------------


@part
def learn_model_errors(config: ObserverConfig, state: Observer, row: Row) -> None:
    """Learn the model's errors from a tick that has passed as stick: the velocity that they predict was zero."""
    for i in range(6):
        if config.axes[i]:
            x, q_v = state.axes[i], config.process_variance[i] + row.change_variance[i]
            predict(x, row.step[i], row.force[i], row.dt, q_v, config.drift_variance[i])
            correct(x, 0.0, 0.0)


@part
def stick_significance(config: ObserverConfig, state: Observer, rows: Records[Row]) -> float:
    """Return v^T S^-1 v of the velocity that the window adds up to from v = 0; chi-squared without slip; [1].

    S: the variance that the model's errors and the process noise of the window give it.
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
    """Take samples into the weighted mean, in their order; return whether it was significant after one of them.

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
    """Run the window as slip, with the doubt that a slip begins with: what was learnt holds for the forces of stick.

    Forces and torques come in other proportions now, so a wrong centre of mass shows in another way.
    """
    state.sliding = 1
    drag = vec(row_at(state, rows, state.rows - 1).drag).norm()
    for i in range(6):
        if config.axes[i]:
            deviation = config.onset_gain[i] * drag
            state.axes[i].P_bb += deviation * deviation
    rerun(config, state, rows, state.axes, 0)


@part
def begin_slip_of_samples(config: ObserverConfig, state: Observer, rows: Records[Row]) -> None:
    """Start slip from the samples: the model has missed it, so its errors are unknown again. This tick's row stays."""
    state.sliding = 1
    while state.rows > 1:
        drop_oldest(state, rows)
    row = row_at(state, rows, 0)
    for i in range(6):
        if config.axes[i]:
            m = state.sample_mean[i]
            put_velocity(state.axes[i], m, config.mean_share * config.measurement_variance[i] + m * m)
            forget_errors(state.axes[i], config.prior_P_bb[i], config.prior_P_cc[i])
            row.axes[i] = state.axes[i]


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
        begin_slip_of_samples(config, state, rows)


# -- a tick -------------------------------------------------------------------------------------------


@part
def reset(config: ObserverConfig, state: Observer, stamp_ns: int, v_ee: Array) -> None:
    """Begin without slip, the model's errors unknown.

    Args:
        config: tuning.
        state: overwritten.
        stamp_ns: of the tick before the first one.
        v_ee: twist of the pad at it; (6,) [m/s, rad/s] {w}.
    """
    state.stamp_ns, state.since_ns = stamp_ns, stamp_ns
    state.sliding, state.quiet, state.late, state.first, state.rows = 0, 0, 0, 0, 0
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
    """Take in one tick and the samples that came with it; return whether every number of the state is finite.

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
    """Write what a tick does to the slip velocity, whatever that is: dv_ee - dt (G^T a_o + Phi2), and Phi1'; {ee}."""
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
    """Write what the law is given; return whether every number of the state is finite and its square is.

    That is the slip velocity, zero in stick, the error b + c f of `follow` at a specific force, and the variance.
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
