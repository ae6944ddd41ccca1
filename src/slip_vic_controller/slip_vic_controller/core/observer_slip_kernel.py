"""A tick of the slip observer in slip. Layouts: `observer_run_kernel`."""

from __future__ import annotations

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import IN1, IN2, INT, OUT1, OUT2, REAL, kernel, part
from slip_vic_controller.core.observer_run_kernel import (
    AXIS,
    CALM,
    CHI_OFF,
    COUNT,
    DWELL,
    FLOOR,
    KIND,
    LATE,
    MEAN,
    MEMORY,
    OWN_STAMP,
    QUIET,
    REST,
    SIGNIFICANCE,
    SINCE,
    SLIDING,
    STAMP,
    STEP,
    VALUES,
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
from slip_vic_controller.core.slip_filter_kernel import AxisFilter, correct_of


@part
def _follows(rows: Array, p: int, stamp: float, fresh: Array, sample: int, tuning: Array) -> bool:
    """Return whether a sample counts after the one of row p."""
    if rows[p, OWN_STAMP] != stamp:
        return bool(rows[p, OWN_STAMP] < stamp)
    for k in range(int(tuning[COUNT])):
        value = fresh[sample, 1 + int(of_axis(tuning, AXIS, k))]
        if rows[p, VALUES + k] != value:
            return bool(rows[p, VALUES + k] < value)
    return True


@part
def _insert(tuning: Array, rows: Array, count: int, fresh: Array, sample: int) -> int:
    """Put a sample among `count` rows, after its tick and those of its samples that count earlier; return where."""
    n, stamp = int(tuning[COUNT]), fresh[sample, 0]
    tick = count
    while tick > 0 and rows[tick - 1, STAMP] >= stamp:
        tick -= 1
    if tick == count:  # later than every tick: it counts at the last one
        tick -= 1
        while rows[tick, KIND] != 0.0:
            tick -= 1
    p = tick + 1
    while p < count and rows[p, KIND] != 0.0 and _follows(rows, p, stamp, fresh, sample, tuning):
        p += 1
    for r in range(count, p, -1):
        for j in range(rows.shape[1]):
            rows[r, j] = rows[r - 1, j]
    for j in range(STEP + 2 * n):
        rows[p, j] = 0.0
    rows[p, STAMP], rows[p, KIND], rows[p, OWN_STAMP] = rows[tick, STAMP], 1.0, stamp
    for k in range(n):
        rows[p, VALUES + k] = fresh[sample, 1 + int(of_axis(tuning, AXIS, k))]
    return p


@kernel(INT(IN1, IN1, IN1, IN2, IN2, REAL, REAL, OUT1, OUT2))
def observe_slip(
    tuning: Array, motion: Array, now: Array, rows: Array, fresh: Array, stamp: float, dt: float, after: Array,
    rows_after: Array,
) -> int:  # fmt: skip
    """Predict, correct, test whether the slip is over; return how many rows there are now, 0 at its end, -1 not finite.

    Args:
        tuning, motion, now, fresh: see the layouts.
        rows: of the last ticks in slip and their samples, one at least; either all, or so many that the first is of a
            tick before every fresh sample.
        stamp: of this tick [ns].
        dt: since the last one [s].
        after: `now` after it.
        rows_after: room for the rows, this tick's, and one for each sample.

    Implements: ours: `observer._in_slip`.
    """
    n, had = int(tuning[COUNT]), rows.shape[0]
    e, known = STEP + 2 * n, MEAN + n
    for r in range(had):
        for j in range(rows.shape[1]):
            rows_after[r, j] = rows[r, j]
    put_moment(tuning, motion, now, stamp, dt, rows_after[had])
    tick, count = had, had + 1
    keep(motion, now, after)

    # -- samples at the ticks at which they were measured
    begin = rows[had - 1, STAMP]
    for r in range(had):
        if rows[r, STAMP] >= stamp - tuning[MEMORY]:
            begin = rows[r, STAMP]
            break
    first = had
    for sample in ordered(tuning, fresh):
        if fresh[sample, 0] > begin:
            p = _insert(tuning, rows_after, count, fresh, sample)
            count += 1
            tick += 1 if p <= tick else 0
            first = min(first, p)
        else:
            after[LATE] += 1.0

    # -- the ticks since then
    start = np.empty(6 + 9 * n)
    for j in range(9 * n):
        start[6 + j] = rows_after[first - 1, e + j]
    run_rows(tuning, rows_after, first, count, start)
    significance = 0.0
    sure = True
    for k in range(n):
        x = axis(rows_after[count - 1], e + 9 * k)
        put_axis(after, known + 9 * k, x)
        significance += x.v * x.v / (x.P_vv + of_axis(tuning, FLOOR, k))
        sure = sure and x.P_bb < of_axis(tuning, REST, k) and x.P_vv < of_axis(tuning, CALM, k)
    after[SIGNIFICANCE] = significance
    after[QUIET] = now[QUIET] + 1.0 if sure and significance < tuning[CHI_OFF] else 0.0
    if after[QUIET] >= tuning[DWELL]:
        after[SLIDING], after[SINCE], after[QUIET] = 0.0, stamp, 0.0
        for k in range(n):
            after[MEAN + k] = 0.0
            x = correct_of(axis(after, known + 9 * k), 0.0, of_axis(tuning, FLOOR, k))
            put_axis(after, known + 9 * k, AxisFilter(0.0, x.b, x.c, 0.0, 0.0, 0.0, x.P_bb, x.P_bc, x.P_cc))
        count = 0
    publish(tuning, after, rows_after[tick])
    return count if all_small(after) else -1
