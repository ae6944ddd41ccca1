"""Closed forms for symmetric 3x3 matrices in plain floats: for plain formulas and for kernels."""

from __future__ import annotations

import math

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.vector_kernel import Three

Sym3 = tuple[float, float, float, float, float, float]
"""Upper triangle (xx, xy, xz, yy, yz, zz)."""


def scaled_upper(A: Array, rho: float) -> Sym3:
    """Return the upper triangle of S A S with S = diag(1, 1, rho); (3, 3) -> 6 floats, unit of A, pad axes.

    Implements: ours: A_hat of the limit-surface projection, where a metre of slip and a turned pad weigh alike.
    """
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = A.tolist()
    return xx, xy, rho * xz, yy, rho * yz, rho * rho * zz


def solve(matrix: Sym3, right: Three) -> Three:
    """Return x with matrix x = right by cofactors; 6 floats, (3,) -> (3,), any unit and frame.

    Implements: ours: Cramer's rule; the matrices here are positive definite and of order 3.
    """
    xx, xy, xz, yy, yz, zz = matrix
    bx, by, bz = right
    cxx, cxy, cxz = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    cyy, cyz, czz = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    k = 1.0 / (xx * cxx + xy * cxy + xz * cxz)
    return (
        k * (cxx * bx + cxy * by + cxz * bz),
        k * (cxy * bx + cyy * by + cyz * bz),
        k * (cxz * bx + cyz * by + czz * bz),
    )


def multiply(matrix: Sym3, x: Three) -> Three:
    """Return matrix x; 6 floats, (3,) -> (3,), any unit and frame.

    Implements: ours: product with an upper triangle.
    """
    xx, xy, xz, yy, yz, zz = matrix
    a, b, c = x
    return xx * a + xy * b + xz * c, xy * a + yy * b + yz * c, xz * a + yz * b + zz * c


def largest_eigenvalue(matrix: Sym3) -> float:
    """Return the largest eigenvalue; 6 floats -> unit of the matrix.

    Implements: ours: trigonometric solution of the characteristic cubic.
    """
    xx, xy, xz, yy, yz, zz = matrix
    mean = (xx + yy + zz) / 3.0
    a, b, c = xx - mean, yy - mean, zz - mean
    spread = math.sqrt((a * a + b * b + c * c + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0)
    if spread <= 1e-14 * abs(mean):
        return mean
    half_det = (a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz)) / (
        2.0 * spread * spread * spread
    )
    return mean + 2.0 * spread * math.cos(math.acos(max(-1.0, min(1.0, half_det))) / 3.0)


solve_of = part(solve)
multiply_of = part(multiply)
largest_eigenvalue_of = part(largest_eigenvalue)
