"""Orientation error, its rate and the map T_e between them, in two coordinates: LOG and RPY.

Both return the same struct, whose parts satisfy exactly, for a moving desired attitude too,

    omega_ee_dot = omega_d_dot + T_e e_ddot + Theta

so that a_C = a_d + T_e M_D^-1 (-K e - D e_dot) + Theta makes the loop M_D e_ddot + D e_dot + K e = 0.
"""

from __future__ import annotations

import math
from enum import IntEnum, unique
from typing import Final, NamedTuple

from slip_core.compiled import part
from slip_core.vectors import IDENTITY, Mat, Spatial, Vec
from slip_vic_controller.law.rotation import left_jacobian, left_jacobian_inverse, left_jacobian_rate, logarithm

LOG_BRANCH_LIMIT: Final = 1.5 * math.pi
"""|e_o| [rad] up to which the logarithm stays on its branch, so that it does not chatter at pi."""
LOG_REPORT: Final = math.pi - 0.2
"""|e_o| [rad] above which the logarithm is reported as near pi, where it is not unique."""
RPY_DAMPED_BELOW: Final = 0.1
"""|cos(pitch)| below which the inverse of E(phi) is damped (within 5.7 deg of gimbal lock)."""


@unique
class Coordinates(IntEnum):
    """Of the orientation error."""

    LOG = 0  # rotation vector on world axes
    RPY = 1  # roll, pitch, yaw on the axes of the desired attitude, as in the paper


class AttitudeError(NamedTuple):
    """The orientation error and its terms in the law.

    error e_o [rad]; rate edot_o [rad/s]; Theta [rad/s^2] {w}; axes: from those of the error's coordinates to {w};
    coordinates: LOG or RPY; near_singular: near a singularity of T_e or the logarithm, where a fallback is active.
    """

    error: Vec
    rate: Vec
    Theta: Vec
    axes: Mat
    coordinates: int
    near_singular: bool


@part
def attitude_error(
    coordinates: int, R_ee: Mat, R_d: Mat, w_ee: Vec, w_d: Vec, alpha_d: Vec, previous: Vec
) -> AttitudeError:
    """Return the orientation error, current minus desired, in the requested coordinates.

    Args:
        coordinates: LOG or RPY.
        R_ee, R_d: current and desired attitude, to {w}.
        w_ee, w_d: their angular velocities [rad/s] {w}.
        alpha_d: desired angular acceleration [rad/s^2] {w}.
        previous: the error one cycle earlier [rad].
    """
    if coordinates == Coordinates.RPY:
        return rpy_error(R_ee, R_d, w_ee, w_d)
    return log_error(R_ee, R_d, w_ee, w_d, alpha_d, previous)


@part
def log_error(R_ee: Mat, R_d: Mat, w_ee: Vec, w_d: Vec, alpha_d: Vec, previous: Vec) -> AttitudeError:
    """Orientation error as rotation vector e_o = log(R_ee R_d^T) on world axes, current minus desired.

    With R_e = R_ee R_d^T and w_e = w_ee - R_e w_d, the kinematics is w_e = T_e(e_o) edot_o, T_e = J_l, and
    Theta = Tdot_e edot_o + w_e x (R_e w_d) + (R_e - I) alpha_d: the last two come from the rotation of R_d.
    Beyond pi the branch of `previous` is kept up to 1.5 pi (hysteresis), where T_e is still well conditioned.

    Implements: Eq. (23) with sign and coordinates as decided in docs/equations.md.
    """
    R_e = R_ee @ R_d.T()
    e_o = logarithm(R_e)
    angle = e_o.norm()
    if 2.0 * math.pi - angle < LOG_BRANCH_LIMIT and e_o.dot(previous) < 0.0:
        e_o = (1.0 - 2.0 * math.pi / angle) * e_o
    w_d_turned = R_e @ w_d
    w_e = w_ee - w_d_turned
    rate = left_jacobian_inverse(e_o, w_e)
    Theta = left_jacobian_rate(e_o, rate) + w_e.cross(w_d_turned) + (R_e @ alpha_d - alpha_d)
    return AttitudeError(e_o, rate, Theta, IDENTITY, Coordinates.LOG.value, e_o.norm() > LOG_REPORT)


