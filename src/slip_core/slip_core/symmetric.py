"""Symmetric matrices of order 3 with operators: closed forms for inertias and contact mobilities."""

from __future__ import annotations

import math
from typing import NamedTuple

from slip_core.compiled import part
from slip_core.vectors import Vec, algebra


@algebra
class Sym(NamedTuple):
    """A symmetric matrix (3, 3): its upper triangle, by rows. `A @ v`, `k * A`, `A.solve(v)`."""

    xx: float
    xy: float
    xz: float
    yy: float
    yz: float
    zz: float

    def __rmul__(self, k: float) -> Sym:  # type: ignore[override]
        return Sym(k * self.xx, k * self.xy, k * self.xz, k * self.yy, k * self.yz, k * self.zz)

    def __matmul__(self, v: Vec) -> Vec:
        return Vec(
            self.xx * v.x + self.xy * v.y + self.xz * v.z,
            self.xy * v.x + self.yy * v.y + self.yz * v.z,
            self.xz * v.x + self.yz * v.y + self.zz * v.z,
        )

    def solve(self, right: Vec) -> Vec:
        """Return x with self x = right, by cofactors; the matrices here are positive definite."""
        cxx = self.yy * self.zz - self.yz * self.yz
        cxy = self.xz * self.yz - self.xy * self.zz
        cxz = self.xy * self.yz - self.xz * self.yy
        cyy = self.xx * self.zz - self.xz * self.xz
        cyz = self.xy * self.xz - self.xx * self.yz
        czz = self.xx * self.yy - self.xy * self.xy
        k = 1.0 / (self.xx * cxx + self.xy * cxy + self.xz * cxz)
        return k * Vec(
            cxx * right.x + cxy * right.y + cxz * right.z,
            cxy * right.x + cyy * right.y + cyz * right.z,
            cxz * right.x + cyz * right.y + czz * right.z,
        )


@part
def with_diagonal(d: float, A: Sym) -> Sym:
    """Return d I + A."""
    return Sym(d + A.xx, A.xy, A.xz, d + A.yy, A.yz, d + A.zz)


@part
def largest_eigenvalue(A: Sym) -> float:
    """Return the largest eigenvalue: trigonometric solution of the characteristic cubic."""
    mean = (A.xx + A.yy + A.zz) / 3.0
    a, b, c = A.xx - mean, A.yy - mean, A.zz - mean
    spread = math.sqrt((a * a + b * b + c * c + 2.0 * (A.xy * A.xy + A.xz * A.xz + A.yz * A.yz)) / 6.0)
    if spread <= 1e-14 * abs(mean):
        return mean
    half_det = (a * (b * c - A.yz * A.yz) - A.xy * (A.xy * c - A.yz * A.xz) + A.xz * (A.xy * A.yz - b * A.xz)) / (
        2.0 * spread * spread * spread
    )
    return mean + 2.0 * spread * math.cos(math.acos(max(-1.0, min(1.0, half_det))) / 3.0)
