"""The variable impedance: gains that fade with slip, the gate, the compensation and the control acceleration."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slip_core.arrays import Array


class Gains(NamedTuple):
    """Gains of the law, diagonals as vectors, linear part first.

    K_D (6,) [N/m, N m/rad]; D_D (6,) [N s/m, N m s/rad]; M_D (6,) [kg, kg m2]; gamma_k, gamma_d (6,) [s/m, s/rad];
    alpha [s/m]; k_s [1/s]. Classical impedance control has alpha = 0 and gamma = 0. spin_lever [m]: what makes turning
    a slip speed in the gate; spin_limit [rad/s^2]: most that the compensation may turn; printed: 1 and infinite.
    """

    K_D: Array
    D_D: Array
    M_D: Array
    gamma_k: Array
    gamma_d: Array
    alpha: float
    k_s: float
    spin_lever: float = 1.0
    spin_limit: float = math.inf


def fading_gain(full: Array, gamma: Array, v_s: Array) -> Array:
    """Return K_D,j exp(-gamma_k |v_s,j|) for every axis j (and D likewise); (6,) each.

    v_s (6,) [m/s, rad/s] is on the axes of the error's coordinates: {w}, and for rpy its angular part on {d}.

    Implements: Eq. (29), the variable K and D.
    """
    return full * np.exp(-gamma * np.abs(v_s))


def gate(alpha: float, v_s: Array, spin_lever: float = 1.0) -> float:
    """Return tanh(alpha |v_s|), |.| the norm of the 6-vector; (6,) [m/s, rad/s] any axes -> [0, 1].

    Args:
        alpha: steepness [s/m].
        v_s: slip velocity.
        spin_lever: metres that turn rad/s into m/s; 1 as printed.

    Implements: Eq. (29), tanh(alpha |v_s|).
    """
    if spin_lever == 1.0:
        return math.tanh(alpha * math.sqrt(v_s.dot(v_s)))
    linear, angular = v_s[:3], v_s[3:]
    return math.tanh(alpha * math.sqrt(linear.dot(linear) + spin_lever**2 * angular.dot(angular)))


def limit_spin(limit: float, gated: Array) -> Array:
    """Return the gated compensation with its angular part shortened to `limit` [rad/s^2]; (6,) {w} -> (6,) {w}.

    With an angular stiffness that does not fade, K_o e_o = M_o limit bounds how far the attitude gives way.

    Implements: ours: the printed law follows the object's spin wherever it goes.
    """
    size = math.sqrt(gated[3:].dot(gated[3:]))
    if size <= limit:
        return gated
    return np.concatenate((gated[:3], (limit / size) * gated[3:]))


def compensation(k_s: float, v_s: Array, Phi2: Array, follow: Array, Theta: Array) -> Array:
    """Return Phi2 - k_s v_s + G^T a_o - Theta; (6,) [m/s^2, rad/s^2] {w}.

    `follow` = G^T a_o = -P (v_ee - v_s) - G^T B_o^-1 (g_o + h_o): follow the object, and push slip to zero.

    Implements: Eq. (29), the bracket.
    """
    return Phi2 - k_s * v_s + follow - Theta


def project(R_ee: Array, axes: Array, motion: Array) -> Array:
    """Return diag(R S R^T, R S R^T) motion, S = diag(axes) on pad axes; (3, 3), (6,) 0 or 1, (6,) {w} -> (6,) {w}.

    Implements: ours: comp acts only where the contact can slip; all axes 1 = the printed law.
    """
    on_pad = motion.reshape(2, 3).dot(R_ee) * axes.reshape(2, 3)
    return on_pad.dot(R_ee.T).reshape(6)


def impedance(gains: Gains, K: Array, D: Array, e: Array, e_dot: Array) -> Array:
    """Return M_D^-1 (-K e - D e_dot), in the coordinates of the error; (6,) each.

    Implements: Eq. (28), the bracket without Lambda.
    """
    return -(K * e + D * e_dot) / gains.M_D
