"""The hypothesis of stick: the slip velocity is zero at every tick, which teaches the filters the model's errors.

What the model says of the last ticks counts only once they have passed as stick. Were it taken in at once, the
beginning of a slip would be learnt as an error of the model.
"""

from __future__ import annotations

import math

from slip_core.compiled import part
from slip_core.records import Records
from slip_core.vectors import vec
from slip_vic_controller.contact.axis import (
    Axis,
    noisy_zero_velocity_update,
    put_axis,
    read_axis,
    zero_velocity_update,
)
from slip_vic_controller.contact.history import drop_oldest, next_sample, row_at
from slip_vic_controller.contact.layouts import AXES, Observer, ObserverConfig, Row
from slip_vic_controller.contact.slip import rerun, without_slip
from slip_vic_controller.law.contact import StampedSlip

SLOW_GROWTH = 0.13
"""Growth of a slip that is to show in the model [m/s^2]: what a slip at the limit of a weak grip begins with. Where the
window is shorter its beginning is learnt as an error of the model; slower slips are for the sensor to find."""


@part
def add_up(state: Observer, rows: Records[Row]) -> None:
    """Write dt, step and dt force, added up since the beginning of stick, to the last row."""
    row = row_at(state, rows, state.rows - 1)
    row.time = row.dt
    for i in range(AXES):
        row.steps[i], row.impulses[i] = row.step[i], row.dt * row.force[i]
    if state.rows > 1:
        last = row_at(state, rows, state.rows - 2)
        row.time += last.time
        for i in range(AXES):
            row.steps[i] += last.steps[i]
            row.impulses[i] += last.impulses[i]


@part
def window_ticks(config: ObserverConfig, row: Row) -> int:
    """Return over how many ticks slip must show in the model: noise of the pad's velocity is the same over any time.

    Over so many that a slip which grows by SLOW_GROWTH is beyond the noise of the first and the last velocity.
    """
    if config.longest_window_ticks == config.window_ticks or row.dt == 0.0:
        return int(config.window_ticks)
    variance = 2.0 * max(row.velocity_variance[0], row.velocity_variance[1], row.velocity_variance[2])
    wanted = math.sqrt(config.nis_slip * variance) / (SLOW_GROWTH * row.dt)
    return int(min(max(wanted, 1.0 * config.window_ticks), 1.0 * config.longest_window_ticks))


@part
def learn_model_errors(config: ObserverConfig, state: Observer, row: Row) -> None:
    """Learn the model's errors from a tick that has passed as stick."""
    for i in range(AXES):
        if config.axes[i]:
            x, q_v, q_b = read_axis(state.axes[i]), config.process_variance[i], config.drift_variance[i]
            if config.correlation_ticks > 0.0:
                noise, ticks = row.velocity_variance[i], config.correlation_ticks
                x = noisy_zero_velocity_update(x, row.step[i], row.force[i], row.dt, q_v, q_b, noise, ticks)
            else:
                q_v += row.change_variance[i]
                x = zero_velocity_update(x, row.step[i], row.force[i], row.dt, q_v, q_b)
            put_axis(state.axes[i], x)


@part
def normalised_innovation_squared(config: ObserverConfig, state: Observer, rows: Records[Row], begin: int) -> float:
    """Return v^T S^-1 v of the velocity that rows add up to from v = 0; chi-squared where there is no slip; [1].

    S: the variances that the model's errors and the process noise of these rows give it; begin: the first row.
    """
    first, last = row_at(state, rows, begin), row_at(state, rows, state.rows - 1)
    time = last.time - first.time + first.dt
    total = 0.0
    for i in range(AXES):
        if config.axes[i]:
            x = state.axes[i]
            impulse = last.impulses[i] - first.impulses[i] + first.dt * first.force[i]
            v = last.steps[i] - first.steps[i] + first.step[i] - time * x.b - impulse * x.c
            S = time * time * x.P_bb + 2.0 * time * impulse * x.P_bc + impulse * impulse * x.P_cc
            S += (state.rows - begin) * config.process_variance[i] + config.floor_variance[i]
            total += v * v / (S + first.velocity_variance[i] + last.velocity_variance[i])
    return total


@part
def variance_ratio_of_mean(config: ObserverConfig) -> float:
    """Return the variance of the weighted mean of samples over that of one sample; [1]."""
    return config.smoothing / (2.0 - config.smoothing)


