"""From the control acceleration to joint torque: operational-space inertia, null space, singularities, limits.

B_x = (J B^-1 J^T)^-1 and the dynamically consistent N are never formed: two Cholesky factors by loops.

An arm with fewer than six joints cannot move the pad in all directions: the law commands those of `given_axes`, and the
others follow from them.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from slip_core.arrays import Array
from slip_core.cholesky import back_substitute, cholesky, forward_substitute
from slip_core.compiled import part
from slip_core.records import Records, WholeArray
from slip_core.vectors import Spatial, mat, put_spatial, spatial
from slip_vic_controller.law.arm import Arm
from slip_vic_controller.law.config import LawConfig
from slip_vic_controller.law.contact import ContactSample
from slip_vic_controller.law.evaluation import Evaluation
from slip_vic_controller.law.paper import control_torque
from slip_vic_controller.sizes import BISECTIONS

LEAST_SQUARE: Final = 1e-8
"""Added to the squared singular values of J in the projection on its null space."""


@part
def joint_torque(
    config: LawConfig, arm: Arm, a_C: Spatial, samples: Records[ContactSample], q: Array, qd: Array, posture: Array,
    out: Evaluation,
) -> tuple[bool, float]:  # fmt: skip
    """Write tau = J^T [B_x (a_C - Jdot qd) - h_ee] + C qd + g + N^T tau_0 and its parts.

    Returns whether all factors exist, and what was added to the diagonal of J B^-1 J^T near a singularity [1/kg].

    Args:
        config: null space and singularity policy.
        arm: at this joint state.
        a_C: control acceleration [m/s^2, rad/s^2] {w}.
        samples: of each contact, of which the own wrench counts.
        q, qd, posture: joint state and posture of the null space; [rad], [rad/s], [rad].
        out: result.

    Implements: Eq. (9), (21), with tau_0 = -k (q - q_0) - d qd, or by a rate.
    """
    n = config.joints
    J, M, given = arm.J[:, :n], arm.M[:n, :n], np.empty(6, np.int64)
    given_axes(J, config.sigma_min, given)
    put_spatial(out.h_ee, mat(arm.rotation) @ spatial(samples[0].wrench))
    put_spatial(out.task, a_C - spatial(arm.jdot_qd))
    for j in range(n):
        out.tau_0[j] = config.nullspace_stiffness * (posture[j] - q[j]) - config.nullspace_damping * qd[j]
    if config.nullspace_rate > 0.0:
        posture_torque_by_rate(config.nullspace_rate, J, M, q, qd, posture, out.tau_0)

    L, Y, y = np.empty((n, n)), np.empty((6, n)), np.empty(n)
    if not cholesky(M, L):  # B = L L^T
        return False, 0.0
    for i in range(6):
        forward_substitute(L, J[i], Y[i])  # Y = J L^-T
        if given[i] == 0:
            Y[i, :], out.task[i] = 0.0, 0.0
    A, C = np.empty((6, 6)), np.empty((6, 6))
    gram(Y, A)  # A = J B^-1 J^T
    leave_out(given, A)
    sigma = smallest_singular_value(J, given, config.sigma_min)
    damping_squared = singularity_damping(sigma, config.sigma_min, config.most_damping)
    if damping_squared > 0.0:
        for i in range(6):
            A[i, i] += damping_squared
    if not cholesky(A, C):  # A = C C^T = B_x^-1
        return False, damping_squared
    forward_substitute(L, out.tau_0, y)
    for i in range(6):
        total = 0.0
        for k in range(n):
            total += Y[i, k] * y[k]
        out.null[i] = total
    solve_factored(C, out.null)  # B_x J B^-1 tau_0
    solve_factored(C, out.task)  # B_x (a_C - Jdot qd)
    force = np.empty(6)
    for i in range(6):
        force[i] = out.task[i] - out.h_ee[i] - out.null[i]
    for j in range(n):
        out.tau[j] = control_torque(arm, force, j) + out.tau_0[j]
    return True, damping_squared


@part
def posture_torque_by_rate(rate: float, J: Array, M: Array, q: Array, qd: Array, posture: Array, tau_0: Array) -> None:
    """Write the torque (n,) [N m] that pulls to a posture at a rate [1/s], independent of the inertia.

    A stiffness -k (q - q_0) comes to rest where q_0 - q has no component in the null space of J. So that the arm rests
    in the same posture, only that component P (q - q_0) pulls. Weighted with M instead, the wrist would move and the
    base stay.

    Args:
        rate: rate [1/s]; J: Jacobian (6, n) {w}; M: inertia (n, n) [kg m^2].
        q, qd, posture: (n,) [rad], [rad/s], [rad].
        tau_0: result.

    Implements: ours: tau_0 = M (-(r/2)^2 P (q - q_0) - r qd), P = 1 - J^T (J J^T)^-1 J.
    """
    n, half = J.shape[1], 0.5 * rate
    G, C, x, back = np.empty((6, 6)), np.empty((6, 6)), np.zeros(6), np.empty(n)
    gram(J, G)
    for i in range(6):
        G[i, i] += LEAST_SQUARE
    for j in range(n):
        back[j] = posture[j] - q[j]
        for i in range(6):
            x[i] += J[i, j] * back[j]
    if cholesky(G, C):
        solve_factored(C, x)
        for j in range(n):
            for i in range(6):
                back[j] -= J[i, j] * x[i]
    for j in range(n):
        tau_0[j] = 0.0
        for k in range(n):
            tau_0[j] += M[j, k] * (half * half * back[k] - rate * qd[k])


@part
def singularity_damping(sigma: float, sigma_min: float, most_damping: float) -> float:
    """Return what is added to the diagonal of J B^-1 J^T: 0 above sigma_min, then (damping (1 - (s/s_min)^2))^2."""
    if sigma >= sigma_min:
        return 0.0
    ratio = sigma / sigma_min
    damping = most_damping * (1.0 - ratio * ratio)
    return damping * damping


@part
def solve_factored(C: Array, x: Array) -> None:
    """Solve C C^T x = b in place, with a lower triangular C."""
    forward_substitute(C, x, x)
    back_substitute(C, x, x)


@part
def gram(Y: Array, S: Array) -> None:
    """Write Y Y^T to `S`; (6, n) -> (6, 6)."""
    for i in range(6):
        for j in range(i + 1):
            total = 0.0
            for k in range(Y.shape[1]):
                total += Y[i, k] * Y[j, k]
            S[i, j] = S[j, i] = total


@part
def given_axes(J: Array, least: float, given: WholeArray) -> None:
    """Write the directions in which an arm can move the pad, 0 or 1 (6,): all, with six joints or more.

    Else x, y, z, then each rotation whose row of the Jacobian is at least `least` long beside those before it.

    Args:
        J: Jacobian (6, n) {w}.
        least: part of a row that counts.
        given: result.
    """
    given[:] = 1
    if J.shape[1] >= 6:
        return
    S = np.empty((6, 6))
    gram(J, S)
    for i in range(6):
        given[i] = 1 if i < 3 or S[i, i] >= least * least else 0
        if given[i] == 1 and S[i, i] > 0.0:
            for k in range(i + 1, 6):
                share = S[k, i] / S[i, i]
                for j in range(i + 1, 6):
                    S[k, j] -= share * S[i, j]


@part
def leave_out(given: WholeArray, S: Array) -> None:
    """Remove the axes that an arm cannot move from a symmetric matrix (6, 6); their diagonal is that of x."""
    for i in range(6):
        if given[i] == 0:
            S[i, :], S[:, i] = 0.0, 0.0
            S[i, i] = S[0, 0]


@part
def smallest_singular_value(J: Array, given: WholeArray, limit: float) -> float:
    """Return the smallest singular value of the `given` rows of J (6, n) where it is below `limit`, else `limit`.

    J J^T - s^2 I has a Cholesky factor exactly where no singular value is below s. At the limit that is nearly always
    so; else bisection finds the s at which it ends.
    """
    S, L = np.empty((6, 6)), np.empty((6, 6))
    gram(J, S)
    leave_out(given, S)
    low, high = 0.0, min(limit, math.sqrt(S[0, 0]))  # no row of J is shorter
    s = high
    for _ in range(BISECTIONS):
        A = S.copy()
        for i in range(6):
            A[i, i] -= s * s
        if cholesky(A, L):
            low = s
        else:
            high = s
        if low == high:
            break
        s = 0.5 * (low + high)
    return s
