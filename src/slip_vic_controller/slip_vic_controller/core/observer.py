"""Slip observer: the model predicts slip at control rate, sensor samples correct it at their own time stamps.

Two hypotheses share one filter per axis. In stick the slip velocity is zero at every tick, which teaches the filter the
model's errors (wrench bias, wrong mass). In slip the velocity is free, and a sample of stamp t_m corrects the estimate
as it was at t_m; the ticks since then are run again. A significance test on what the model says and one on the samples
decide between the two, so that noise cannot open the gate.

On pad axes throughout; only the axes in which the contact can slip are filtered.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from slip_msgs_py.arrays import Array
from slip_msgs_py.types import SlipSample
from slip_vic_controller.core.slip_filter import AxisFilter, correct, correct_within, learn, predict, robust_variance

Floats = tuple[float, ...]


class ObserverConfig(NamedTuple):
    """Tuning of the observer; tuples are per filtered axis.

    axes: indices of the filtered axes, of 6; noise: variance of a sensor sample; force_noise: variance of v per tick
    from wrench noise and model; floor: variance below which a slip velocity means nothing; rest: variance of b above
    which nothing is taken for rest; prior_b, prior_c: variances of the model's errors; drift_b: variance that b gains
    per tick; onset_b: deviation that b gains when slip begins, per acceleration of the object [1, 1/m];
    dead_band: linear, angular; chi_on, chi_off: thresholds on the significance; dwell: ticks below chi_off until stick;
    memory_ns: how late a sample may be; smoothing: weight of a new sample in the mean that is tested; window: ticks
    over which slip must show in the model; outlier: deviations.
    """

    axes: tuple[int, ...]
    noise: Floats
    force_noise: Floats
    floor: Floats
    rest: Floats
    prior_b: Floats
    prior_c: Floats
    drift_b: Floats
    onset_b: Floats
    dead_band: tuple[float, float]
    chi_on: float
    chi_off: float
    dwell: int
    memory_ns: int
    smoothing: float
    window: int
    outlier: float
    drag_spread: float
    drag_memory: float


class Sample(NamedTuple):
    """A sensor sample on the filtered axes."""

    stamp_ns: int
    values: Floats


class Moment(NamedTuple):
    """One tick: what it did to the slip velocity, the samples measured at it, and in slip the estimate with them.

    time, steps, impulses: dt, step and dt force added up since the last change between stick and slip.
    """

    stamp_ns: int
    dt: float
    time: float
    steps: Floats
    impulses: Floats
    step: Floats
    turn_linear: Floats
    turn_angular: Floats
    force: Floats
    drag: Floats
    samples: tuple[Sample, ...]
    estimate: tuple[AxisFilter, ...]


class ObserverState(NamedTuple):
    """What the observer remembers. twist (6,) {w}: of {ee} at the last tick; mean: of the samples that were
    measured in stick, after since_ns, weighted;

    quiet: ticks in a row without significant slip; late: samples that came too late to be used.
    """

    stamp_ns: int
    sliding: bool
    estimate: tuple[AxisFilter, ...]
    twist: Array
    mean: Floats
    since_ns: int
    quiet: int
    history: tuple[Moment, ...]
    late: int


class Motion(NamedTuple):
    """What a tick tells the observer; (6,) unless said otherwise.

    stamp_ns; R_ee (3, 3); v_ee {w}; follow: G^T a_o + Phi2 from the wrench [m/s^2, rad/s^2] {w}; force: the part of it
    that the wrench gives, without gravity {w};
    drag (3,): acceleration that the pad gives to the centre of mass [m/s^2] {w}; w_o (3,) [rad/s] {w}.
    """

    stamp_ns: int
    R_ee: Array
    v_ee: Array
    follow: Array
    force: Array
    drag: Array
    w_o: Array


class SlipEstimate(NamedTuple):
    """twist (6,): significant slip velocity, zero in stick; error (6,): of `follow`; variance (6,): of twist; on {ee}.

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
        AxisFilter(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, b, 0.0, c) for b, c in zip(config.prior_b, config.prior_c, strict=True)
    )
    zero = (0.0,) * len(config.axes)
    return ObserverState(stamp_ns, False, estimate, v_ee, zero, stamp_ns, 0, (), 0)