@part
def average_and_test_samples(
    config: ObserverConfig, state: Observer, samples: Records[StampedSlip], count: int,
) -> int:  # fmt: skip
    """Take samples into the weighted mean, in their order; return the last one after which it was significant, or -1.

    One sample moves the mean no further than `most_step`, so an outlier alone is not significant.
    """
    share, most = variance_ratio_of_mean(config), config.most_step * math.sqrt(config.nis_slip)
    seen = -1
    k = -1
    for _ in range(count):
        k = next_sample(config, samples, count, k)
        if samples[k].stamp_ns > state.since_ns:
            step = 0.0
            for i in range(AXES):
                if config.axes[i]:
                    d = config.smoothing * (samples[k].twist[i] - state.sample_mean[i])
                    step += d * d / (share * config.measurement_variance[i])
            limit = most / math.sqrt(step) if step > most * most else 1.0
            total = 0.0
            for i in range(AXES):
                if config.axes[i]:
                    m = state.sample_mean[i]
                    m += limit * (config.smoothing * (samples[k].twist[i] - m))
                    state.sample_mean[i] = m
                    total += m * m / (share * config.measurement_variance[i])
            if total > config.nis_slip:
                seen = k
                if limit < 1.0:  # no outlier then, but a slip that lasts
                    for i in range(AXES):
                        if config.axes[i]:
                            state.sample_mean[i] = samples[k].twist[i]
    return seen


@part
def begin_slip_of_model(config: ObserverConfig, state: Observer, rows: Records[Row]) -> None:
    """Run the window as slip, with the doubt that a slip begins with: what was learnt holds for the forces of stick.

    Forces and torques come in other proportions now, so a wrong centre of mass shows in another way.
    """
    state.sliding = 1
    first, drag = row_at(state, rows, 0), vec(row_at(state, rows, state.rows - 1).drag).norm()
    for i in range(AXES):
        if config.axes[i]:
            deviation = config.onset_gain[i] * drag
            if config.correlation_ticks > 0.0:
                put_axis(state.axes[i], without_slip(read_axis(state.axes[i]), first.velocity_variance[i]))
            state.axes[i].P_bb += deviation * deviation
    rerun(config, state, rows, state.axes, 0)


@part
def begin_slip_of_samples(config: ObserverConfig, state: Observer, rows: Records[Row], stamp_ns: int) -> None:
    """Believe the samples: the model has missed a slip, so its errors are unknown again.

    The slip is that of the newest one's stamp, as far back as there are rows; the ticks since then are run as slip.
    Where samples are not dated only this tick's row stays.
    """
    state.sliding = 1
    while state.rows > 1 and (config.dates_samples == 0 or row_at(state, rows, 0).stamp_ns < stamp_ns):
        drop_oldest(state, rows)
    row, share = row_at(state, rows, 0), variance_ratio_of_mean(config)
    for i in range(AXES):
        if config.axes[i]:
            x, m = state.axes[i], state.sample_mean[i]
            P_vv = share * config.measurement_variance[i] + m * m
            y = Axis(m, x.b, x.c, P_vv, 0.0, 0.0, config.prior_P_bb[i], 0.0, config.prior_P_cc[i])
            put_axis(row.axes[i], y)
    rerun(config, state, rows, row.axes, 1)


@part
def observe_stick(
    config: ObserverConfig, state: Observer, rows: Records[Row], samples: Records[StampedSlip], count: int,
    likely: bool,
) -> None:  # fmt: skip
    """Learn from the tick that leaves the window, and test whether slip has begun; the tick's row is the last one.

    likely: whether slip is: then the model needs less evidence.
    """
    add_up(state, rows)
    window = window_ticks(config, row_at(state, rows, state.rows - 1))
    while state.rows > window:
        learn_model_errors(config, state, row_at(state, rows, 0))
        drop_oldest(state, rows)
    state.significance = normalised_innovation_squared(config, state, rows, 0)
    if state.rows > config.window_ticks:  # a fast slip shows in the newest ticks first, where errors add up to less
        newest = normalised_innovation_squared(config, state, rows, state.rows - config.window_ticks)
        state.significance = max(state.significance, newest)
    seen = average_and_test_samples(config, state, samples, count)
    if state.significance > (config.nis_likely if likely else config.nis_slip):
        begin_slip_of_model(config, state, rows)
    elif seen >= 0:
        begin_slip_of_samples(config, state, rows, samples[seen].stamp_ns)
