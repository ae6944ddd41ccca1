"""`operational.joint_torque` once more, as parts of the tick's kernel: Cholesky factors by loops."""

from __future__ import annotations

import math

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.small_kernel import back_substitute, cholesky, forward_substitute


@part
def torque_of(
    M: Array, bias: Array, J: Array, force: Array, h_ee: Array, tau_0: Array, sigma_min: float, most_damping: float,
    task: Array, null: Array, torque: Array,
) -> tuple[bool, float]:  # fmt: skip
    """Write the joint torque to `torque`; return whether all factors exist, and the damping^2 that was added.

    Args:
        M, bias, J, h_ee, tau_0: as of `joint_torque`.
        force: a_C - Jdot qd; (6,).
        sigma_min, most_damping: the singularity policy.
        task, null: B_x (a_C - Jdot qd), and what the task would feel of tau_0; (6,) [N, N m] {w}.
        torque: (n,) [N m].
    """
    n = M.shape[0]
    L, Y = np.empty((n, n)), np.empty((6, n))  # M = L L^T; Y = J L^-T
    if not cholesky(M, L):
        return False, 0.0
    for i in range(6):
        forward_substitute(L, J[i], Y[i])
    A, C = np.empty((6, 6)), np.empty((6, 6))
    for i in range(6):
        for j in range(i + 1):
            total = 0.0
            for k in range(n):
                total += Y[i, k] * Y[j, k]
            A[i, j] = A[j, i] = total
    damping_squared = 0.0
    sigma = smallest_singular_value_below(J, sigma_min)
    if sigma < sigma_min:
        ratio = sigma / sigma_min
        damping_squared = (most_damping * (1.0 - ratio * ratio)) ** 2
        for i in range(6):
            A[i, i] += damping_squared
    if not cholesky(A, C):
        return False, damping_squared
    # tau_0 - J^T A^-1 J M^-1 tau_0: what of it the task does not feel
    y = np.empty(n)
    forward_substitute(L, tau_0, y)
    for i in range(6):
        total = 0.0
        for k in range(n):
            total += Y[i, k] * y[k]
        null[i] = total
    forward_substitute(C, null, null)
    back_substitute(C, null, null)
    forward_substitute(C, force, task)
    back_substitute(C, task, task)
    for j in range(n):
        total = 0.0
        for i in range(6):
            total += J[i, j] * (task[i] - h_ee[i] - null[i])
        torque[j] = total + bias[j] + tau_0[j]
    return True, damping_squared


@part
def smallest_singular_value_below(J: Array, limit: float) -> float:
    """Return the smallest singular value of J (6, n) where it is below `limit`, else `limit`.

    J J^T - limit^2 I has a Cholesky factor exactly where no singular value is below the limit: cheap, and nearly
    always the case. The value itself comes from Jacobi rotations, cyclic until nothing is left beside the diagonal.
    """
    S, L = np.empty((6, 6)), np.empty((6, 6))
    _gram(J, S)
    for i in range(6):
        S[i, i] -= limit * limit
    if cholesky(S, L):
        return limit
    for i in range(6):
        S[i, i] += limit * limit
    return min(_root_of_smallest(S), limit)


@part
def smallest_singular_value(J: Array) -> float:
    """Return the smallest singular value of J (6, n)."""
    S = np.empty((6, 6))
    _gram(J, S)
    return _root_of_smallest(S)


@part
def _gram(J: Array, S: Array) -> None:
    """Write J J^T to `S`."""
    for i in range(6):
        for j in range(i + 1):
            total = 0.0
            for k in range(J.shape[1]):
                total += J[i, k] * J[j, k]
            S[i, j] = S[j, i] = total


@part
def _root_of_smallest(S: Array) -> float:
    """Return the square root of the smallest eigenvalue of S (6, 6), which is made diagonal."""
    for _ in range(_SWEEPS):
        off, size = 0.0, 0.0
        for p in range(6):
            size += S[p, p] * S[p, p]
            for q in range(p + 1, 6):
                off += S[p, q] * S[p, q]
        if not off > 1e-32 * size:
            break
        for p in range(5):
            for q in range(p + 1, 6):
                _rotate(S, p, q)
    smallest = S[0, 0]
    for i in range(1, 6):
        smallest = min(smallest, S[i, i])
    return math.sqrt(max(smallest, 0.0))


@part
def _rotate(S: Array, p: int, q: int) -> None:
    """Make S[p, q] zero by a rotation of rows and columns p and q."""
    if S[p, q] == 0.0:
        return
    theta = 0.5 * (S[q, q] - S[p, p]) / S[p, q]
    t = math.copysign(1.0, theta) / (abs(theta) + math.sqrt(theta * theta + 1.0))
    c = 1.0 / math.sqrt(t * t + 1.0)
    s = t * c
    for k in range(6):
        a, b = S[k, p], S[k, q]
        S[k, p], S[k, q] = c * a - s * b, s * a + c * b
    for k in range(6):
        a, b = S[p, k], S[q, k]
        S[p, k], S[q, k] = c * a - s * b, s * a + c * b


_SWEEPS = 30
