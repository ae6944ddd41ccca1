"""The hypothesis of slip: predict, correct samples at their own stamps, and find the end of the slip.

v_s[k+1] = v_s[k] + dv_ee - T (G^T a_o + Phi1' v_s + Phi2), with the model's errors b + c f taken out.
"""

from __future__ import annotations

import math

from slip_core.compiled import part
from slip_core.records import Records
from slip_core.vectors import NOTHING, Spatial, Vec, spatial, vec
from slip_vic_controller.contact.axis import (
    Axis,
    correct,
    correct_within,
    excess,
    forget_errors,
    predict,
    put_velocity,
)
from slip_vic_controller.contact.history import drop_oldest, place_samples, row_at
from slip_vic_controller.contact.layouts import WITNESSES, Observer, ObserverConfig, Row
from slip_vic_controller.law.contact import StampedSlip


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
def normalised_innovation_squared(config: ObserverConfig, state: Observer) -> float:
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
def drop_old_rows(config: ObserverConfig, state: Observer, rows: Records[Row]) -> None:
    """Drop rows older than the memory; one row stays."""
    while state.rows > 1 and row_at(state, rows, 0).stamp_ns < state.stamp_ns - config.memory_ns:
        drop_oldest(state, rows)


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
    state.significance = normalised_innovation_squared(config, state)
    at_rest = is_confirmed(config, state, row_at(state, rows, state.rows - 1)) and state.significance < config.nis_stick
    state.quiet = state.quiet + 1 if at_rest else 0
    if state.quiet >= config.dwell_ticks:
        begin_stick(config, state)
