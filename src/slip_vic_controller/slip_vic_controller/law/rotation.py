"""Rotations and rotation vectors: exponential, logarithm, the left Jacobian J_l between their rates, and its rate.

Everything is a closed form in t = theta^2 with a series below 0.1 rad, so nothing divides by a small angle.
"""

from __future__ import annotations

import math
from typing import Final

from slip_core.compiled import part
from slip_core.vectors import Mat, Vec, quaternion

SERIES_BELOW: Final = 0.01
"""theta^2 [rad^2] below which the series is used: its first left-out term is below 1e-16 there."""


@part
def coefficients(t: float) -> tuple[float, float, float, float]:
    """Return a = (1 - cos theta) / theta^2, b = (theta - sin theta) / theta^3, a'(theta) / theta, b'(theta) / theta.

    t = theta^2 [rad^2]. Exponential, J_l and its rate are made of these four.
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


@part
def inverse_coefficient(t: float) -> float:
    """Return c = (1 - theta/2 cot(theta/2)) / theta^2, with J_l^-1 = I - S(phi)/2 + c S(phi)^2; t = theta^2 [rad^2]."""
    if t < SERIES_BELOW:
        return 1 / 12 + t * (1 / 720 + t * (1 / 30240 + t * (1 / 1209600 + t / 47900160)))
    half = 0.5 * math.sqrt(t)
    return (1.0 - half * math.cos(half) / math.sin(half)) / t


@part
def exponential(phi: Vec) -> Mat:
    """Return the rotation matrix of a rotation vector phi [rad], on the axes of phi: Rodrigues' formula."""
    x, y, z = phi.x, phi.y, phi.z
    t = phi.dot(phi)
    a, b, _, _ = coefficients(t)
    d, k = 1.0 - t * a, 1.0 - t * b
    xy, xz, yz = a * x * y, a * x * z, a * y * z
    return Mat(
        Vec(d + a * x * x, xy - k * z, xz + k * y),
        Vec(xy + k * z, d + a * y * y, yz - k * x),
        Vec(xz - k * y, yz + k * x, d + a * z * z),
    )


@part
def logarithm(R: Mat) -> Vec:
    """Return the rotation vector [rad] of a rotation matrix, its angle in [0, pi]; exact to rounding from 0 to pi."""
    v, w = Vec(R.z.y - R.y.z, R.x.z - R.z.x, R.y.x - R.x.y), 1.0 + R.x.x + R.y.y + R.z.z
    if w <= 1.0:
        v, w = quaternion(R)
    size = v.norm()
    k = 2.0 * math.atan2(size, w) / size if size > 1e-12 else 2.0 / w
    return k * v


@part
def left_jacobian(phi: Vec, rate: Vec) -> Vec:
    """Return omega = J_l(phi) phi_dot for R = exp(phi), omega on fixed axes; [rad], [rad/s] -> [rad/s].

    Implements: Eq. (5), its T_phi in rotation-vector coordinates.
    """
    a, b, _, _ = coefficients(phi.dot(phi))
    n = phi.cross(rate)
    return rate + (a * n + b * phi.cross(n))


@part
def left_jacobian_inverse(phi: Vec, omega: Vec) -> Vec:
    """Return phi_dot = J_l(phi)^-1 omega; [rad], [rad/s] -> [rad/s]; singular only at |phi| = 2 pi."""
    n = phi.cross(omega)
    return (omega - 0.5 * n) + inverse_coefficient(phi.dot(phi)) * phi.cross(n)


@part
def left_jacobian_rate(phi: Vec, rate: Vec) -> Vec:
    """Return (d/dt J_l(phi)) phi_dot; [rad], [rad/s] -> [rad/s^2].

    Implements: Eq. (6), its Tdot_phi phi_dot in rotation-vector coordinates.
    """
    _, b, a_slope, b_slope = coefficients(phi.dot(phi))
    along = phi.dot(rate)
    n = phi.cross(rate)
    return (a_slope * along) * n + ((b_slope * along) * phi + b * rate).cross(n)