def observe(
    config: ObserverConfig, state: ObserverState, motion: Motion, samples: Sequence[SlipSample]
) -> tuple[ObserverState, SlipEstimate]:
    """Take in one tick and the samples that came with it, in any order; return the next state and the estimate.

    Implements: ours: v_s[k+1] = v_s[k] + dv_ee - T (G^T a_o + Phi1' v_s + Phi2), corrected at the samples' stamps.
    """
    fresh = sorted(Sample(s.stamp_ns, tuple(s.twist[list(config.axes)].tolist())) for s in samples if s.valid)
    moment = _moment(config, state, motion)
    state = state._replace(stamp_ns=motion.stamp_ns, twist=motion.v_ee)
    state, significance = (_in_slip if state.sliding else _in_stick)(config, state, moment, fresh)
    return state, _estimate(config, state, moment.force, significance)


def last_twist(config: ObserverConfig, state: ObserverState) -> Array:
    """Return the slip velocity of the last tick as the law was given it; (6,) [m/s, rad/s] {ee}.

    Implements: ours: what the next prediction starts from.
    """
    twist = np.zeros(6)
    if state.sliding:
        for i, x in zip(config.axes, state.estimate, strict=True):
            twist[i] = x.v
    return twist


def _in_stick(
    config: ObserverConfig, state: ObserverState, moment: Moment, fresh: list[Sample]
) -> tuple[ObserverState, float]:
    """Test whether slip has begun. What the model says of the last ticks counts only once they have passed as stick.

    Were it taken in at once, the beginning of a slip would be learnt as an error of the model.
    """
    window, known = (*state.history, moment), state.estimate
    if len(window) > config.window:
        oldest, window = window[0], window[1:]
        known = tuple(
            learn(x, step, f, oldest.dt, q_v, q_b)
            for x, step, f, q_v, q_b in zip(
                known, oldest.step, oldest.force, config.force_noise, config.drift_b, strict=True
            )
        )
    significance = _window_significance(config, window, known)
    mean, seen = _listen(config, state.mean, [s for s in fresh if s.stamp_ns > state.since_ns])
    if significance > config.chi_on:
        history = _run(config, window, 0, _unsettled(config, known, moment))
        return state._replace(sliding=True, estimate=history[-1].estimate, history=history, mean=mean), significance
    if seen:
        known = _restart(config, known, mean)
        history = (moment._replace(estimate=known),)
        return state._replace(sliding=True, estimate=known, history=history, mean=mean), significance
    return state._replace(estimate=known, history=window, mean=mean), significance


def _unsettled(config: ObserverConfig, known: tuple[AxisFilter, ...], moment: Moment) -> tuple[AxisFilter, ...]:
    """Return the estimate with the doubt that a slip begins with: what was learnt holds for the forces of stick.

    Forces and torques come in other proportions now, so a wrong centre of mass shows in another way.
    """
    force = math.sqrt(sum(f * f for f in moment.drag))
    return tuple(x._replace(P_bb=x.P_bb + (gain * force) ** 2) for x, gain in zip(known, config.onset_b, strict=True))


