"""The hypothesis of slip: predict, correct samples at their own stamps, and find the end of the slip.

v_s[k+1] = v_s[k] + dv_ee - T (G^T a_o + Phi1' v_s + Phi2), with the model's errors b + c f taken out.
"""

from __future__ import annotations

import math

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.records import Records
from slip_core.vectors import Spatial, Vec, vec
from slip_vic_controller.contact.axis import (
    Axis,
    AxisRecord,
    contradicts,
    correct,
    correct_within,
    predict,
    put_axis,
    read_axis,
    robust_variance,
)
from slip_vic_controller.contact.history import drop_oldest, insert, newest_tick, row_at
from slip_vic_controller.contact.layouts import AXES, SAMPLE_ROW, TICK_ROW, Observer, ObserverConfig, Row
from slip_vic_controller.law.contact import StampedSlip

LEAST_SHARE = 1e-3
"""Share of an axis across the friction force below which the direction does not constrain it."""
LASTING = 3
"""Samples in a row that contradict the estimate: then it is the model that is wrong, and no outliers."""


@part
def component(s: Spatial, i: int) -> float:
    """Return one of six components."""
    return s.linear[i] if i < 3 else s.angular[i - 3]


@part
def slip_velocity(axes: Records[AxisRecord]) -> Spatial:
    """Return the estimated slip velocity; [m/s, rad/s] {ee}."""
    return Spatial(Vec(axes[0].v, axes[1].v, axes[2].v), Vec(axes[3].v, axes[4].v, axes[5].v))


@part
def predict_tick(config: ObserverConfig, ahead: Records[AxisRecord], row: Row) -> None:
    """Predict the estimate `ahead` of a tick over it.

    step - dt (w_ee x + Phi1') v_s: turning axes and Coriolis take from the slip velocity what they turn it by.
    """
    v = slip_velocity(ahead)
    turning = Spatial(vec(row.turn_linear).cross(v.linear), vec(row.turn_angular).cross(v.angular))
    for i in range(AXES):
        if config.axes[i]:
            step = row.step[i] - row.dt * component(turning, i)
            q_v, q_b = config.process_variance[i] + row.change_variance[i], config.drift_variance[i]
            put_axis(row.axes[i], predict(read_axis(ahead[i]), step, row.force[i], row.dt, q_v, q_b))


@part
def friction_direction_update(config: ObserverConfig, row: Row) -> None:
    """Take in that friction opposes slip: the pad slides over the object in the direction d in which it drags it.

    v is corrected towards (v.d)+ d / d^2 with d = drag + b + c f, where the axis is not along d. The friction
    coefficient does not matter. The correction is weak, because pads are not alike in all directions.
    """
    if config.friction_spread == 0.0:
        return
    axes = row.axes
    x, y, z = axes[0], axes[1], axes[2]
    v, b = Vec(x.v, y.v, z.v), Vec(x.b, y.b, z.b)
    d = vec(row.drag) + b + Vec(x.c * row.force[0], y.c * row.force[1], z.c * row.force[2])
    square = d.dot(d)
    if square == 0.0:
        return
    along = v.dot(d) / square
    spread = config.friction_spread * v.norm()
    for i in range(3):
        if config.axes[i]:
            # Where the direction is possible nothing is said of the speed along it: only the share across counts.
            across = 1.0 - d[i] * d[i] / square if along > 0.0 else 1.0
            if across > LEAST_SHARE:
                R = config.friction_memory_ticks * (spread * spread + config.floor_variance[i]) / across
                put_axis(axes[i], correct(read_axis(axes[i]), max(along, 0.0) * d[i], R))


@part
def reads_within(config: ObserverConfig, sample: StampedSlip, i: int) -> float:
    """Return the dead band in which an axis of a sample lies, 0 where the sample reads a number."""
    first = 0 if i < 3 else 3
    reads = sample.twist
    size = abs(reads[first]) + abs(reads[first + 1]) + abs(reads[first + 2])
    return config.dead_band[i] if size == 0.0 else 0.0


@part
def correct_sample(config: ObserverConfig, ahead: Records[AxisRecord], row: Row) -> None:
    """Correct with the sample of a row; a part that reads zero is only known to lie within the dead band."""
    row.contradicts = 0
    for i in range(AXES):
        if config.axes[i]:
            x, z, R = read_axis(ahead[i]), row.sample.twist[i], config.measurement_variance[i]
            band, limit = reads_within(config, row.sample, i), config.outlier_deviations
            if contradicts(x, z, R, limit, band):
                row.contradicts = 1
            x = correct_within(x, band, R) if band > 0.0 else correct(x, z, robust_variance(x, z, R, limit))
            put_axis(row.axes[i], x)


@part
def rerun(config: ObserverConfig, state: Observer, rows: Records[Row], ahead: Records[AxisRecord], first: int) -> None:
    """Run the rows from number `first` on, again or for the first time; `ahead`: the filters before it."""
    for i in range(first, state.rows):
        row = row_at(state, rows, i)
        if row.kind == TICK_ROW:
            predict_tick(config, ahead, row)
            friction_direction_update(config, row)
        else:
            correct_sample(config, ahead, row)
        ahead = row.axes
    for i in range(AXES):
        if config.axes[i]:
            put_axis(state.axes[i], read_axis(ahead[i]))


