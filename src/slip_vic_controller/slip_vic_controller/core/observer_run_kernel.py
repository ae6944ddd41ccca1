"""`observer_run` once more, as parts of the observer's kernels, and what these share; n filtered axes.

tuning   n, number of linear ones, chi_on, chi_off, dwell, memory [ns], smoothing, outlier, drag_spread, drag_memory,
         dead band (2), then n each of AXIS ... CALM, in the order of the constants below
motion   R_ee (9), v_ee, follow, force (6 each), drag (3), w_o (3); {w}, see `Motion`
now      what the law is given: slip twist, error, variance (6 each, {ee}), significance; then sliding 0 or 1,
         since [ns], quiet, late, v_ee of the last tick (6), mean of the samples (n), estimate (9 n, see `AxisFilter`)
row      of a tick: stamp [ns], 0, dt [s], turn_linear, turn_angular (3 each), drag (3), step (n), force (n);
         in stick then steps, impulses (n each), time; in slip instead the estimate (9 n)
         of a sample, after the row of its tick: stamp of that tick, 1, own stamp, 9 unused, values (n), n unused,
         the estimate
fresh    one row per sample: stamp [ns], twist (6)

Stamps count from the beginning of the observer, so that a float holds them to the nanosecond for a hundred days.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.small_kernel import LARGEST
from slip_core.vector_kernel import add, minus, nine, put, three, times, turn_back, vec_cross
from slip_vic_controller.core.slip_filter_kernel import (
    AxisFilter,
    correct_of,
    correct_within_of,
    predict_of,
    robust_variance_of,
)

ONES = 12
COUNT, LINEAR, CHI_ON, CHI_OFF, DWELL, MEMORY, SMOOTHING, OUTLIER, DRAG_SPREAD, DRAG_MEMORY, DEAD_BAND = range(11)
AXIS, NOISE, FORCE_NOISE, FLOOR, REST, PRIOR_B, PRIOR_C, DRIFT_B, ONSET_B, CALM = range(10)
MOTION = 33
ERROR, VARIANCE, SIGNIFICANCE, SLIDING, SINCE, QUIET, LATE, LAST_TWIST, MEAN = 6, 12, 18, 19, 20, 21, 22, 23, 29
STAMP, KIND, DT, TURN_LINEAR, TURN_ANGULAR, DRAG, STEP = 0, 1, 2, 3, 6, 9, 12
OWN_STAMP, VALUES = 2, 12
LEAST_SHARE = 1e-3
"""Share of an axis across the drag below which the drag says nothing of it."""


@part
def of_axis(tuning: Array, what: int, k: int) -> float:
    """Return one of the numbers per axis."""
    return tuning[ONES + what * int(tuning[COUNT]) + k]


@part
def axis(a: Array, i: int) -> AxisFilter:
    """Return the estimate of an axis that begins at a[i]."""
    return AxisFilter(a[i], a[i + 1], a[i + 2], a[i + 3], a[i + 4], a[i + 5], a[i + 6], a[i + 7], a[i + 8])


@part
def put_axis(a: Array, i: int, x: AxisFilter) -> None:
    """Write the estimate of an axis to a[i : i + 9]."""
    for j in range(9):
        a[i + j] = x[j]


@part
def put_moment(tuning: Array, motion: Array, now: Array, stamp: float, dt: float, row: Array) -> None:
    """Write what a tick does to the slip velocity; as `_moment`, without sums and estimate."""
    n, R = int(tuning[COUNT]), nine(motion, 0)
    linear = minus(minus(three(motion, 9), three(now, LAST_TWIST)), times(dt, three(motion, 15)))
    angular = minus(minus(three(motion, 12), three(now, LAST_TWIST + 3)), times(dt, three(motion, 18)))
    linear, angular = turn_back(R, linear), turn_back(R, angular)
    force, torque = turn_back(R, three(motion, 21)), turn_back(R, three(motion, 24))
    drag, w_ee, w_o = turn_back(R, three(motion, 27)), turn_back(R, three(motion, 12)), turn_back(R, three(motion, 30))
    row[STAMP], row[KIND], row[DT] = stamp, 0.0, dt
    put(row, TURN_LINEAR, add(w_ee, times(2.0, w_o)))
    put(row, TURN_ANGULAR, add(w_ee, w_o))
    put(row, DRAG, (0.0, 0.0, 0.0))
    for k in range(n):
        i = int(of_axis(tuning, AXIS, k))
        if i < 3:
            row[STEP + k], row[STEP + n + k], row[DRAG + k] = linear[i], force[i], drag[i]
        else:
            row[STEP + k], row[STEP + n + k] = angular[i - 3], torque[i - 3]


@part
def advance_row(tuning: Array, before: Array, b: int, row: Array, work: Array) -> None:
    """Predict the estimate at before[b] over the tick of `row`; as `advance`; work (6,)."""
    n, dt = int(tuning[COUNT]), row[DT]
    e = STEP + 2 * n
    for i in range(6):
        work[i] = 0.0
    for k in range(n):
        work[int(of_axis(tuning, AXIS, k))] = before[b + 9 * k]
    linear = vec_cross(three(row, TURN_LINEAR), three(work, 0))
    angular = vec_cross(three(row, TURN_ANGULAR), three(work, 3))
    for k in range(n):
        i = int(of_axis(tuning, AXIS, k))
        turn = linear[i] if i < 3 else angular[i - 3]
        q_v, q_b = of_axis(tuning, FORCE_NOISE, k), of_axis(tuning, DRIFT_B, k)
        x = predict_of(axis(before, b + 9 * k), row[STEP + k] - dt * turn, row[STEP + n + k], dt, q_v, q_b)
        put_axis(row, e + 9 * k, x)


@part
def oppose_row(tuning: Array, row: Array) -> None:
    """Take in that friction opposes slip; as `opposed`, in place."""
    n, count = int(tuning[COUNT]), int(tuning[LINEAR])
    e = STEP + 2 * n
    if count == 0 or tuning[DRAG_SPREAD] == 0.0:
        return
    square = along = speed = 0.0
    for k in range(count):
        v, d = row[e + 9 * k], row[DRAG + k] + row[e + 9 * k + 1] + row[e + 9 * k + 2] * row[STEP + n + k]
        square += d * d
        along += v * d
        speed += v * v
    if square == 0.0:
        return
    along /= square
    spread = (tuning[DRAG_SPREAD] * math.sqrt(speed)) ** 2
    for k in range(count):
        d = row[DRAG + k] + row[e + 9 * k + 1] + row[e + 9 * k + 2] * row[STEP + n + k]
        across = 1.0 - d * d / square if along > 0.0 else 1.0
        if across > LEAST_SHARE:
            variance = tuning[DRAG_MEMORY] * (spread + of_axis(tuning, FLOOR, k)) / across
            put_axis(row, e + 9 * k, correct_of(axis(row, e + 9 * k), max(along, 0.0) * d, variance))


@part
def correct_row(tuning: Array, before: Array, b: int, row: Array) -> None:
    """Take the sample of `row` in; as `_correct`."""
    n = int(tuning[COUNT])
    e = STEP + 2 * n
    linear = angular = 0.0
    for k in range(n):
        if of_axis(tuning, AXIS, k) < 3.0:
            linear += abs(row[VALUES + k])
        else:
            angular += abs(row[VALUES + k])
    for k in range(n):
        x, z, R = axis(before, b + 9 * k), row[VALUES + k], of_axis(tuning, NOISE, k)
        is_linear = of_axis(tuning, AXIS, k) < 3.0
        band = tuning[DEAD_BAND] if is_linear else tuning[DEAD_BAND + 1]
        if (linear if is_linear else angular) == 0.0 and band > 0.0:
            put_axis(row, e + 9 * k, correct_within_of(x, band, R))
        else:
            put_axis(row, e + 9 * k, correct_of(x, z, robust_variance_of(x, z, R, tuning[OUTLIER])))


@part
def run_rows(tuning: Array, rows: Array, first: int, count: int, start: Array) -> None:
    """Run rows from number `first` on; as `run`; start (6 + 9 n,): scratch, then the estimate ahead of them."""
    e = STEP + 2 * int(tuning[COUNT])
    before, b = start, 6
    for r in range(first, count):
        row = rows[r]
        if row[KIND] == 0.0:
            advance_row(tuning, before, b, row, start)
            oppose_row(tuning, row)
        else:
            correct_row(tuning, before, b, row)
        before, b = row, e


@part
def _earlier(tuning: Array, fresh: Array, a: int, b: int) -> bool:
    """Return whether sample a comes before sample b: by stamp, then by its values."""
    if fresh[a, 0] != fresh[b, 0]:
        return bool(fresh[a, 0] < fresh[b, 0])
    for k in range(int(tuning[COUNT])):
        i = 1 + int(of_axis(tuning, AXIS, k))
        if fresh[a, i] != fresh[b, i]:
            return bool(fresh[a, i] < fresh[b, i])
    return False


@part
def ordered(tuning: Array, fresh: Array) -> NDArray[np.int64]:
    """Return the numbers of the samples in the order in which they count."""
    order = np.arange(fresh.shape[0])
    for a in range(1, fresh.shape[0]):
        sample, b = order[a], a
        while b > 0 and _earlier(tuning, fresh, sample, order[b - 1]):
            order[b] = order[b - 1]
            b -= 1
        order[b] = sample
    return order


@part
def publish(tuning: Array, now: Array, row: Array) -> None:
    """Write what the law is given; as `_estimate`; row: of the tick."""
    n = int(tuning[COUNT])
    for i in range(SIGNIFICANCE):
        now[i] = 0.0
    for k in range(n):
        i, x = int(of_axis(tuning, AXIS, k)), axis(now, MEAN + n + 9 * k)
        if now[SLIDING] == 1.0:
            now[i] = x.v
        now[ERROR + i] = x.b + x.c * row[STEP + n + k]
        now[VARIANCE + i] = x.P_vv


@part
def all_small(now: Array) -> bool:
    """Return whether every number is finite and its square is."""
    small = True
    for i in range(now.shape[0]):
        small = small and abs(now[i]) <= LARGEST
    return small


@part
def keep(motion: Array, now: Array, after: Array) -> None:
    """Begin with the memory of the last tick and the motion of this one."""
    for i in range(now.shape[0]):
        after[i] = now[i]
    for i in range(6):
        after[LAST_TWIST + i] = motion[9 + i]
