"""The hypothesis of stick: the slip velocity is zero at every tick, which teaches the filters the model's errors.

What the model says of the last ticks counts only once they have passed as stick. Were it taken in at once, the
beginning of a slip would be learnt as an error of the model.
"""

from __future__ import annotations

import math

from slip_core.compiled import part
from slip_core.records import Records
from slip_core.vectors import put_spatial, spatial, vec
from slip_vic_controller.contact.axis import correct, forget_errors, predict, put_velocity
from slip_vic_controller.contact.history import drop_oldest, row_at
from slip_vic_controller.contact.layouts import Observer, ObserverConfig, Row
from slip_vic_controller.contact.slip import rerun
from slip_vic_controller.law.contact import StampedSlip


@part
def learn_model_errors(config: ObserverConfig, state: Observer, row: Row) -> None:
    """Learn the model's errors from a tick that has passed as stick: the velocity that they predict was zero."""
    for i in range(6):
        if config.axes[i]:
            x, q_v = state.axes[i], config.process_variance[i] + row.change_variance[i]
            predict(x, row.step[i], row.force[i], row.dt, q_v, config.drift_variance[i])
            correct(x, 0.0, 0.0)


@part
def normalised_innovation_squared(config: ObserverConfig, state: Observer, rows: Records[Row]) -> float:
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
    state.significance = normalised_innovation_squared(config, state, rows)
    seen = average_and_test_samples(config, state, samples, count)
    if state.significance > config.nis_slip:
        begin_slip_of_model(config, state, rows)
    elif seen:
        begin_slip_of_samples(config, state, rows)