@part
def rpy_error(R_ee: Mat, R_d: Mat, w_ee: Vec, w_d: Vec) -> AttitudeError:
    """Orientation error as roll, pitch, yaw of R_d^T R_ee = Rz(yaw) Ry(pitch) Rx(roll), on desired axes.

    The kinematics is w_ee - w_d = T_e edot_o with T_e = R_d E(phi), and Theta = Tdot_e edot_o, which contains
    w_d x (w_ee - w_d) from the rotation of R_d. Near pitch = +-90 deg E^-1 is damped, so edot_o stays bounded.

    Implements: Eq. (23) with T_e = R_d T_phi.
    """
    phi = roll_pitch_yaw(R_d.T() @ R_ee)
    rate = rpy_rates_inverse(phi) @ (R_d.T() @ (w_ee - w_d))
    Theta = w_d.cross(R_d @ (rpy_rates(phi) @ rate)) + R_d @ rpy_rates_rate(phi, rate)
    return AttitudeError(phi, rate, Theta, R_d, Coordinates.RPY.value, abs(math.cos(phi.y)) < RPY_DAMPED_BELOW)


@part
def T_e(attitude: AttitudeError, z: Spatial) -> Spatial:
    """Return T_e z: the angular part from the coordinates of the error to {w}; [m, rad] or its rates."""
    if attitude.coordinates == Coordinates.RPY:
        return Spatial(z.linear, attitude.axes @ (rpy_rates(attitude.error) @ z.angular))
    return Spatial(z.linear, left_jacobian(attitude.error, z.angular))


@part
def T_e_inverse(coordinates: int, error: Vec, R_d: Mat, z: Spatial) -> Spatial:
    """Return T_e^-1 z, bounded: the angular part from {w} to the coordinates of an error e_o [rad]; R_d to {w}."""
    if coordinates == Coordinates.RPY:
        return Spatial(z.linear, rpy_rates_inverse(error) @ (R_d.T() @ z.angular))
    return Spatial(z.linear, left_jacobian_inverse(error, z.angular))


@part
def on_error_axes(attitude: AttitudeError, v: Spatial) -> Spatial:
    """Return a twist {w} with its angular part on the axes of the error's coordinates."""
    if attitude.coordinates == Coordinates.RPY:
        return Spatial(v.linear, attitude.axes.T() @ v.angular)
    return v


@part
def roll_pitch_yaw(R: Mat) -> Vec:
    """Return (roll, pitch, yaw) [rad] with R = Rz(yaw) Ry(pitch) Rx(roll): the angles of Eq. (2) in URDF's order."""
    return Vec(
        math.atan2(R.z.y, R.z.z), math.atan2(-R.z.x, math.sqrt(R.x.x * R.x.x + R.y.x * R.y.x)), math.atan2(R.y.x, R.x.x)
    )


@part
def rpy_rates(phi: Vec) -> Mat:
    """Return E with omega = E(phi) phi_dot on fixed axes; phi = roll, pitch, yaw [rad].

    Implements: Eq. (5), its T_phi for roll, pitch, yaw.
    """
    cp, sp, cy, sy = math.cos(phi.y), math.sin(phi.y), math.cos(phi.z), math.sin(phi.z)
    return Mat(Vec(cy * cp, -sy, 0.0), Vec(sy * cp, cy, 0.0), Vec(-sp, 0.0, 1.0))


@part
def rpy_rates_inverse(phi: Vec) -> Mat:
    """Return the bounded inverse of E(phi): 1 / cos(pitch) is damped below RPY_DAMPED_BELOW, continuously."""
    cp, sp, cy, sy = math.cos(phi.y), math.sin(phi.y), math.cos(phi.z), math.sin(phi.z)
    ratio = cp / RPY_DAMPED_BELOW
    share = 1.0 - ratio * ratio if abs(cp) < RPY_DAMPED_BELOW else 0.0
    damping = RPY_DAMPED_BELOW * share
    k = cp / (cp * cp + damping * damping)
    return Mat(Vec(cy * k, sy * k, 0.0), Vec(-sy, cy, 0.0), Vec(cy * sp * k, sy * sp * k, 1.0))


@part
def rpy_rates_rate(phi: Vec, rate: Vec) -> Vec:
    """Return (d/dt E(phi)) phi_dot; [rad], [rad/s] -> [rad/s^2].

    Implements: Eq. (6), its Tdot_phi phi_dot for roll, pitch, yaw.
    """
    cp, sp, cy, sy = math.cos(phi.y), math.sin(phi.y), math.cos(phi.z), math.sin(phi.z)
    return Vec(
        (-sy * cp * rate.z - cy * sp * rate.y) * rate.x - cy * rate.z * rate.y,
        (cy * cp * rate.z - sy * sp * rate.y) * rate.x - sy * rate.z * rate.y,
        -cp * rate.y * rate.x,
    )