def _in_slip(
    config: ObserverConfig, state: ObserverState, moment: Moment, fresh: list[Sample]
) -> tuple[ObserverState, float]:
    """Predict, correct, and test whether the slip is over."""
    oldest = moment.stamp_ns - config.memory_ns
    keep = next((i for i, m in enumerate(state.history) if m.stamp_ns >= oldest), len(state.history) - 1)
    history = (*state.history[keep:], moment)
    usable = [s for s in fresh if s.stamp_ns > history[0].stamp_ns]
    first = len(history) - 1
    if usable:
        history, first = _insert(history, usable)
    history = _run(config, history, first, history[first - 1].estimate)
    estimate = history[-1].estimate
    late = state.late + len(fresh) - len(usable)
    significance = _significance(estimate, config.floor)
    # Doubt is not rest: control holds the estimate near zero, so only a model that has been confirmed can tell.
    known = all(x.P_bb < most for x, most in zip(estimate, config.rest, strict=True))
    quiet = state.quiet + 1 if known and significance < config.chi_off else 0
    if quiet < config.dwell:
        return state._replace(estimate=estimate, history=history, quiet=quiet, late=late), significance
    rest = tuple(correct(x, 0.0, floor) for x, floor in zip(estimate, config.floor, strict=True))
    rest = tuple(x._replace(v=0.0, P_vv=0.0, P_vb=0.0, P_vc=0.0) for x in rest)
    zero = (0.0,) * len(rest)
    return ObserverState(moment.stamp_ns, False, rest, state.twist, zero, moment.stamp_ns, 0, (), late), significance


def _moment(config: ObserverConfig, state: ObserverState, motion: Motion) -> Moment:
    """Return what this tick does to the slip velocity, whatever that is; the estimate is filled in later."""
    dt = (motion.stamp_ns - state.stamp_ns) * 1e-9
    R = motion.R_ee
    change = (((motion.v_ee - state.twist) - dt * motion.follow).reshape(2, 3) @ R).ravel().tolist()
    force_pad = (motion.force.reshape(2, 3) @ R).ravel().tolist()
    w_ee, w_o = (R.T @ motion.v_ee[3:]).tolist(), (R.T @ motion.w_o).tolist()
    turn_linear = tuple(a + 2.0 * b for a, b in zip(w_ee, w_o, strict=True))
    turn_angular = tuple(a + b for a, b in zip(w_ee, w_o, strict=True))
    step = tuple(change[i] for i in config.axes)
    force = tuple(force_pad[i] for i in config.axes)
    drag_pad = (motion.drag @ R).tolist()
    drag = tuple(drag_pad[i] for i in config.axes if i < 3)
    time, steps, impulses = dt, step, tuple(dt * f for f in force)
    if state.history:
        last = state.history[-1]
        time += last.time
        steps = tuple(a + b for a, b in zip(last.steps, steps, strict=True))
        impulses = tuple(a + b for a, b in zip(last.impulses, impulses, strict=True))
    return Moment(
        motion.stamp_ns, dt, time, steps, impulses, step, turn_linear, turn_angular, force, drag, (), ()
    )  # fmt: skip


def _window_significance(config: ObserverConfig, window: tuple[Moment, ...], known: tuple[AxisFilter, ...]) -> float:
    """Return the significance of the velocity that the window adds up to, from v = 0 at its beginning."""
    first, last = window[0], window[-1]
    time = last.time - first.time + first.dt
    total = 0.0
    for k, (x, q_v, floor) in enumerate(zip(known, config.force_noise, config.floor, strict=True)):
        impulse = last.impulses[k] - first.impulses[k] + first.dt * first.force[k]
        v = last.steps[k] - first.steps[k] + first.step[k] - time * x.b - impulse * x.c
        variance = time * time * x.P_bb + 2.0 * time * impulse * x.P_bc + impulse * impulse * x.P_cc
        total += v * v / (variance + len(window) * q_v + floor)
    return total


def _advance(config: ObserverConfig, m: Moment, before: tuple[AxisFilter, ...]) -> tuple[AxisFilter, ...]:
    turning = _turning(config.axes, before, m.turn_linear, m.turn_angular)
    return tuple(
        predict(x, step - m.dt * turn, f, m.dt, q_v, q_b)
        for x, step, turn, f, q_v, q_b in zip(
            before, m.step, turning, m.force, config.force_noise, config.drift_b, strict=True
        )
    )


