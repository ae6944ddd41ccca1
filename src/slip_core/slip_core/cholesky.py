"""Cholesky factors by loops: no linear algebra library, so the same bits on every processor."""

from __future__ import annotations

import math

from slip_core.arrays import Array
from slip_core.compiled import part

LARGEST = 1e154
"""Beyond it squares overflow; NaN is not below it either."""


@part
def all_finite(values: Array) -> bool:
    """Return whether all numbers (k,) are finite and not beyond LARGEST."""
    for x in values:  # noqa: SIM110 - compiled code has no generators
        if not abs(x) <= LARGEST:
            return False
    return True


@part
def cholesky(A: Array, L: Array) -> bool:
    """Write the lower factor of a symmetric positive definite A to `L`; False where it is not; (n, n)."""
    n = A.shape[0]
    for j in range(n):
        pivot = A[j, j]
        for k in range(j):
            pivot -= L[j, k] * L[j, k]
        if not pivot > 0.0:
            return False
        root = math.sqrt(pivot)
        L[j, j] = root
        for i in range(j + 1, n):
            total = A[i, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            L[i, j] = total / root
    return True


@part
def forward_substitute(L: Array, b: Array, x: Array) -> None:
    """Solve L x = b with a lower triangular L; `x` may be `b`; (n, n) (n,) -> (n,)."""
    for i in range(L.shape[0]):
        total = b[i]
        for k in range(i):
            total -= L[i, k] * x[k]
        x[i] = total / L[i, i]


@part
def back_substitute(L: Array, b: Array, x: Array) -> None:
    """Solve L^T x = b with a lower triangular L; `x` may be `b`; (n, n) (n,) -> (n,)."""
    n = L.shape[0]
    for step in range(n):
        i = n - 1 - step
        total = b[i]
        for k in range(i + 1, n):
            total -= L[k, i] * x[k]
        x[i] = total / L[i, i]
