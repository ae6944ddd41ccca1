"""Vectors, matrices and spatial vectors with operators: one definition that Python runs and the compiler compiles.

`a + b`, `a - b`, `-a`, `k * a`, `a * b` and `a / b` by components, `a.dot(b)`, `a.cross(b)`, `a.norm()`, `R @ a`,
`A @ B`, `R.T()`, `A.solve(b)` of a symmetric matrix. Arrays and records keep the numbers; `vec`, `mat` and `spatial`
read them, `put` and `put_mat` write.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeVar

from slip_core.arrays import Array
from slip_core.compiled import part

T = TypeVar("T", bound=type)
Turned = TypeVar("Turned", "Vec", "Mat", "Spatial")

ALGEBRAS: list[type] = []


def algebra(cls: T) -> T:
    """Register the operators and methods of a named tuple for the compiler, which compiles the methods."""
    cls.__array_ufunc__ = None  # type: ignore[attr-defined]  # a numpy number times a Vec is a Vec, not an array
    ALGEBRAS.append(cls)
    return cls


@algebra
class Vec(NamedTuple):
    """Three components on the axes of one frame."""

    x: float
    y: float
    z: float

    def __add__(self, other: Vec) -> Vec:  # type: ignore[override]
        return Vec(self.x + other.x, self.y + other.y, self.z + other.z)

    def __sub__(self, other: Vec) -> Vec:
        return Vec(self.x - other.x, self.y - other.y, self.z - other.z)

    def __neg__(self) -> Vec:
        return Vec(-self.x, -self.y, -self.z)

    def __mul__(self, other: Vec) -> Vec:  # type: ignore[override]
        return Vec(self.x * other.x, self.y * other.y, self.z * other.z)

    def __truediv__(self, other: Vec) -> Vec:
        return Vec(self.x / other.x, self.y / other.y, self.z / other.z)

    def __rmul__(self, k: float) -> Vec:  # type: ignore[override]
        return Vec(k * self.x, k * self.y, k * self.z)

    def dot(self, other: Vec) -> float:
        """Return the scalar product."""
        return self.x * other.x + self.y * other.y + self.z * other.z

    def cross(self, other: Vec) -> Vec:
        """Return self x other."""
        return Vec(
            self.y * other.z - self.z * other.y,
            self.z * other.x - self.x * other.z,
            self.x * other.y - self.y * other.x,
        )

    def norm(self) -> float:
        """Return the length."""
        return math.sqrt(self.x * self.x + self.y * self.y + self.z * self.z)

    def turned_by(self, A: Mat) -> Vec:
        """Return A self; write it `A @ v`."""
        return Vec(A.x.dot(self), A.y.dot(self), A.z.dot(self))


@algebra
class Mat(NamedTuple):
    """A matrix (3, 3): its rows."""

    x: Vec
    y: Vec
    z: Vec

    def __matmul__(self, other: Turned) -> Turned:
        return other.turned_by(self)

    def T(self) -> Mat:
        """Return the transpose."""
        return Mat(
            Vec(self.x.x, self.y.x, self.z.x), Vec(self.x.y, self.y.y, self.z.y), Vec(self.x.z, self.y.z, self.z.z)
        )

    def turned_by(self, A: Mat) -> Mat:
        """Return A self; write it `A @ B`."""
        x, y, z = self.x, self.y, self.z
        return Mat(
            Vec(
                A.x.x * x.x + A.x.y * y.x + A.x.z * z.x,
                A.x.x * x.y + A.x.y * y.y + A.x.z * z.y,
                A.x.x * x.z + A.x.y * y.z + A.x.z * z.z,
            ),
            Vec(
                A.y.x * x.x + A.y.y * y.x + A.y.z * z.x,
                A.y.x * x.y + A.y.y * y.y + A.y.z * z.y,
                A.y.x * x.z + A.y.y * y.z + A.y.z * z.z,
            ),
            Vec(
                A.z.x * x.x + A.z.y * y.x + A.z.z * z.x,
                A.z.x * x.y + A.z.y * y.y + A.z.z * z.y,
                A.z.x * x.z + A.z.y * y.z + A.z.z * z.z,
            ),
        )


@algebra
class Spatial(NamedTuple):
    """A twist, wrench or acceleration: linear and angular part, or force and torque, on the same axes."""

    linear: Vec
    angular: Vec

    def __add__(self, other: Spatial) -> Spatial:  # type: ignore[override]
        return Spatial(self.linear + other.linear, self.angular + other.angular)

    def __sub__(self, other: Spatial) -> Spatial:
        return Spatial(self.linear - other.linear, self.angular - other.angular)

    def __neg__(self) -> Spatial:
        return Spatial(-self.linear, -self.angular)

    def __mul__(self, other: Spatial) -> Spatial:  # type: ignore[override]
        return Spatial(self.linear * other.linear, self.angular * other.angular)

    def __truediv__(self, other: Spatial) -> Spatial:
        return Spatial(self.linear / other.linear, self.angular / other.angular)

    def __rmul__(self, k: float) -> Spatial:  # type: ignore[override]
        return Spatial(k * self.linear, k * self.angular)

    def dot(self, other: Spatial) -> float:
        """Return the scalar product of both parts: the power of a wrench along a twist."""
        return self.linear.dot(other.linear) + self.angular.dot(other.angular)

    def turned_by(self, A: Mat) -> Spatial:
        """Return both parts turned; write it `R @ s`."""
        return Spatial(A @ self.linear, A @ self.angular)


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


ZERO = Vec(0.0, 0.0, 0.0)
IDENTITY = Mat(Vec(1.0, 0.0, 0.0), Vec(0.0, 1.0, 0.0), Vec(0.0, 0.0, 1.0))
NOTHING = Spatial(ZERO, ZERO)


@part
def vec(a: Array) -> Vec:
    """Return the vector in an array (3,)."""
    return Vec(a[0], a[1], a[2])


@part
def mat(A: Array) -> Mat:
    """Return the matrix in an array (3, 3)."""
    return Mat(Vec(A[0, 0], A[0, 1], A[0, 2]), Vec(A[1, 0], A[1, 1], A[1, 2]), Vec(A[2, 0], A[2, 1], A[2, 2]))


@part
def spatial(a: Array) -> Spatial:
    """Return the linear and angular part in an array (6,)."""
    return Spatial(Vec(a[0], a[1], a[2]), Vec(a[3], a[4], a[5]))


@part
def put(a: Array, v: Vec) -> None:
    """Write a vector to an array (3,)."""
    a[0], a[1], a[2] = v.x, v.y, v.z


@part
def put_mat(a: Array, A: Mat) -> None:
    """Write a matrix to an array (3, 3)."""
    put(a[0], A.x)
    put(a[1], A.y)
    put(a[2], A.z)


@part
def put_spatial(a: Array, s: Spatial) -> None:
    """Write linear and angular part to an array (6,)."""
    put(a[:3], s.linear)
    put(a[3:], s.angular)


@part
def quaternion(R: Mat) -> tuple[Vec, float]:
    """Return vector and scalar part, up to a common factor: Shepperd's choice of the largest element, w >= 0."""
    xx, yy, zz = R.x.x, R.y.y, R.z.z
    trace = xx + yy + zz
    v, w = Vec(R.z.y - R.y.z, R.x.z - R.z.x, R.y.x - R.x.y), 1.0 + trace
    if xx >= trace and xx >= yy and xx >= zz:  # of equal elements the first counts
        v, w = Vec(1.0 + 2.0 * xx - trace, R.y.x + R.x.y, R.z.x + R.x.z), R.z.y - R.y.z
    elif yy >= trace and yy >= zz:
        v, w = Vec(R.y.x + R.x.y, 1.0 + 2.0 * yy - trace, R.z.y + R.y.z), R.x.z - R.z.x
    elif zz >= trace:
        v, w = Vec(R.z.x + R.x.z, R.z.y + R.y.z, 1.0 + 2.0 * zz - trace), R.y.x - R.x.y
    return (-v, -w) if w < 0.0 else (v, w)


@part
def symmetric(A: Mat) -> Sym:
    """Return a matrix that is symmetric; its upper triangle counts."""
    return Sym(A.x.x, A.x.y, A.x.z, A.y.y, A.y.z, A.z.z)


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
