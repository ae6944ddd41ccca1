"""From the control acceleration to joint torque: operational-space inertia, null space, singularities, limits."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dposv, dsyev

from slip_core.arrays import Array


class TorqueTerms(NamedTuple):
    """Joint torque and its parts; torque, task, null (n,) [N m]; force (6,) B_x (a_C - Jdot qd) [N, N m] {w}.

    sigma_min: smallest singular value of J; damping_squared: what was added to J B^-1 J^T; solved: False where a
    factorisation failed and the torque means nothing.
    """

    torque: Array
    task: Array
    null: Array
    force: Array
    sigma_min: float
    damping_squared: float
    solved: bool


class SingularityPolicy(NamedTuple):
    """Below `sigma_min` (singular value of J) damping grows smoothly from 0 to `damping`^2 [1/kg]."""

    sigma_min: float
    damping: float


def joint_torque(
    M: Array, bias: Array, J: Array, jdot_qd: Array, a_C: Array, h_ee: Array, tau_0: Array, policy: SingularityPolicy
) -> TorqueTerms:
    """Return tau = J^T [B_x (a_C - Jdot qd) - h_ee] + C qd + g + N^T tau_0.

    B_x = (J B^-1 J^T)^-1 and the dynamically consistent N are never formed: two Cholesky solves.

    Args:
        M: joint-space inertia B(q); (n, n) [kg m2].
        bias: C qd + g; (n,) [N m].
        J: Jacobian of {ee}; (6, n) {w}.
        jdot_qd: Jdot qd; (6,) [m/s^2, rad/s^2] {w}.
        a_C: control acceleration; (6,) [m/s^2, rad/s^2] {w}.
        h_ee: wrench of the object on the robot; (6,) [N, N m] {w}.
        tau_0: posture torque before projection; (n,) [N m].
        policy: damping near singularities.

    Implements: Eq. (21), (9).
    """
    _, X, info_M = dposv(M, J.T)
    A = J.dot(X)
    sigma = smallest_singular_value(J)
    damping_squared = singularity_damping(sigma, policy)
    if damping_squared > 0.0:
        A[np.diag_indices(6)] += damping_squared
    right = np.empty((6, 2), order="F")
    right[:, 0] = a_C - jdot_qd
    right[:, 1] = X.T.dot(tau_0)
    _, solution, info_A = dposv(A, right)
    force = solution[:, 0]
    task = J.T.dot(force - h_ee)
    null = tau_0 - J.T.dot(solution[:, 1])
    return TorqueTerms(task + bias + null, task, null, force, sigma, damping_squared, info_M == 0 and info_A == 0)


def smallest_singular_value(J: Array) -> float:
    """Return the smallest singular value of J, from the eigenvalues of J J^T; (6, n) -> >= 0.

    Implements: ours: how far the arm is from a singularity.
    """
    return math.sqrt(max(float(dsyev(J.dot(J.T), compute_v=0)[0][0]), 0.0))


def singularity_damping(sigma: float, policy: SingularityPolicy) -> float:
    """Return the damping added to the diagonal of J B^-1 J^T: 0 above sigma_min, then (damping (1 - (s/s_min)^2))^2.

    Implements: ours: damped near singularities, continuous in sigma, and reported.
    """
    if sigma >= policy.sigma_min:
        return 0.0
    return (policy.damping * (1.0 - (sigma / policy.sigma_min) ** 2)) ** 2


def posture_torque(q: Array, qd: Array, posture: Array, stiffness: float, damping: float) -> Array:
    """Return tau_0 = -k (q - q_0) - d qd; (n,) [rad], [rad/s] -> (n,) [N m].

    Implements: ours: what the seventh joint does while the task does not mind.
    """
    return stiffness * (posture - q) - damping * qd
