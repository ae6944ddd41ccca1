"""Rotations as matrices and rotation vectors: exponential, logarithm and the Jacobian between them.

Everything is a closed form in t = theta^2 with a series below 0.1 rad, so nothing divides by a small angle.
"""

from __future__ import annotations

import math

import numpy as np

from slip_core.arrays import Array, quat_xyzw_from_matrix
from slip_vic_controller.core.rotation_kernel import coefficients, inverse_coefficient


def _matrix(d: float, k: float, c: float, phi: Array) -> Array:
    """Return d I + k S(phi) + c phi phi^T, the form of all four matrices below."""
    x, y, z = phi.tolist()
    cx, cy, kx, ky, kz = c * x, c * y, k * x, k * y, k * z
    xy, xz, yz = cx * y, cx * z, cy * z
    flat = (d + cx * x, xy - kz, xz + ky, xy + kz, d + cy * y, yz - kx, xz - ky, yz + kx, d + c * z * z)
    return np.array(flat).reshape(3, 3)


def cross(a: Array, b: Array) -> Array:
    """Return a x b; (3,), (3,) -> (3,), one frame.

    Implements: ours: the S(a) b of Eq. (10) to (17) without building the matrix.
    """
    ax, ay, az = a.tolist()
    bx, by, bz = b.tolist()
    return np.array((ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx))


def exp_so3(phi: Array) -> Array:
    """Return the rotation matrix of a rotation vector; (3,) [rad] -> (3, 3), on the axes of phi.

    Implements: ours: Rodrigues' formula, for slip displacement and reference attitudes.
    """
    t = float(phi.dot(phi))
    a, b, _, _ = coefficients(t)
    return _matrix(1.0 - t * a, 1.0 - t * b, a, phi)


def log_so3(R: Array) -> Array:
    """Return the rotation vector of a rotation matrix, angle in [0, pi]; (3, 3) -> (3,) [rad].

    Implements: ours: through the quaternion (up to its norm), so exact to rounding from 0 to pi.
    """
    (r00, r01, r02), (r10, r11, r12), (r20, r21, r22) = R.tolist()
    x, y, z, w = r21 - r12, r02 - r20, r10 - r01, 1.0 + r00 + r11 + r22
    if w <= 1.0:
        x, y, z, w = quat_xyzw_from_matrix(R).tolist()
    norm = math.sqrt(x * x + y * y + z * z)
    k = 2.0 * math.atan2(norm, w) / norm if norm > 1e-12 else 2.0 / w
    return np.array((k * x, k * y, k * z))


def left_jacobian(phi: Array) -> Array:
    """Return J_l with omega = J_l(phi) phi_dot for R = exp(phi), omega on fixed axes; (3,) [rad] -> (3, 3).

    Implements: Eq. (5), its T_phi in rotation-vector coordinates.
    """
    t = float(phi.dot(phi))
    a, b, _, _ = coefficients(t)
    return _matrix(1.0 - t * b, a, b, phi)


def left_jacobian_product(phi: Array, phi_dot: Array) -> Array:
    """Return J_l(phi) phi_dot without the matrix; (3,) [rad], (3,) [rad/s] -> (3,) [rad/s].

    With n = phi x phi_dot it is phi_dot + a n + b phi x n.

    Implements: Eq. (5), its T_phi phi_dot in rotation-vector coordinates.
    """
    x, y, z = phi.tolist()
    u, v, w = phi_dot.tolist()
    a, b, _, _ = coefficients(x * x + y * y + z * z)
    nx, ny, nz = y * w - z * v, z * u - x * w, x * v - y * u
    px, py, pz = b * x, b * y, b * z
    return np.array((u + a * nx + py * nz - pz * ny, v + a * ny + pz * nx - px * nz, w + a * nz + px * ny - py * nx))


def left_jacobian_inverse(phi: Array) -> Array:
    """Return J_l^-1(phi) in closed form; (3,) [rad] -> (3, 3); singular only at |phi| = 2 pi.

    Implements: ours: phi_dot = J_l^-1 omega without a matrix inversion.
    """
    t = float(phi.dot(phi))
    c = inverse_coefficient(t)
    return _matrix(1.0 - t * c, -0.5, c, phi)


def left_jacobian_rate(phi: Array, phi_dot: Array) -> Array:
    """Return (d/dt J_l(phi)) phi_dot; (3,) [rad], (3,) [rad/s] -> (3,) [rad/s^2].

    With n = phi x phi_dot it is a' n + b' phi x n + b phi_dot x n, where a' and b' are the rates of a and b.

    Implements: Eq. (6), its Tdot_phi phi_dot in rotation-vector coordinates.
    """
    x, y, z = phi.tolist()
    u, v, w = phi_dot.tolist()
    _, b, a_slope, b_slope = coefficients(x * x + y * y + z * z)
    along = x * u + y * v + z * w
    a_rate, b_rate = a_slope * along, b_slope * along
    nx, ny, nz = y * w - z * v, z * u - x * w, x * v - y * u
    px, py, pz = b_rate * x + b * u, b_rate * y + b * v, b_rate * z + b * w
    return np.array((a_rate * nx + py * nz - pz * ny, a_rate * ny + pz * nx - px * nz, a_rate * nz + px * ny - py * nx))
