"""Rotation vectors: the scalar functions of plain formulas and kernels, and parts of kernels."""

from __future__ import annotations

import math

from slip_core.compiled import part
from slip_core.vector_kernel import Matrix, Three, add, dot, norm, quaternion, times, vec_cross

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
        v, w = quaternion(R)
    size = norm(v)
    k = 2.0 * math.atan2(size, w) / size if size > 1e-12 else 2.0 / w
    return times(k, v)
