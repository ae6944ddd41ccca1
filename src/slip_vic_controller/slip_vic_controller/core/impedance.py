"""The variable impedance: gains that fade with slip, the gate, the compensation and the control acceleration."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slip_msgs_py.arrays import Array


class Gains(NamedTuple):
    """Gains of the law, diagonals as vectors, linear part first.

    K_D (6,) [N/m, N m/rad]; D_D (6,) [N s/m, N m s/rad]; M_D (6,) [kg, kg m2]; gamma_k, gamma_d (6,) [s/m, s/rad];
    alpha [s/m]; k_s [1/s]. Classical impedance control has alpha = 0 and gamma = 0.
    """

    K_D: Array
    D_D: Array
    M_D: Array
    gamma_k: Array
    gamma_d: Array
    alpha: float
    k_s: float


def fading_gain(full: Array, gamma: Array, v_s: Array) -> Array:
    """Return K_D,j exp(-gamma_k |v_s,j|) for every axis j (and D likewise); (6,) each.

    v_s (6,) [m/s, rad/s] is on the axes of the error's coordinates: {w}, and for rpy its angular part on {d}.

    Implements: Eq. (29), the variable K and D.
    """
    return full * np.exp(-gamma * np.abs(v_s))


def gate(alpha: float, v_s: Array) -> float:
    """Return tanh(alpha |v_s|), |.| the norm of the 6-vector; (6,) [m/s, rad/s] any axes -> [0, 1].

    Implements: Eq. (29), tanh(alpha |v_s|).
    """
    return math.tanh(alpha * math.sqrt(v_s.dot(v_s)))


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
