"""The variable impedance: gains that fade with slip, the slip activation, the bound on spin, and Lyapunov functions."""

from __future__ import annotations

import math

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.vectors import Spatial, Vec, spatial
from slip_vic_controller.law.gains import Gains


@part
def faded(full: Array, gamma: Array, v_s: Spatial) -> Spatial:
    """Return K_j = K_D,j exp(-gamma_k,j |v_s,j|) for every axis j (and D likewise); (6,), (6,) [s/m, s/rad].

    v_s [m/s, rad/s] is on the axes of the error's coordinates: {w}, and for RPY its angular part on {d}.

    Implements: Eq. (29), the variable K and D.
    """
    g, linear, angular = spatial(gamma), v_s.linear, v_s.angular
    return spatial(full) * Spatial(
        Vec(
            math.exp(-g.linear.x * abs(linear.x)),
            math.exp(-g.linear.y * abs(linear.y)),
            math.exp(-g.linear.z * abs(linear.z)),
        ),
        Vec(
            math.exp(-g.angular.x * abs(angular.x)),
            math.exp(-g.angular.y * abs(angular.y)),
            math.exp(-g.angular.z * abs(angular.z)),
        ),
    )


@part
def slip_activation(gains: Gains, v_s: Spatial) -> float:
    """Return tanh(alpha |v_s|) in [0, 1], |.| as in `slip_speed`, any axes.

    Implements: Eq. (29), tanh(alpha |v_s|).
    """
    return math.tanh(gains.alpha * slip_speed(gains, v_s))


@part
def slip_speed(gains: Gains, v_s: Spatial) -> float:
    """Return the size of a slip velocity [m/s], turning by its characteristic length l, which is 1 m as printed.

    |v_s|^2 = |v_sl|^2 + l^2 |v_sa|^2.
    """
    length = gains.characteristic_length
    linear, angular = v_s.linear, v_s.angular
    return math.sqrt(linear.dot(linear) + length * length * angular.dot(angular))


@part
def limit_spin(limit: float, motion: Spatial) -> Spatial:
    """Return an acceleration with its angular part shortened to `limit` [rad/s^2].

    With an angular stiffness that does not fade, K_o e_o = M_o limit bounds how far the attitude gives way; the printed
    law follows the object's spin wherever it goes.
    """
    size = motion.angular.norm()
    if size > limit:
        return Spatial(motion.linear, (limit / size) * motion.angular)
    return motion


@part
def V_e(gains: Gains, e: Array, e_dot: Array) -> float:
    """Return 1/2 edot' M_D edot + 1/2 e' K_D e [J]; (6,), (6,).

    Implements: Eq. (24).
    """
    M_D, K_D, energy = gains.M_D, gains.K_D, 0.0
    for j in range(3):
        energy += M_D[j] * e_dot[j] * e_dot[j] + M_D[3 + j] * e_dot[3 + j] * e_dot[3 + j]
        energy += K_D[j] * e[j] * e[j] + K_D[3 + j] * e[3 + j] * e[3 + j]
    return 0.5 * energy


@part
def V_s(v_s: Spatial) -> float:
    """Return 1/2 v_s' v_s; [m/s, rad/s].

    Implements: Eq. (30).
    """
    return 0.5 * v_s.dot(v_s)
