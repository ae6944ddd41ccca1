"""Parts of kernels: vectors of three floats and 3x3 matrices as nine, by rows."""

from __future__ import annotations

import math

from slip_core.arrays import Array
from slip_core.compiled import part

Three = tuple[float, float, float]
Matrix = tuple[float, float, float, float, float, float, float, float, float]


@part
def three(v: Array, i: int) -> Three:
    """Return v[i : i + 3] as floats."""
    return v[i], v[i + 1], v[i + 2]


@part
def nine(v: Array, i: int) -> Matrix:
    """Return the matrix whose rows begin at v[i]."""
    return v[i], v[i + 1], v[i + 2], v[i + 3], v[i + 4], v[i + 5], v[i + 6], v[i + 7], v[i + 8]


@part
def rows(A: Array) -> Matrix:
    """Return a matrix (3, 3)."""
    return A[0, 0], A[0, 1], A[0, 2], A[1, 0], A[1, 1], A[1, 2], A[2, 0], A[2, 1], A[2, 2]


@part
def put(v: Array, i: int, a: Three) -> None:
    """Write a to v[i : i + 3]."""
    v[i], v[i + 1], v[i + 2] = a


@part
def put_matrix(v: Array, i: int, A: Matrix) -> None:
    """Write the rows of A to v[i : i + 9]."""
    for k in range(9):
        v[i + k] = A[k]


@part
def add(a: Three, b: Three) -> Three:
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@part
def minus(a: Three, b: Three) -> Three:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@part
def times(k: float, a: Three) -> Three:
    """Return k a."""
    return k * a[0], k * a[1], k * a[2]


@part
def dot(a: Three, b: Three) -> float:
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@part
def norm(a: Three) -> float:
    """Return |a|."""
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@part
def vec_cross(a: Three, b: Three) -> Three:
    """Return a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@part
def turn(R: Matrix, a: Three) -> Three:
    """Return R a."""
    return (
        R[0] * a[0] + R[1] * a[1] + R[2] * a[2],
        R[3] * a[0] + R[4] * a[1] + R[5] * a[2],
        R[6] * a[0] + R[7] * a[1] + R[8] * a[2],
    )


@part
def turn_back(R: Matrix, a: Three) -> Three:
    """Return R^T a."""
    return (
        R[0] * a[0] + R[3] * a[1] + R[6] * a[2],
        R[1] * a[0] + R[4] * a[1] + R[7] * a[2],
        R[2] * a[0] + R[5] * a[1] + R[8] * a[2],
    )


@part
def matmul(A: Matrix, B: Matrix) -> Matrix:
    """Return A B."""
    return (
        A[0] * B[0] + A[1] * B[3] + A[2] * B[6],
        A[0] * B[1] + A[1] * B[4] + A[2] * B[7],
        A[0] * B[2] + A[1] * B[5] + A[2] * B[8],
        A[3] * B[0] + A[4] * B[3] + A[5] * B[6],
        A[3] * B[1] + A[4] * B[4] + A[5] * B[7],
        A[3] * B[2] + A[4] * B[5] + A[5] * B[8],
        A[6] * B[0] + A[7] * B[3] + A[8] * B[6],
        A[6] * B[1] + A[7] * B[4] + A[8] * B[7],
        A[6] * B[2] + A[7] * B[5] + A[8] * B[8],
    )


@part
def transposed(A: Matrix) -> Matrix:
    """Return A^T."""
    return A[0], A[3], A[6], A[1], A[4], A[7], A[2], A[5], A[8]


@part
def quaternion(R: Matrix) -> tuple[Three, float]:
    """Return vector and scalar part, up to a common factor: Shepperd's choice of the largest element, w >= 0."""
    trace = R[0] + R[4] + R[8]
    k, largest = 3, trace
    for i in range(2, -1, -1):  # of equal elements the first counts
        if R[4 * i] >= largest:
            k, largest = i, R[4 * i]
    if k == 3:
        v, w = (R[7] - R[5], R[2] - R[6], R[3] - R[1]), 1.0 + trace
    elif k == 0:
        v, w = (1.0 + 2.0 * R[0] - trace, R[3] + R[1], R[6] + R[2]), R[7] - R[5]
    elif k == 1:
        v, w = (R[3] + R[1], 1.0 + 2.0 * R[4] - trace, R[7] + R[5]), R[2] - R[6]
    else:
        v, w = (R[6] + R[2], R[7] + R[5], 1.0 + 2.0 * R[8] - trace), R[3] - R[1]
    if w < 0.0:
        return (-v[0], -v[1], -v[2]), -w
    return v, w
