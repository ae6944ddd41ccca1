"""Half of a solve with MuJoCo's factor of the mass matrix, compiled."""

from __future__ import annotations

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.records import WholeArray


@part
def solve_half(factor: Array, tree: WholeArray, x: Array) -> None:
    """Replace x by L^-T x, with M = L^T D L as MuJoCo keeps it: rows of L side by side, the diagonal last."""
    n = x.shape[0]
    for step in range(n):
        i = n - 1 - step
        first, count = tree[i], tree[n + i]
        for at in range(first, first + count - 1):
            x[tree[2 * n + at]] -= factor[at] * x[i]
