"""Orientation error, its rate and the map T_e between them, in two coordinates: `log` and `rpy`.

Both return the same record, whose parts satisfy exactly, for a moving desired attitude too,

    omega_ee_dot = omega_d_dot + T_e e_ddot + Theta

so that a_C = a_d + T_e M^-1 (-K e - D e_dot) + Theta makes the loop M e_ddot + D e_dot + K e = 0.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slip_core.arrays import Array
from slip_vic_controller.core.rotation import cross, left_jacobian, left_jacobian_inverse, left_jacobian_rate, log_so3

LOG_BRANCH_LIMIT = 1.5 * math.pi
"""|e_o| [rad] up to which the logarithm stays on its branch, so that it does not jump to and fro at pi."""
LOG_REPORT = math.pi - 0.2
"""|e_o| [rad] from which the logarithm reports that it is near the half turn where it is not unique."""
RPY_DAMPED_BELOW = 0.1
"""|cos(pitch)| below which the inverse of E(phi) is damped (within 5.7 deg of gimbal lock)."""


class AttitudeError(NamedTuple):
    """The orientation error and what the law needs of it.

    error e_o (3,) [rad]; rate edot_o (3,) [rad/s]; T_e (3, 3); T_e_inverse (3, 3), bounded; Theta (3,) [rad/s^2] {w};
    axes (3, 3): rotation from the axes of the error's coordinates to {w}; near_singular: the fallback is at work.
    """

    error: Array
    rate: Array
    T_e: Array
    T_e_inverse: Array
    Theta: Array
    axes: Array
    near_singular: bool


def log_error(R_ee: Array, R_d: Array, w_ee: Array, w_d: Array, alpha_d: Array, previous: Array) -> AttitudeError:
    """Orientation error as rotation vector e_o = log(R_ee R_d^T) on world axes, current minus desired.

    With R_e = R_ee R_d^T and w_e = w_ee - R_e w_d, the kinematics is w_e = T_e(e_o) edot_o, T_e = J_l, and
    Theta = Tdot_e edot_o + w_e x (R_e w_d) + (R_e - I) alpha_d: the last two come from the rotation of R_d.
    Beyond pi the branch of `previous` is kept up to 1.5 pi (hysteresis), where T_e is still well conditioned.

    Args:
        R_ee, R_d: current and desired attitude; (3, 3) to {w}.
        w_ee, w_d: their angular velocities; (3,) [rad/s] {w}.
        alpha_d: desired angular acceleration; (3,) [rad/s^2] {w}.
        previous: the error one tick earlier; (3,) [rad] {w}.

    Implements: Eq. (23) with sign and coordinates as decided in docs/equations.md.
    """
    R_e = R_ee.dot(R_d.T)
    e_o = log_so3(R_e)
    angle = math.sqrt(e_o.dot(e_o))
    if 2.0 * math.pi - angle < LOG_BRANCH_LIMIT and e_o.dot(previous) < 0.0:
        e_o = e_o * (1.0 - 2.0 * math.pi / angle)
        angle = 2.0 * math.pi - angle
    follow = R_e.dot(w_d)
    w_e = w_ee - follow
    T_e_inverse = left_jacobian_inverse(e_o)
    rate = T_e_inverse.dot(w_e)
    Theta = left_jacobian_rate(e_o, rate) + cross(w_e, follow) + (R_e.dot(alpha_d) - alpha_d)
    return AttitudeError(e_o, rate, left_jacobian(e_o), T_e_inverse, Theta, _WORLD, angle > LOG_REPORT)


def rpy_error(R_ee: Array, R_d: Array, w_ee: Array, w_d: Array) -> AttitudeError:
    """Orientation error as roll, pitch, yaw of R_d^T R_ee = Rz(yaw) Ry(pitch) Rx(roll), on desired axes.

    The kinematics is w_ee - w_d = T_e edot_o with T_e = R_d E(phi), and Theta = Tdot_e edot_o, which contains
    w_d x (w_ee - w_d) from the rotation of R_d. Near pitch = +-90 deg E^-1 is damped, so edot_o stays bounded.

    Args:
        R_ee, R_d: current and desired attitude; (3, 3) to {w}.
        w_ee, w_d: their angular velocities; (3,) [rad/s] {w}.

    Implements: Eq. (23) with T_e = R_d T_phi.
    """
    phi = rpy_from_matrix(R_d.T @ R_ee)
    E, E_inverse, near = rpy_rate_matrix(phi)
    w_e = w_ee - w_d
    T_e_inverse = E_inverse @ R_d.T
    rate = T_e_inverse @ w_e
    T_e = R_d @ E
    Theta = cross(w_d, T_e @ rate) + R_d @ rpy_rate_matrix_rate(phi, rate)
    return AttitudeError(phi, rate, T_e, T_e_inverse, Theta, R_d, near)


def rpy_from_matrix(R: Array) -> Array:
    """Return (roll, pitch, yaw) with R = Rz(yaw) Ry(pitch) Rx(roll); (3, 3) -> (3,) [rad].

    Implements: ours: the angles of Eq. (2) in the order URDF uses.
    """
    (r00, _, _), (r10, _, _), (r20, r21, r22) = R.tolist()
    return np.array([math.atan2(r21, r22), math.atan2(-r20, math.hypot(r00, r10)), math.atan2(r10, r00)])


def rpy_rate_matrix(phi: Array) -> tuple[Array, Array, bool]:
    """Return E with omega = E(phi) phi_dot on fixed axes, its bounded inverse, and whether that is damped; (3,) [rad].

    Implements: Eq. (5), its T_phi for roll, pitch, yaw.
    """
    _, pitch, yaw = phi.tolist()
    cp, sp, cy, sy = math.cos(pitch), math.sin(pitch), math.cos(yaw), math.sin(yaw)
    E = np.array([[cy * cp, -sy, 0.0], [sy * cp, cy, 0.0], [-sp, 0.0, 1.0]])
    damped = abs(cp) < RPY_DAMPED_BELOW
    share = 1.0 - (cp / RPY_DAMPED_BELOW) ** 2 if damped else 0.0
    k = cp / (cp * cp + (RPY_DAMPED_BELOW * share) ** 2)
    E_inverse = np.array([[cy * k, sy * k, 0.0], [-sy, cy, 0.0], [cy * sp * k, sy * sp * k, 1.0]])
    return E, E_inverse, damped


def rpy_rate_matrix_rate(phi: Array, phi_dot: Array) -> Array:
    """Return (d/dt E(phi)) phi_dot; (3,) [rad], (3,) [rad/s] -> (3,) [rad/s^2].

    Implements: Eq. (6), its Tdot_phi phi_dot for roll, pitch, yaw.
    """
    _, pitch, yaw = phi.tolist()
    roll_dot, pitch_dot, yaw_dot = phi_dot.tolist()
    cp, sp, cy, sy = math.cos(pitch), math.sin(pitch), math.cos(yaw), math.sin(yaw)
    return np.array(
        [
            (-sy * cp * yaw_dot - cy * sp * pitch_dot) * roll_dot - cy * yaw_dot * pitch_dot,
            (cy * cp * yaw_dot - sy * sp * pitch_dot) * roll_dot - sy * yaw_dot * pitch_dot,
            -cp * pitch_dot * roll_dot,
        ]
    )


_WORLD = np.eye(3)
_WORLD.setflags(write=False)