def _opposed(config: ObserverConfig, m: Moment, estimate: tuple[AxisFilter, ...]) -> tuple[AxisFilter, ...]:
    """Take in that friction opposes slip: the pad slides over the object in the direction in which it drags it.

    The friction coefficient does not matter. Where the estimate says otherwise it is pulled to the nearest velocity
    that fits, weakly, because pads are not alike in all directions.
    """
    count = len(m.drag)
    if count == 0 or config.drag_spread == 0.0:
        return estimate
    v = [x.v for x in estimate[:count]]
    d = [drag + x.b + x.c * f for drag, x, f in zip(m.drag, estimate, m.force, strict=False)]
    square = sum(a * a for a in d)
    if square == 0.0:
        return estimate
    along = sum(a * b for a, b in zip(v, d, strict=True)) / square
    spread = (config.drag_spread * math.sqrt(sum(a * a for a in v))) ** 2
    out = list(estimate)
    for k in range(count):
        # Where the direction is possible nothing is said of the speed along it: only the share across counts.
        across = 1.0 - d[k] * d[k] / square if along > 0.0 else 1.0
        if across > _LEAST_SHARE:
            variance = config.drag_memory * (spread + config.floor[k]) / across
            out[k] = correct(estimate[k], max(along, 0.0) * d[k], variance)
    return tuple(out)


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


def _insert(history: tuple[Moment, ...], samples: list[Sample]) -> tuple[tuple[Moment, ...], int]:
    """Put the samples at the first tick not before their stamps; return the history and the first tick that changed."""
    moments, first = list(history), len(history)
    for sample in samples:
        index = len(moments) - 1  # most samples are young
        while index > 0 and moments[index - 1].stamp_ns >= sample.stamp_ns:
            index -= 1
        moments[index] = moments[index]._replace(samples=tuple(sorted((*moments[index].samples, sample))))
        first = min(first, index)
    return tuple(moments), first


def _run(
    config: ObserverConfig, history: tuple[Moment, ...], first: int, before: tuple[AxisFilter, ...]
) -> tuple[Moment, ...]:
    """Run the ticks from number `first` on, again or for the first time; `before` is the estimate ahead of it."""
    done = []
    for m in history[first:]:
        before = _opposed(config, m, _advance(config, m, before))
        for sample in m.samples:
            before = _correct(config, before, sample)
        done.append(m._replace(estimate=before))
    return (*history[:first], *done)


def _correct(config: ObserverConfig, estimate: tuple[AxisFilter, ...], sample: Sample) -> tuple[AxisFilter, ...]:
    """Take a sample in; a half that reads zero only says that it is within the dead band."""
    reads = [0.0, 0.0]
    for i, value in zip(config.axes, sample.values, strict=True):
        reads[i // 3] += abs(value)
    return tuple(
        correct_within(x, config.dead_band[i // 3], R)
        if reads[i // 3] == 0.0 and config.dead_band[i // 3] > 0.0
        else correct(x, z, robust_variance(x, z, R, config.outlier))
        for i, x, z, R in zip(config.axes, estimate, sample.values, config.noise, strict=True)
    )


def _listen(config: ObserverConfig, mean: Floats, fresh: list[Sample]) -> tuple[Floats, bool]:
    """Return the weighted mean with new samples in it, and whether it was significant after any of them."""
    share = config.smoothing / (2.0 - config.smoothing)  # variance of the weighted mean over that of a sample
    seen = False
    for sample in fresh:
        mean = tuple(m + config.smoothing * (value - m) for m, value in zip(mean, sample.values, strict=True))
        seen = seen or sum(m * m / (share * R) for m, R in zip(mean, config.noise, strict=True)) > config.chi_on
    return mean, seen


def _significance(estimate: tuple[AxisFilter, ...], floor: Floats) -> float:
    return sum(x.v * x.v / (x.P_vv + least) for x, least in zip(estimate, floor, strict=True))


def _restart(config: ObserverConfig, estimate: tuple[AxisFilter, ...], mean: Floats) -> tuple[AxisFilter, ...]:
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


_LEAST_SHARE = 1e-3
"""Share of an axis across the drag below which the drag says nothing of it."""
