"""The law of the paper, Eq. (21) to (30), as printed: one function for each equation that a cycle evaluates.

Names and signs are those of docs/equations.md, which has the few places where the printed text is not consistent. Eq.
(22) and (25) are the arm's response to these, (26) and (27) steps of the proof; the orientation error of Eq. (23) is in
attitude.py. Our extensions are in extensions.py. Vectors are {w} unless stated otherwise, linear part first.
"""

from __future__ import annotations

import math

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.vectors import Mat, Spatial, Vec, spatial
from slip_vic_controller.law.arm import Arm
from slip_vic_controller.law.attitude import AttitudeError, T_e, T_e_inverse
from slip_vic_controller.law.gains import Gains


@part
def control_torque(arm: Arm, force: Array, j: int) -> float:
    """Return the torque of joint j [N m], J^T force + C qd + g, with force = B_x (a_C - Jdot qd) - h_ee; (6,) [N, N m].

    Implements: Eq. (21) in joint space.
    """
    total = 0.0
    for i in range(6):
        total += arm.J[i, j] * force[i]
    return total + arm.bias[j]


@part
def impedance(attitude: AttitudeError, gains: Gains, K: Spatial, D: Spatial, e: Spatial, e_dot: Spatial) -> Spatial:
    """Return Z = T_e M_D^-1 (-K e - D e_dot) [m/s^2, rad/s^2].

    Args:
        attitude: orientation error, for T_e.
        gains: M_D.
        K, D: diagonals in effect [N/m, N m/rad], [N s/m, N m s/rad].
        e, e_dot: pose error, current minus desired, and its rate, in the coordinates of the error.

    Implements: Eq. (23), (28), the impedance.
    """
    return T_e(attitude, -(K * e + D * e_dot) / spatial(gains.M_D))


@part
def control_acceleration(a_d: Spatial, Z: Spatial, Theta: Spatial, compensation: Spatial) -> Spatial:
    """Return a_C = a_d + Z + Theta + T_e M_D^-1 Lambda [m/s^2, rad/s^2]; the last term is the gated compensation.

    Implements: Eq. (23), (28), the sum.
    """
    return a_d + Z + Theta + compensation


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
def slip_activation(alpha: float, speed: float) -> float:
    """Return tanh(alpha |v_s|) in [0, 1]; alpha [s/m], |v_s| [m/s] by `extensions.slip_speed`.

    Implements: Eq. (29), tanh(alpha |v_s|).
    """
    return math.tanh(alpha * speed)


@part
def compensation(follow: Spatial, k_s: float, v_s: Spatial, Theta: Spatial) -> Spatial:
    """Return Phi2 - k_s v_s - P (v_ee - v_s) - G^T B_o^-1 (g_o + h_o) - Theta [m/s^2, rad/s^2], before the gate.

    Args:
        follow: G^T a_o + Phi2, which the terms with P and B_o come to.
        k_s: decay rate of slip [1/s].
        v_s: slip velocity.
        Theta: as in Eq. (28); all on one frame's axes.

    Implements: Eq. (29), the bracket of Lambda.
    """
    return follow - k_s * v_s - Theta


@part
def Lambda(coordinates: int, e_o: Vec, R_d: Mat, gains: Gains, compensation: Spatial) -> Spatial:
    """Return M_D T_e^-1 times the gated compensation [N, N m], bounded near the singularity of T_e.

    Args:
        coordinates: of the orientation error, LOG or RPY.
        e_o: orientation error [rad].
        R_d: desired attitude, to {w}.
        gains: M_D.
        compensation: gated [m/s^2, rad/s^2].

    Implements: Eq. (29), Lambda.
    """
    return spatial(gains.M_D) * T_e_inverse(coordinates, e_o, R_d, compensation)


@part
def V_s(v_s: Spatial) -> float:
    """Return 1/2 v_s' v_s; [m/s, rad/s].

    Implements: Eq. (30).
    """
    return 0.5 * v_s.dot(v_s)
