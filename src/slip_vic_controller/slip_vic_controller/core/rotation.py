"""Rotations as matrices and rotation vectors: exponential, logarithm and the Jacobian between them.

Everything is a closed form in t = theta^2 with a series below 0.1 rad, so nothing divides by a small angle.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slip_msgs_py.arrays import Array, quat_xyzw_from_matrix

SERIES_BELOW = 0.01
"""theta^2 [rad^2] below which the series is used: its first left-out term is below 1e-16 there."""


class _Coefficients(NamedTuple):
    a: float  # (1 - cos theta) / theta^2
    b: float  # (theta - sin theta) / theta^3
    a_rate: float  # a'(theta) / theta
    b_rate: float  # b'(theta) / theta


def _coefficients(t: float) -> _Coefficients:
    if t < SERIES_BELOW:
        return _Coefficients(
            1 / 2 - t * (1 / 24 - t * (1 / 720 - t * (1 / 40320 - t / 3628800))),
            1 / 6 - t * (1 / 120 - t * (1 / 5040 - t * (1 / 362880 - t / 39916800))),
            -1 / 12 + t * (1 / 180 - t * (1 / 6720 - t / 453600)),
            -1 / 60 + t * (1 / 1260 - t * (1 / 60480 - t / 4989600)),
        )
    theta = math.sqrt(t)
    sinc = math.sin(theta) / theta
    a = (1.0 - math.cos(theta)) / t
    b = (1.0 - sinc) / t
    return _Coefficients(a, b, (sinc - 2.0 * a) / t, (a - 3.0 * b) / t)


def _matrix(d: float, k: float, c: float, phi: Array) -> Array:
    """Return d I + k S(phi) + c phi phi^T, the form of all four matrices below."""
    x, y, z = phi.tolist()
    cx, cy, kx, ky, kz = c * x, c * y, k * x, k * y, k * z
    xy, xz, yz = cx * y, cx * z, cy * z
    return np.array(
        [
            [d + cx * x, xy - kz, xz + ky],
            [xy + kz, d + cy * y, yz - kx],
            [xz - ky, yz + kx, d + c * z * z],
        ]
    )


def cross(a: Array, b: Array) -> Array:
    """Return a x b; (3,), (3,) -> (3,), one frame.

    Implements: ours: the S(a) b of Eq. (10) to (17) without building the matrix.
    """
    ax, ay, az = a.tolist()
    bx, by, bz = b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def exp_so3(phi: Array) -> Array:
    """Return the rotation matrix of a rotation vector; (3,) [rad] -> (3, 3), on the axes of phi.

    Implements: ours: Rodrigues' formula, for slip displacement and reference attitudes.
    """
    t = float(phi @ phi)
    k = _coefficients(t)
    return _matrix(1.0 - t * k.a, 1.0 - t * k.b, k.a, phi)


def log_so3(R: Array) -> Array:
    """Return the rotation vector of a rotation matrix, angle in [0, pi]; (3, 3) -> (3,) [rad].

    Implements: ours: through the quaternion, so exact to rounding from 0 to pi.
    """
    q = quat_xyzw_from_matrix(R)
    v = q[:3]
    norm = math.sqrt(v @ v)
    if norm < 1e-9:
        return np.asarray(2.0 * v)
    return np.asarray(v * (2.0 * math.atan2(norm, q[3]) / norm))


def left_jacobian(phi: Array) -> Array:
    """Return J_l with omega = J_l(phi) phi_dot for R = exp(phi), omega on fixed axes; (3,) [rad] -> (3, 3).

    Implements: Eq. (5), its T_phi in rotation-vector coordinates.
    """
    t = float(phi @ phi)
    k = _coefficients(t)
    return _matrix(1.0 - t * k.b, k.a, k.b, phi)


def left_jacobian_inverse(phi: Array) -> Array:
    """Return J_l^-1(phi) in closed form; (3,) [rad] -> (3, 3); singular only at |phi| = 2 pi.

    Implements: ours: phi_dot = J_l^-1 omega without a matrix inversion.
    """
    t = float(phi @ phi)
    if t < SERIES_BELOW:
        c = 1 / 12 + t * (1 / 720 + t * (1 / 30240 + t * (1 / 1209600 + t / 47900160)))
    else:
        half = 0.5 * math.sqrt(t)
        c = (1.0 - half * math.cos(half) / math.sin(half)) / t
    return _matrix(1.0 - t * c, -0.5, c, phi)


def left_jacobian_rate(phi: Array, phi_dot: Array) -> Array:
    """Return (d/dt J_l(phi)) phi_dot; (3,) [rad], (3,) [rad/s] -> (3,) [rad/s^2].

    Implements: Eq. (6), its Tdot_phi phi_dot in rotation-vector coordinates.
    """
    t = float(phi @ phi)
    k = _coefficients(t)
    turn = cross(phi, phi_dot)
    rate = float(phi @ phi_dot)
    return (k.a_rate * rate) * turn + (k.b_rate * rate) * cross(phi, turn) + k.b * cross(phi_dot, turn)
