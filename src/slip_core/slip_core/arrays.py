"""Arrays: read-only, of a size, rotations and inertias; products and equations to the same bits on every processor.

numpy's `@` and `linalg`, and scipy's, leave them to OpenBLAS, which chooses its loops by the processor, and with them
how it rounds. What a recorded run depends on is made here instead: of numpy's products and sums number by number.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import reduce

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slip_core.compiled import interpreted, part
from slip_core.errors import InputError

Array = NDArray[np.float64]


def readonly(values: ArrayLike) -> Array:
    """Return a read-only float64 array as it is, and a read-only copy of anything else; shape, unit and frame stay."""
    if type(values) is np.ndarray and values.dtype == np.float64 and not values.flags.writeable:
        return values
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def vector(values: ArrayLike, size: int, what: str) -> Array:
    """Return `values` as a read-only vector; (size,), unit and frame of the caller.

    Raises:
        InputError: where the shape is not (size,) or an element is not finite.
    """
    try:
        array = readonly(values)
    except (TypeError, ValueError):
        raise InputError(what, got=values, expected=f"{size} numbers") from None
    if array.shape != (size,):
        raise InputError(what, got=f"{array.size} numbers", expected=f"{size} numbers")
    if not np.isfinite(array).all():
        raise InputError(what, got=array.tolist(), expected="finite numbers")
    return array


def matrix_from_quat_xyzw(quat_xyzw: ArrayLike) -> Array:
    """Return the rotation matrix of a quaternion (x, y, z, w), normalised first; (4,) -> (3, 3).

    Raises:
        InputError: where the quaternion is not finite or its norm is below 1e-6.
    """
    q = vector(quat_xyzw, 4, "quaternion (x, y, z, w)")
    x, y, z, w = q.tolist()
    norm = math.sqrt(x * x + y * y + z * z + w * w)  # of `@` the last bit depends on the processor
    if norm < 1e-6:
        raise InputError("quaternion (x, y, z, w)", got=q.tolist(), expected="a norm of 1")
    x, y, z, w = (q / norm).tolist()
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def inertia_from_six(six: Sequence[float], what: str = "inertia") -> Array:
    """Return the symmetric inertia matrix of (ixx, iyy, izz, ixy, ixz, iyz); (6,) [kg m2] -> (3, 3).

    Raises:
        InputError: where the matrix is not positive definite or breaks the triangle inequality.
    """
    ixx, iyy, izz, ixy, ixz, iyz = vector(six, 6, what)
    matrix = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
    principal = np.linalg.eigvalsh(matrix)
    if principal[0] <= 0.0 or principal[0] + principal[1] < principal[2] * (1.0 - 1e-9):
        raise InputError(
            what,
            got=f"principal moments {principal.tolist()}",
            expected="positive principal moments, each at most the sum of the other two",
        )
    return matrix


DOUBLINGS = 60
"""Most steps of `riccati`: each doubles the time that has passed in its filter, and 15 are common."""


def product(*factors: Array) -> Array:
    """Return the product of matrices, from left to right; the last one may be a vector."""
    found = reduce(interpreted(times), (A.reshape(len(A), -1) for A in factors))
    return found.reshape(-1) if factors[-1].ndim == 1 else found


@part
def times(A: Array, B: Array) -> Array:
    """Return the product of two matrices."""
    total = A[:, :1] * B[:1]
    for k in range(1, len(B)):
        total += A[:, k : k + 1] * B[k : k + 1]
    return total


@part
def solve(A: Array, B: Array) -> Array:
    """Return A^-1 B by elimination; (n, n), (n, m) -> (n, m). The rows of A are exchanged for the largest pivot."""
    n = len(A)
    rows = np.hstack((A, B))
    for i in range(n):
        pivot, row = i + np.abs(rows[i:, i]).argmax(), rows[i].copy()
        rows[i] = rows[pivot] / rows[pivot, i]
        if pivot != i:
            rows[pivot] = row
        for j in range(n):
            if j != i:
                rows[j] -= rows[j, i] * rows[i]
    return rows[:, n:]


@part
def riccati(F: Array, H: Array, Q: Array, R: Array) -> Array:
    """Return the covariance (n, n) of a Kalman filter in steady state, before a sample.

    P = F P F^T - F P H^T (H P H^T + R)^-1 H P F^T + Q.

    Args:
        F, Q: transition and noise of the process over a period (n, n).
        H, R: measurement (m, n), and its noise (m, m).

    Implements: the structure-preserving doubling algorithm of E. K.-W. Chu, H.-Y. Fan, W.-W. Lin, C.-S. Wang, 2004.
    """
    n, A, G, P = len(F), F.T.copy(), times(H.T, solve(R, H)), Q.copy()
    for _ in range(DOUBLINGS):
        solved, before = solve(np.eye(n) + times(G, P), np.hstack((A, times(G, A.T)))), P.copy()
        P += times(times(A.T, P), solved[:, :n])
        G += times(A, solved[:, n:])
        after = times(A, solved[:, :n])
        for i in range(n):  # in place: what is new in a step is released with it
            A[i] = after[i]
        if np.array_equal(P, before):
            break
    return 0.5 * (P + P.T)