@part
def normalised_innovation_squared(config: ObserverConfig, state: Observer) -> float:
    """Return v^T P^-1 v of the estimate against v = 0, chi-squared where there is no slip; [1]."""
    total = 0.0
    for i in range(AXES):
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
    for i in range(AXES):
        if config.axes[i]:
            x = state.axes[i]
            # Noise of the joints leaves this much doubt, however long it is at rest.
            noise, time = row.velocity_variance[i], config.window_ticks * row.dt
            doubt = noise + math.sqrt(row.change_variance[i] * config.measurement_variance[i])
            confirmed = confirmed and x.P_vv < config.stick_P_vv[i] + doubt
            if noise > 0.0:
                # Of b and c apart little is known where the force is steady: what counts is b + c f.
                f = row.force[i]
                P_error = x.P_bb + 2.0 * f * x.P_bc + f * f * x.P_cc
                confirmed = confirmed and P_error * time * time < config.stick_P_bb[i] * time * time + 2.0 * noise
            else:
                confirmed = confirmed and x.P_bb < config.stick_P_bb[i]
    return confirmed


@part
def begin_stick(config: ObserverConfig, state: Observer) -> None:
    """End the slip: v = 0 exactly; what was learnt of the model's errors stays."""
    state.sliding, state.quiet, state.since_ns = 0, 0, state.stamp_ns
    state.first, state.rows = 0, 0
    for i in range(AXES):
        if config.axes[i]:
            state.sample_mean[i] = 0.0
            x = correct(read_axis(state.axes[i]), 0.0, config.floor_variance[i])
            put_axis(state.axes[i], Axis(0.0, x.b, x.c, 0.0, 0.0, 0.0, x.P_bb, x.P_bc, x.P_cc))


@part
def drop_old_rows(config: ObserverConfig, state: Observer, rows: Records[Row], count: int) -> None:
    """Drop rows older than the memory, and more where a tick and `count` samples would find no room; one row stays."""
    oldest_ns = state.stamp_ns - config.memory_ns
    while state.rows > 1 and (row_at(state, rows, 0).stamp_ns < oldest_ns or state.rows + 1 + count > len(rows)):
        drop_oldest(state, rows)


@part
def place_samples(
    config: ObserverConfig, state: Observer, history: Array, rows: Records[Row], samples: Records[StampedSlip],
    count: int,
) -> int:  # fmt: skip
    """Put out-of-sequence samples at the ticks at which they were measured; return the first row that is new."""
    oldest_ns, first = row_at(state, rows, 0).stamp_ns, state.rows - 1
    for k in range(count):
        if samples[k].stamp_ns > oldest_ns and state.rows < len(rows):
            first = min(first, insert(config, state, history, rows, samples[k]))
        else:
            state.late += 1
    return first


@part
def contradicted_since(state: Observer, rows: Records[Row]) -> int:
    """Return the number of the row of the first of LASTING newest samples that all contradict the estimate, else -1."""
    count, i = 0, state.rows
    while i > 0 and count < LASTING:
        i -= 1
        row = row_at(state, rows, i)
        if row.kind == SAMPLE_ROW:
            if row.contradicts == 0:
                return -1
            count += 1
    return i if count == LASTING else -1


@part
def samples_show_rest(config: ObserverConfig, state: Observer, rows: Records[Row], first: int) -> bool:
    """Return whether the mean of the samples from row `first` on is insignificant against v = 0."""
    total = 0.0
    for i in range(AXES):
        if config.axes[i]:
            added, n = 0.0, 0
            for k in range(first, state.rows):
                row = row_at(state, rows, k)
                if row.kind == SAMPLE_ROW:
                    added, n = added + row.sample.twist[i], n + 1
            total += added * added / (n * config.measurement_variance[i])
    return total < config.nis_slip


@part
def restart_from_samples(config: ObserverConfig, state: Observer, rows: Records[Row], first: int) -> None:
    """Begin again at the sample of row `first`: the model's errors are as unknown as in the beginning.

    A filter that is sure of a wrong model takes every sample for an outlier, and so would never come back.
    """
    for _ in range(first):
        drop_oldest(state, rows)
    row = row_at(state, rows, 0)
    for i in range(AXES):
        if config.axes[i]:
            x, band = row.axes[i], reads_within(config, row.sample, i)
            P_vv = config.measurement_variance[i] + band * band
            y = Axis(row.sample.twist[i], x.b, x.c, P_vv, 0.0, 0.0, config.prior_P_bb[i], 0.0, config.prior_P_cc[i])
            put_axis(row.axes[i], y)
    rerun(config, state, rows, row.axes, 1)


@part
def begin_stick_from_samples(config: ObserverConfig, state: Observer) -> None:
    """End a slip that the samples never saw, the model's errors as unknown as in the beginning."""
    begin_stick(config, state)
    for i in range(AXES):
        if config.axes[i]:
            x = state.axes[i]
            P_bb, P_cc = config.prior_P_bb[i], config.prior_P_cc[i]
            put_axis(state.axes[i], Axis(0.0, x.b, x.c, 0.0, 0.0, 0.0, P_bb, 0.0, P_cc))


@part
def observe_slip(
    config: ObserverConfig, state: Observer, history: Array, rows: Records[Row], samples: Records[StampedSlip],
    count: int,
) -> None:  # fmt: skip
    """Predict, correct, and test whether the slip is over, or never was; the tick's row is the last one of a tick."""
    first = place_samples(config, state, history, rows, samples, count)
    rerun(config, state, rows, row_at(state, rows, first - 1).axes, first)
    since = contradicted_since(state, rows) if count > 0 else -1
    if since >= 0 and samples_show_rest(config, state, rows, since):
        begin_stick_from_samples(config, state)
        return
    if since >= 0:
        restart_from_samples(config, state, rows, since)
    state.significance = normalised_innovation_squared(config, state)
    newest = row_at(state, rows, newest_tick(state, rows))
    at_rest = is_confirmed(config, state, newest) and state.significance < config.nis_stick
    state.quiet = state.quiet + 1 if at_rest else 0
    if state.quiet >= config.dwell_ticks:
        begin_stick(config, state)
