"""What is wrong with the numbers of a sample, as bits."""

from __future__ import annotations

import math

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import IN1, IN2, INT, REAL, kernel, part
from slip_core.small_kernel import LARGEST

NOT_FINITE, ABSURD, DENORMAL, JUMP, MOVES, SAME = 1, 2, 4, 8, 16, 32
"""SAME: equal to the last bit to the sample before."""
TINY = float(np.finfo(np.float64).tiny)
ARM_MOVES = 0.02
"""[rad/s]"""


@kernel(INT(IN1))
def all_finite(values: Array) -> int:
    """Return 1 where all numbers (k,) are finite and not beyond LARGEST, else 0.

    Implements: ours: NaN is not below a limit either.
    """
    for x in values:
        if not abs(x) <= LARGEST:
            return 0
    return 1


@part
def _same(a: Array, b: Array) -> bool:
    """Return whether all bits are equal: 0 and -0 are not, as no frozen sensor changes a sign."""
    x, y = a.view(np.int64), b.view(np.int64)
    for i in range(a.shape[0]):  # noqa: SIM110 - kernels know no generators
        if x[i] != y[i]:
            return False
    return True


@part
def _kind(values: Array) -> int:
    """Return NOT_FINITE, DENORMAL or 0."""
    found = 0
    for x in values:
        if not math.isfinite(x):
            return NOT_FINITE
        if x != 0.0 and abs(x) < TINY:
            found = DENORMAL
    return found


@kernel(INT(IN1, IN1, REAL, REAL))
def judge_six(values: Array, before: Array, linear: float, angular: float) -> int:
    """Return the bits of a wrench or twist (6,): NOT_FINITE alone, or ABSURD, DENORMAL, SAME.

    Args:
        values: the sample.
        before: the last good one, NaN before there is one.
        linear, angular: magnitudes above which a sample is absurd.

    Implements: ours: one look at the numbers.
    """
    found = _kind(values)
    if found == NOT_FINITE:
        return found
    a = math.sqrt(values[0] * values[0] + values[1] * values[1] + values[2] * values[2])
    b = math.sqrt(values[3] * values[3] + values[4] * values[4] + values[5] * values[5])
    if a > linear or b > angular:
        found |= ABSURD
    return found | (SAME if _same(values, before) else 0)


@kernel(INT(IN1, IN1, IN2, IN1, IN1, REAL, REAL))
def judge_joints(
    q: Array, qd: Array, limits: Array, q_before: Array, qd_before: Array, jump: float, coast_s: float
) -> int:
    """Return the bits of a joint state (n,), (n,): NOT_FINITE alone, or ABSURD, DENORMAL, JUMP, MOVES, SAME.

    Args:
        q, qd: the sample [rad], [rad/s].
        limits: rows of lowest and highest position and highest speed (n each).
        q_before, qd_before: the last good one, NaN before there is one.
        jump: position [rad] that no velocity need explain.
        coast_s: time for which a velocity explains a change of position [s].

    Implements: ours: one look at the numbers.
    """
    found = _kind(q) | _kind(qd)
    if found & NOT_FINITE:
        return NOT_FINITE
    for j in range(q.shape[0]):
        speed = abs(qd[j])
        if not (limits[0, j] <= q[j] <= limits[1, j] and speed <= limits[2, j]):
            found |= ABSURD
        if abs(q[j] - q_before[j]) > jump + coast_s * max(speed, abs(qd_before[j])):
            found |= JUMP
        if speed > ARM_MOVES:
            found |= MOVES
    return found | (SAME if _same(q, q_before) and _same(qd, qd_before) else 0)
