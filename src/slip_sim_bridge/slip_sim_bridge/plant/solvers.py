"""Half of a solve with MuJoCo's factor of the mass matrix, and the next point of Anderson's acceleration; compiled."""

from __future__ import annotations

from typing import Final

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.records import WholeArray

PASSES: Final = 60
RANK: Final = 1e-12
"""Of a difference of residuals: what the newer ones leave of it, below which it says nothing new."""


@part
def remember(points: Array, values: Array, x: Array, value: Array, count: int) -> int:
    """Put a point and its value before the older ones and return how many are kept, at most n + 1; (n + 1, n)."""
    kept = min(count + 1, len(points))
    for i in range(kept - 1, 0, -1):
        points[i] = points[i - 1]
        values[i] = values[i - 1]
    points[0], values[0] = x, value
    return kept


@part
def next_point(points: Array, values: Array, count: int, x: Array) -> None:
    """Write to x where g(x) = x is expected, by the newest `count` points and values g of them; (n + 1, n), (n,).

    Anderson 1965, J. ACM 12(4):547-560, with a memory of n steps: the share of each step that makes the residual
    g(x) - x least, by orthogonalisation that begins at the newest. What is nearly linear needs n + 2 values of g.
    """
    n, steps = len(x), count - 1
    left = values[0] - points[0]
    basis, triangle, shares = np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)
    for j in range(steps):
        step = (values[j] - points[j]) - (values[j + 1] - points[j + 1])
        whole = 0.0
        for k in range(n):
            whole += step[k] * step[k]
        for i in range(j):
            for k in range(n):
                triangle[i, j] += basis[i, k] * step[k]
            for k in range(n):
                step[k] -= triangle[i, j] * basis[i, k]
        rest = 0.0
        for k in range(n):
            rest += step[k] * step[k]
        if rest > RANK * RANK * whole:
            triangle[j, j] = np.sqrt(rest)
            for k in range(n):
                basis[j, k] = step[k] / triangle[j, j]
    for j in range(steps - 1, -1, -1):
        if triangle[j, j] > 0.0:
            for k in range(n):
                shares[j] += basis[j, k] * left[k]
            for i in range(j + 1, steps):
                shares[j] -= triangle[j, i] * shares[i]
            shares[j] /= triangle[j, j]
    for k in range(n):
        x[k] = values[0, k]
        for j in range(steps):
            x[k] -= shares[j] * (values[j, k] - values[j + 1, k])


@part
def solve_half(factor: Array, tree: WholeArray, x: Array) -> None:
    """Replace x by L^-T x, with M = L^T D L as MuJoCo keeps it: rows of L side by side, the diagonal last."""
    n = x.shape[0]
    for step in range(n):
        i = n - 1 - step
        first, count = tree[i], tree[n + i]
        for at in range(first, first + count - 1):
            x[tree[2 * n + at]] -= factor[at] * x[i]
