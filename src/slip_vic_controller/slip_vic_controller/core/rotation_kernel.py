"""The scalar functions of rotation vectors, and vectors of three floats: for plain formulas and for kernels."""

from __future__ import annotations

import math

from slip_msgs_py.arrays import Array
from slip_msgs_py.compiled import part

Three = tuple[float, float, float]
Matrix = tuple[float, float, float, float, float, float, float, float, float]

SERIES_BELOW = 0.01
"""theta^2 [rad^2] below which the series is used: its first left-out term is below 1e-16 there."""


def coefficients(t: float) -> tuple[float, float, float, float]:
    """Return a = (1 - cos theta) / theta^2, b = (theta - sin theta) / theta^3, a'(theta) / theta, b'(theta) / theta.

    t = theta^2 [rad^2].

    Implements: ours: what exponential, J_l and its rate are made of.
    """
    if t < SERIES_BELOW:
        return (
            1 / 2 - t * (1 / 24 - t * (1 / 720 - t * (1 / 40320 - t / 3628800))),
            1 / 6 - t * (1 / 120 - t * (1 / 5040 - t * (1 / 362880 - t / 39916800))),
            -1 / 12 + t * (1 / 180 - t * (1 / 6720 - t / 453600)),
            -1 / 60 + t * (1 / 1260 - t * (1 / 60480 - t / 4989600)),
        )
    theta = math.sqrt(t)
    sinc = math.sin(theta) / theta
    a = (1.0 - math.cos(theta)) / t
    b = (1.0 - sinc) / t
    return a, b, (sinc - 2.0 * a) / t, (a - 3.0 * b) / t


def inverse_coefficient(t: float) -> float:
    """Return c with J_l^-1 = I - S(phi) / 2 + c S(phi)^2; t = theta^2 [rad^2].

    Implements: ours: (1 - theta/2 cot(theta/2)) / theta^2.
    """
    if t < SERIES_BELOW:
        return 1 / 12 + t * (1 / 720 + t * (1 / 30240 + t * (1 / 1209600 + t / 47900160)))
    half = 0.5 * math.sqrt(t)
    return (1.0 - half * math.cos(half) / math.sin(half)) / t


coefficients_of = part(coefficients)
inverse_coefficient_of = part(inverse_coefficient)


@part
def three(v: Array, i: int) -> Three:
    """Return v[i : i + 3] as floats."""
    return v[i], v[i + 1], v[i + 2]


@part
def nine(v: Array, i: int) -> Matrix:
    """Return the matrix whose rows begin at v[i]."""
    return v[i], v[i + 1], v[i + 2], v[i + 3], v[i + 4], v[i + 5], v[i + 6], v[i + 7], v[i + 8]


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
def exponential(phi: Three) -> Matrix:
    """Return `rotation.exp_so3` of phi [rad]."""
    x, y, z = phi
    t = x * x + y * y + z * z
    a, b, _, _ = coefficients_of(t)
    d, k = 1.0 - t * a, 1.0 - t * b
    xy, xz, yz = a * x * y, a * x * z, a * y * z
    return (
        d + a * x * x, xy - k * z, xz + k * y,
        xy + k * z, d + a * y * y, yz - k * x,
        xz - k * y, yz + k * x, d + a * z * z,
    )  # fmt: skip


@part
def jacobian_product(phi: Three, rate: Three) -> Three:
    """Return `rotation.left_jacobian_product`."""
    a, b, _, _ = coefficients_of(dot(phi, phi))
    n = vec_cross(phi, rate)
    return add(rate, add(times(a, n), times(b, vec_cross(phi, n))))


@part
def jacobian_rate_product(phi: Three, rate: Three) -> Three:
    """Return `rotation.left_jacobian_rate`."""
    _, b, a_slope, b_slope = coefficients_of(dot(phi, phi))
    along = dot(phi, rate)
    n = vec_cross(phi, rate)
    return add(times(a_slope * along, n), vec_cross(add(times(b_slope * along, phi), times(b, rate)), n))


@part
def logarithm(R: Matrix) -> Three:
    """Return `rotation.log_so3` of R."""
    v, w = (R[7] - R[5], R[2] - R[6], R[3] - R[1]), 1.0 + R[0] + R[4] + R[8]
    if w <= 1.0:
        v, w = _quaternion(R)
    size = norm(v)
    k = 2.0 * math.atan2(size, w) / size if size > 1e-12 else 2.0 / w
    return times(k, v)


@part
def _quaternion(R: Matrix) -> tuple[Three, float]:
    """Return vector and scalar part, up to a common factor, where the angle is beyond 90 degrees."""
    if R[0] >= R[4] and R[0] >= R[8]:
        v, w = (1.0 + R[0] - R[4] - R[8], R[3] + R[1], R[6] + R[2]), R[7] - R[5]
    elif R[4] >= R[8]:
        v, w = (R[1] + R[3], 1.0 + R[4] - R[8] - R[0], R[7] + R[5]), R[2] - R[6]
    else:
        v, w = (R[2] + R[6], R[5] + R[7], 1.0 + R[8] - R[0] - R[4]), R[3] - R[1]
    if w < 0.0:
        return (-v[0], -v[1], -v[2]), -w
    return v, w
