"""Slip observer: the model predicts slip at control rate, sensor samples correct it at their own time stamps.

Two hypotheses share one filter per axis. In stick the slip velocity is zero at every tick, and that pseudo-measurement
teaches the filter the model's errors (wrench bias, wrong mass). In slip the velocity is free, and a sample with stamp t_m
corrects the estimate as it was at t_m; the ticks since then are run again. A significance test on the estimate and one on
the samples decide between the two, so that noise cannot open the gate.

On pad axes throughout; only the axes in which the contact can slip are filtered.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from slip_msgs_py.arrays import Array
from slip_msgs_py.types import SlipSample
from slip_vic_controller.core.slip_filter import AxisFilter, correct, predict, robust_variance

Floats = tuple[float, ...]


class ObserverConfig(NamedTuple):
    """Tuning of the observer; tuples are per filtered axis.

    axes: indices of the filtered axes, of 6; noise: variance of a sensor sample; force_noise: variance of v per tick from
    wrench noise and model; stick_noise: variance of the pseudo-measurement v = 0; floor: variance below which a slip
    velocity means nothing; prior_b, prior_c: variances of the model's errors; drift_b: variance that b gains per tick;
    dead_band: linear, angular; chi_on, chi_off: thresholds on the significance; dwell: ticks below chi_off until stick;
    memory_ns: how late a sample may be; smoothing: weight of a new sample in the mean that is tested; outlier: deviations.
    """

    axes: tuple[int, ...]
    noise: Floats
    force_noise: Floats
    stick_noise: Floats
    floor: Floats
    prior_b: Floats
    prior_c: Floats
    drift_b: Floats
    dead_band: tuple[float, float]
    chi_on: float
    chi_off: float
    dwell: int
    memory_ns: int
    smoothing: float
    outlier: float


class Sample(NamedTuple):
    """A sensor sample on the filtered axes."""

    stamp_ns: int
    values: Floats


class Moment(NamedTuple):
    """One tick in slip: what led to it, the samples measured at it, and the estimate with them taken in."""

    stamp_ns: int
    dt: float
    step: Floats
    turn_linear: Floats
    turn_angular: Floats
    force: Floats
    samples: tuple[Sample, ...]
    estimate: tuple[AxisFilter, ...]


class ObserverState(NamedTuple):
    """What the observer remembers. twist (6,) {w}: of {ee} at the last tick; mean: of the samples, weighted.

    quiet: ticks in a row without significant slip; late: samples that came too late to be used.
    """

    stamp_ns: int
    sliding: bool
    estimate: tuple[AxisFilter, ...]
    twist: Array
    mean: Floats
    quiet: int
    history: tuple[Moment, ...]
    newest_ns: int
    late: int


class Motion(NamedTuple):
    """What a tick tells the observer; (6,) unless said otherwise.

    stamp_ns; R_ee (3, 3); v_ee {w}; follow: G^T a_o + Phi2 from the wrench [m/s^2, rad/s^2] {w}; force: the part of it
    that the wrench gives, without gravity {w}; w_o (3,) [rad/s] {w}.
    """

    stamp_ns: int
    R_ee: Array
    v_ee: Array
    follow: Array
    force: Array
    w_o: Array


class SlipEstimate(NamedTuple):
    """twist (6,): significant slip velocity, zero in stick; error (6,): of `follow`; variance (6,): of twist; {ee} axes.

    significance: v^T P^-1 v, to be compared with chi_on; sliding: which hypothesis holds.
    """

    twist: Array
    error: Array
    variance: Array
    significance: float
    sliding: bool


def initial_observer(config: ObserverConfig, stamp_ns: int, v_ee: Array) -> ObserverState:
    """Return the state before the first tick: stick, model errors unknown; v_ee (6,) {w}.

    Implements: ours: a grasp begins without slip.
    """
    estimate = tuple(
        AxisFilter(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, b, 0.0, c)
        for b, c in zip(config.prior_b, config.prior_c, strict=True)
    )
    zero = (0.0,) * len(config.axes)
    return ObserverState(stamp_ns, False, estimate, v_ee, zero, 0, (), -(2**63), 0)


def observe(
    config: ObserverConfig, state: ObserverState, motion: Motion, samples: Sequence[SlipSample]
) -> tuple[ObserverState, SlipEstimate]:
    """Take in one tick and the samples that came with it, in any order; return the next state and the estimate.

    Implements: ours: v_s[k+1] = v_s[k] + dv_ee - T (G^T a_o + Phi1' v_s + Phi2), corrected at the samples' stamps.
    """
    moment = _predict(config, state, motion)
    fresh = sorted(
        (Sample(s.stamp_ns, tuple(s.twist[list(config.axes)].tolist())) for s in samples if s.valid),
        key=lambda sample: sample.stamp_ns,
    )
    mean, newest = _mean(config, state, fresh)
    late = state.late
    if not state.sliding:
        estimate = tuple(
            correct(x, 0.0, variance) for x, variance in zip(moment.estimate, config.stick_noise, strict=True)
        )
        history: tuple[Moment, ...] = ()
    else:
        oldest = motion.stamp_ns - config.memory_ns
        first = next((i for i, m in enumerate(state.history) if m.stamp_ns >= oldest), 0)
        history = (*state.history[first:], moment)
        usable = [s for s in fresh if s.stamp_ns > history[0].stamp_ns]
        late += len(fresh) - len(usable)
        if usable:
            history = _replay(config, history, usable)
        estimate = history[-1].estimate
    significance = _significance(estimate, config.floor)
    seen = bool(fresh) and _seen(config, mean)
    sliding, quiet = state.sliding, 0
    if not sliding and (significance > config.chi_on or seen):
        sliding = True
        if significance <= config.chi_on:
            estimate = _restart(config, estimate, mean)
        history = (moment._replace(samples=(), estimate=estimate),)
    elif sliding and significance < config.chi_off and not _seen(config, mean):
        quiet = state.quiet + 1
        if quiet >= config.dwell:
            sliding, quiet, history = False, 0, ()
            estimate = tuple(
                correct(x, 0.0, floor) for x, floor in zip(estimate, config.floor, strict=True)
            )
    following = ObserverState(
        motion.stamp_ns, sliding, estimate, motion.v_ee, mean, quiet, history, newest, late
    )
    return following, _estimate(config, following, moment.force, significance)


def _predict(config: ObserverConfig, state: ObserverState, motion: Motion) -> Moment:
    """Return this tick with the estimate before any correction."""
    dt = (motion.stamp_ns - state.stamp_ns) * 1e-9
    R = motion.R_ee
    change = (((motion.v_ee - state.twist) - dt * motion.follow).reshape(2, 3) @ R).ravel().tolist()
    force_pad = (motion.force.reshape(2, 3) @ R).ravel().tolist()
    w_ee, w_o = (R.T @ motion.v_ee[3:]).tolist(), (R.T @ motion.w_o).tolist()
    turn_linear = tuple(a + 2.0 * b for a, b in zip(w_ee, w_o, strict=True))
    turn_angular = tuple(a + b for a, b in zip(w_ee, w_o, strict=True))
    step = tuple(change[i] for i in config.axes)
    force = tuple(force_pad[i] for i in config.axes)
    moment = Moment(motion.stamp_ns, dt, step, turn_linear, turn_angular, force, (), state.estimate)
    return moment._replace(estimate=_advance(config, moment, state.estimate))


def _advance(config: ObserverConfig, m: Moment, before: tuple[AxisFilter, ...]) -> tuple[AxisFilter, ...]:
    turning = _turning(config.axes, before, m.turn_linear, m.turn_angular)
    return tuple(
        predict(x, step - m.dt * turn, f, m.dt, q_v, q_b)
        for x, step, turn, f, q_v, q_b in zip(
            before, m.step, turning, m.force, config.force_noise, config.drift_b, strict=True
        )
    )


def _turning(axes: tuple[int, ...], estimate: tuple[AxisFilter, ...], linear: Floats, angular: Floats) -> Floats:
    """Return (w_ee x + Phi1') v_s on the filtered axes: what turning axes and Coriolis take from the slip velocity."""
    v = [0.0] * 6
    for i, x in zip(axes, estimate, strict=True):
        v[i] = x.v
    (a, b, c), (d, e, f) = linear, angular
    cross = (
        b * v[2] - c * v[1],
        c * v[0] - a * v[2],
        a * v[1] - b * v[0],
        e * v[5] - f * v[4],
        f * v[3] - d * v[5],
        d * v[4] - e * v[3],
    )
    return tuple(cross[i] for i in axes)


def _replay(config: ObserverConfig, history: tuple[Moment, ...], samples: list[Sample]) -> tuple[Moment, ...]:
    """Put the samples where they belong and run the ticks from the first of them again."""
    moments = list(history)
    first = len(moments)
    for sample in samples:
        index = next(i for i, m in enumerate(moments) if m.stamp_ns >= sample.stamp_ns)
        known = moments[index].samples
        moments[index] = moments[index]._replace(samples=tuple(sorted((*known, sample))))
        first = min(first, index)
    for index in range(first, len(moments)):
        m = moments[index]
        # The first moment has nothing before it: its own estimate is what it starts from.
        before = m.estimate if index == 0 else _advance(config, m, moments[index - 1].estimate)
        for sample in m.samples:
            before = _correct(config, before, sample)
        moments[index] = m._replace(estimate=before)
    return tuple(moments)


def _correct(config: ObserverConfig, estimate: tuple[AxisFilter, ...], sample: Sample) -> tuple[AxisFilter, ...]:
    measured = _outside_dead_band(config, estimate, sample.values)
    return tuple(
        x if z is None else correct(x, z, robust_variance(x, z, R, config.outlier))
        for x, z, R in zip(estimate, measured, config.noise, strict=True)
    )


def _outside_dead_band(
    config: ObserverConfig, estimate: tuple[AxisFilter, ...], values: Floats
) -> list[float | None]:
    """Return what a sample says: zeros from a dead band say only that the speed is below it."""
    out: list[float | None] = list(values)
    for half, band in enumerate(config.dead_band):
        members = [k for k, i in enumerate(config.axes) if i // 3 == half]
        if band == 0.0 or any(values[k] for k in members):
            continue
        speed = math.sqrt(sum(estimate[k].v ** 2 for k in members))
        for k in members:
            out[k] = None if speed <= band else estimate[k].v * band / speed
    return out


def _mean(config: ObserverConfig, state: ObserverState, fresh: list[Sample]) -> tuple[Floats, int]:
    mean, newest, weight = state.mean, state.newest_ns, config.smoothing
    for sample in fresh:
        newest = max(newest, sample.stamp_ns)
        mean = tuple(m + weight * (value - m) for m, value in zip(mean, sample.values, strict=True))
    return mean, newest


def _seen(config: ObserverConfig, mean: Floats) -> bool:
    share = config.smoothing / (2.0 - config.smoothing)  # variance of the weighted mean over that of a sample
    return sum(m * m / (share * R) for m, R in zip(mean, config.noise, strict=True)) > config.chi_on


def _significance(estimate: tuple[AxisFilter, ...], floor: Floats) -> float:
    return sum(x.v * x.v / (x.P_vv + least) for x, least in zip(estimate, floor, strict=True))


def _restart(
    config: ObserverConfig, estimate: tuple[AxisFilter, ...], mean: Floats
) -> tuple[AxisFilter, ...]:
    """Return an estimate that believes the samples: the model has missed a slip, so its errors are unknown again."""
    share = config.smoothing / (2.0 - config.smoothing)
    return tuple(
        AxisFilter(m, x.b, x.c, share * R + m * m, 0.0, 0.0, b, 0.0, c)
        for x, m, R, b, c in zip(estimate, mean, config.noise, config.prior_b, config.prior_c, strict=True)
    )


def _estimate(config: ObserverConfig, state: ObserverState, force: Floats, significance: float) -> SlipEstimate:
    twist, error, variance = np.zeros(6), np.zeros(6), np.zeros(6)
    for i, x, f in zip(config.axes, state.estimate, force, strict=True):
        if state.sliding:
            twist[i] = x.v
        error[i] = x.b + x.c * f
        variance[i] = x.P_vv
    return SlipEstimate(twist, error, variance, significance, state.sliding)
