"""A tick of the slip observer in stick, and the beginning of a slip. Layouts: `observer_run_kernel`."""

from __future__ import annotations

import math

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import IN1, IN2, INT, OUT1, OUT2, REAL, VOID, kernel, part
from slip_vic_controller.core.observer_run_kernel import (
    AXIS,
    CHI_ON,
    COUNT,
    DRAG,
    DRIFT_B,
    DT,
    FLOOR,
    FORCE_NOISE,
    LINEAR,
    MEAN,
    NOISE,
    ONSET_B,
    PRIOR_B,
    PRIOR_C,
    SIGNIFICANCE,
    SINCE,
    SLIDING,
    SMOOTHING,
    STEP,
    all_small,
    axis,
    keep,
    of_axis,
    ordered,
    publish,
    put_axis,
    put_moment,
    run_rows,
)
from slip_vic_controller.core.slip_filter_kernel import AxisFilter, learn_of


@part
def _window_significance(tuning: Array, window: Array, now: Array) -> float:
    n = int(tuning[COUNT])
    s, count = STEP + 2 * n, window.shape[0]
    first, last = window[0], window[count - 1]
    time = last[s + 2 * n] - first[s + 2 * n] + first[DT]
    total = 0.0
    for k in range(n):
        x = axis(now, MEAN + n + 9 * k)
        impulse = last[s + n + k] - first[s + n + k] + first[DT] * first[STEP + n + k]
        v = last[s + k] - first[s + k] + first[STEP + k] - time * x.b - impulse * x.c
        variance = time * time * x.P_bb + 2.0 * time * impulse * x.P_bc + impulse * impulse * x.P_cc
        total += v * v / (variance + count * of_axis(tuning, FORCE_NOISE, k) + of_axis(tuning, FLOOR, k))
    return total


@part
def _listen(tuning: Array, fresh: Array, now: Array) -> bool:
    """Take the samples into the mean; return whether it was significant after any of them."""
    n, smoothing = int(tuning[COUNT]), tuning[SMOOTHING]
    share = smoothing / (2.0 - smoothing)
    seen = False
    for sample in ordered(tuning, fresh):
        if fresh[sample, 0] > now[SINCE]:
            total = 0.0
            for k in range(n):
                m = now[MEAN + k]
                m += smoothing * (fresh[sample, 1 + int(of_axis(tuning, AXIS, k))] - m)
                now[MEAN + k] = m
                total += m * m / (share * of_axis(tuning, NOISE, k))
            seen = seen or total > tuning[CHI_ON]
    return seen


@kernel(INT(IN1, IN1, IN1, IN2, IN2, REAL, REAL, OUT1, OUT2))
def observe_stick(
    tuning: Array, motion: Array, now: Array, window: Array, fresh: Array, stamp: float, dt: float, after: Array,
    window_after: Array,
) -> int:  # fmt: skip
    """Test whether slip has begun; return 0 in stick, 1 or 2 where model or samples show slip, -1 where not finite.

    Args:
        tuning, motion, now, fresh: see the layouts.
        window: rows of the last ticks in stick.
        stamp: of this tick [ns].
        dt: since the last one [s].
        after: `now` after it; in slip to be finished by `begin_slip`.
        window_after: `window` after it: all its rows, or one less where it is full, and this tick's.

    Implements: ours: `observer._in_stick`.
    """
    n, had, count = int(tuning[COUNT]), window.shape[0], window_after.shape[0]
    s, e = STEP + 2 * n, MEAN + n
    drop = had + 1 - count
    for r in range(count - 1):
        for j in range(window.shape[1]):
            window_after[r, j] = window[r + drop, j]
    row = window_after[count - 1]
    put_moment(tuning, motion, now, stamp, dt, row)
    for k in range(n):
        row[s + k], row[s + n + k] = row[STEP + k], dt * row[STEP + n + k]
        if had > 0:
            row[s + k] += window[had - 1, s + k]
            row[s + n + k] += window[had - 1, s + n + k]
    row[s + 2 * n] = dt + (window[had - 1, s + 2 * n] if had > 0 else 0.0)
    keep(motion, now, after)
    for r in range(drop):
        for k in range(n):
            q_v, q_b = of_axis(tuning, FORCE_NOISE, k), of_axis(tuning, DRIFT_B, k)
            f = window[r, STEP + n + k]
            put_axis(
                after, e + 9 * k, learn_of(axis(after, e + 9 * k), window[r, STEP + k], f, window[r, DT], q_v, q_b)
            )
    significance = _window_significance(tuning, window_after, after)
    seen = _listen(tuning, fresh, after)
    after[SIGNIFICANCE] = significance
    publish(tuning, after, row)
    if not all_small(after):
        return -1
    return 1 if significance > tuning[CHI_ON] else 2 if seen else 0


@kernel(VOID(IN1, IN2, INT, OUT1, OUT2))
def begin_slip(tuning: Array, window: Array, cause: int, now: Array, rows: Array) -> None:
    """Make the history of a slip that has begun, and its estimate.

    Args:
        tuning: see the layouts.
        window: rows in stick, the tick of the onset last.
        cause: result of `observe_stick`, 1 or 2.
        now: result of `observe_stick`, which is changed.
        rows: result; as many as of the window where the model shows slip, else one.

    Implements: ours: `observer._unsettled`, `observer._restart`.
    """
    n, count = int(tuning[COUNT]), rows.shape[0]
    e, known, skipped = STEP + 2 * n, MEAN + n, window.shape[0] - count
    now[SLIDING] = 1.0
    for r in range(count):
        for j in range(e):
            rows[r, j] = window[skipped + r, j]
    row = rows[count - 1]
    if cause == 1:
        force = 0.0
        for k in range(int(tuning[LINEAR])):
            force += row[DRAG + k] * row[DRAG + k]
        force = math.sqrt(force)
        start = np.empty(6 + 9 * n)
        for k in range(n):
            for j in range(9):
                start[6 + 9 * k + j] = now[known + 9 * k + j]
            start[6 + 9 * k + 6] += (of_axis(tuning, ONSET_B, k) * force) ** 2
        run_rows(tuning, rows, 0, count, start)
    else:
        share = tuning[SMOOTHING] / (2.0 - tuning[SMOOTHING])
        for k in range(n):
            x, m = axis(now, known + 9 * k), now[MEAN + k]
            P_vv = share * of_axis(tuning, NOISE, k) + m * m
            b, c = of_axis(tuning, PRIOR_B, k), of_axis(tuning, PRIOR_C, k)
            put_axis(row, e + 9 * k, AxisFilter(m, x.b, x.c, P_vv, 0.0, 0.0, b, 0.0, c))
    for j in range(9 * n):
        now[known + j] = row[e + j]
    publish(tuning, now, row)
