"""Products and equations of small matrices, to the same bits on every processor.

numpy's `@` and `linalg`, and scipy's, leave them to OpenBLAS, which chooses its loops by the processor, and with them
how it rounds. What a recorded run depends on is made here instead: of numpy's products and sums number by number.
"""

from __future__ import annotations

from functools import reduce

import numpy as np

from slip_core.arrays import Array

DOUBLINGS = 60
"""Most steps of `riccati`: each doubles the time that has passed in its filter, and 15 are common."""


def product(*factors: Array) -> Array:
    """Return the product of matrices, from left to right; the last one may be a vector."""
    return reduce(_product, factors)


def _product(A: Array, B: Array) -> Array:
    total = np.multiply.outer(A[:, 0], B[0])
    for k in range(1, len(B)):
        total += np.multiply.outer(A[:, k], B[k])
    return total


def solve(A: Array, B: Array) -> Array:
    """Return A^-1 B by elimination; (n, n), (n, m) -> (n, m). The rows of A are exchanged for the largest pivot."""
    n = len(A)
    rows = np.hstack((A, B))
    for i in range(n):
        pivot = i + int(np.abs(rows[i:, i]).argmax())
        rows[[i, pivot]] = rows[[pivot, i]]
        rows[i] /= rows[i, i]
        for j in range(n):
            if j != i:
                rows[j] -= rows[j, i] * rows[i]
    return rows[:, n:]


def riccati(F: Array, H: Array, Q: Array, R: Array) -> Array:
    """Return the covariance (n, n) of a Kalman filter in steady state, before a sample.

    P = F P F^T - F P H^T (H P H^T + R)^-1 H P F^T + Q.

    Args:
        F, Q: transition and noise of the process over a period (n, n).
        H, R: measurement (m, n), and its noise (m, m).

    Implements: the structure-preserving doubling algorithm of E. K.-W. Chu, H.-Y. Fan, W.-W. Lin, C.-S. Wang, 2004.
    """
    n, A, G, P = len(F), F.T, product(H.T, solve(R, H)), Q
    for _ in range(DOUBLINGS):
        solved = solve(np.eye(n) + product(G, P), np.hstack((A, product(G, A.T))))
        before = P
        A, G, P = product(A, solved[:, :n]), G + product(A, solved[:, n:]), P + product(A.T, P, solved[:, :n])
        if np.array_equal(P, before):
            break
    return 0.5 * (P + P.T)
