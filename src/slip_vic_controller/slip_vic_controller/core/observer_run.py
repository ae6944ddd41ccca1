"""Ticks of a slip, run one after another: prediction, the direction of friction, and the samples at their stamps."""

from __future__ import annotations

import math

from slip_vic_controller.core.observer_types import Floats, Moment, ObserverConfig, Sample
from slip_vic_controller.core.slip_filter_kernel import AxisFilter, correct, correct_within, predict, robust_variance


def advance(config: ObserverConfig, m: Moment, before: tuple[AxisFilter, ...]) -> tuple[AxisFilter, ...]:
    """Predict the estimate over one tick.

    Implements: ours: v_s[k+1] = v_s[k] + dv_ee - T (G^T a_o + Phi1' v_s + Phi2) with the model's errors taken out.
    """
    turning = _turning(config.axes, before, m.turn_linear, m.turn_angular)
    return tuple(
        predict(x, step - m.dt * turn, f, m.dt, q_v, q_b)
        for x, step, turn, f, q_v, q_b in zip(
            before, m.step, turning, m.force, config.force_noise, config.drift_b, strict=True
        )
    )


def opposed(config: ObserverConfig, m: Moment, estimate: tuple[AxisFilter, ...]) -> tuple[AxisFilter, ...]:
    """Take in that friction opposes slip: the pad slides over the object in the direction in which it drags it.

    The friction coefficient does not matter. Where the estimate says otherwise it is pulled to the nearest velocity
    that fits, weakly, because pads are not alike in all directions.

    Implements: ours: d = drag + b + c f, v corrected towards (v.d)+ d / d^2 where the axis is not along d.
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
        if across > LEAST_SHARE:
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


def insert(history: tuple[Moment, ...], samples: list[Sample]) -> tuple[tuple[Moment, ...], int]:
    """Put the samples at the first tick not before their stamps; return the history and the first tick that changed.

    Implements: ours: a tick's samples are taken in by stamp, so their order of arrival does not matter.
    """
    moments, first = list(history), len(history)
    for sample in samples:
        index = len(moments) - 1  # most samples are young
        while index > 0 and moments[index - 1].stamp_ns >= sample.stamp_ns:
            index -= 1
        moments[index] = moments[index]._replace(samples=tuple(sorted((*moments[index].samples, sample))))
        first = min(first, index)
    return tuple(moments), first


def run(
    config: ObserverConfig, history: tuple[Moment, ...], first: int, before: tuple[AxisFilter, ...]
) -> tuple[Moment, ...]:
    """Run the ticks from number `first` on, again or for the first time; `before` is the estimate ahead of it.

    Implements: ours: prediction, friction's direction, then the samples of the tick.
    """
    done = []
    for m in history[first:]:
        before = opposed(config, m, advance(config, m, before))
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


LEAST_SHARE = 1e-3
"""Share of an axis across the drag below which the drag says nothing of it."""
