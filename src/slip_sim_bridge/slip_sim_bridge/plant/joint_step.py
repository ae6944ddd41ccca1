"""Torques by which drives and friction hold or move the joints in a step, compiled.

A joint has a wanted velocity w at the end of the step and a torque tau within bounds that brings it there:

    v' = v_free + dt M^-1 tau,    v' = w where lower < tau < upper,    v' <= w at the upper bound, v' >= w at the lower

Coulomb friction is w = 0 and bounds of +-F: a joint sticks exactly below F, and slides under F above. A drive that
takes velocities or positions has the w of its own loop, and the bounds that its effort limit and the joint's friction
leave.
Viscous friction -b v' is implicit where a joint slides. All joints are solved together, as a linear complementarity
problem by principal pivoting (Murty 1974; A is positive definite, so it ends), because M couples them.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import IN1, INT, OUT2, REAL, WHOLE1, kernel, part
from slip_core.records import Real, Record, Records, WholeArray, dtype_of, records

FRICTION, VELOCITY, POSITION = 0, 1, 2
BLOCK_PASSES: Final = 20
"""Passes in which all joints change at once; then one at a time, which cannot cycle."""
PASSES: Final = 500
DRIVE_PASSES: Final = 60
AGREEMENT: Final = 1e-10
"""Passes over grasps and drives until no torque changes by more [N m]."""
ROUNDING: Final = 1e-12
"""Of a bound or velocity: what is not taken for a violation."""


class JointDrive(Record):
    """One joint in a step."""

    mode: Real
    """FRICTION: the effort is applied from outside; VELOCITY, POSITION: the drive's own loop moves the joint."""
    command: Real
    """[rad/s] or [rad]."""
    bandwidth: Real
    """Of the drive's loop [rad/s]."""
    coulomb: Real
    """[N m]."""
    viscous: Real
    """[N m s/rad]."""
    limit: Real
    """Of the drive's effort [N m]."""
    torque: Real
    """tau of the step, friction included [N m]."""
    effort: Real
    """Of the drive without friction [N m]; 0 in mode FRICTION."""


JOINT_DRIVE = dtype_of(JointDrive)
JOINT_DRIVE_SIZE = JOINT_DRIVE.itemsize // 8
TORQUE: Final = (JOINT_DRIVE.names or ()).index("torque")


@part
def solve_half(factor: Array, tree: WholeArray, x: Array) -> None:
    """Replace x by L^-T x, with M = L^T D L as MuJoCo keeps it: rows of L side by side, the diagonal last."""
    n = x.shape[0]
    for step in range(n):
        i = n - 1 - step
        first, count = tree[i], tree[n + i]
        for at in range(first, first + count - 1):
            x[tree[2 * n + at]] -= factor[at] * x[i]


@part
def wanted_velocity(joint: JointDrive, q: float, v: float, dt: float) -> float:
    """Return w: first-order lag of the joint behind its command, exact for a step of dt; q [rad], v [rad/s]."""
    share = 1.0 - math.exp(-joint.bandwidth * dt)
    if joint.mode == VELOCITY:
        return v + share * (joint.command - v)
    if joint.mode == POSITION:
        return share * (joint.command - q) / dt
    return 0.0


@part
def eliminate(A: Array, x: Array) -> None:
    """Solve A y = x in place by elimination with row pivots; A (n, n) is used up, x (n,) becomes y."""
    n = len(x)
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        if best != k:
            for j in range(n):
                A[k, j], A[best, j] = A[best, j], A[k, j]
            x[k], x[best] = x[best], x[k]
        for i in range(k + 1, n):
            share = A[i, k] / A[k, k]
            if share != 0.0:
                for j in range(k, n):
                    A[i, j] -= share * A[k, j]
                x[i] -= share * x[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            x[k] -= A[k, j] * x[j]
        x[k] /= A[k, k]


@kernel(INT, IN1, IN1, WHOLE1, IN1, IN1, IN1, REAL, OUT2)
def joint_step(
    factor: Array, inverse_diagonal: Array, tree: WholeArray, qpos: Array, qvel: Array, force: Array, dt: float,
    drives: Array,
) -> int:  # fmt: skip
    """Write torque and effort of each joint's drive; return how many passes it took, or 0 where they are not finite.

    Args:
        factor, inverse_diagonal, tree: of the mass matrix, as in `rigid_step`.
        qpos, qvel: joint state; the joints with drives come first; (nq,), (nv,).
        force: all joint forces but these torques, bias subtracted; (nv,) [N, N m].
        dt: [s].
        drives: a JOINT_DRIVE per joint; (n, 8).
    """
    joints: Records[JointDrive] = records(drives, JOINT_DRIVE)
    n, nv = len(joints), len(qvel)
    half, pushed = np.zeros((n, nv)), force.copy()
    solve_half(factor, tree, pushed)
    for i in range(n):
        half[i, i] = 1.0
        solve_half(factor, tree, half[i])
    A, v_free = np.empty((n, n)), np.empty(n)
    wanted, lower, upper, damping = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        joint, total = joints[i], 0.0
        for k in range(nv):
            total += half[i, k] * inverse_diagonal[k] * pushed[k]
        v_free[i] = qvel[i] + dt * total
        for j in range(n):
            total = 0.0
            for k in range(nv):
                total += half[i, k] * inverse_diagonal[k] * half[j, k]
            A[i, j] = dt * total
        w = wanted_velocity(joint, qpos[i], qvel[i], dt)
        wanted[i], damping[i] = w, joint.viscous
        upper[i], lower[i] = joint.coulomb, -joint.coulomb
        if joint.mode != FRICTION:  # what friction takes of the effort, or adds to it where the joint is braked
            loss = joint.viscous * w
            slip = joint.coulomb if w > 0.0 else -joint.coulomb if w < 0.0 else 0.0
            still = joint.coulomb if w == 0.0 else 0.0
            damping[i] = 0.0
            upper[i], lower[i] = joint.limit - slip - loss + still, -joint.limit - slip - loss - still
    side, torque, system = np.zeros(n), np.empty(n), np.empty((n, n))  # side: 0 at w, +-1 at a bound
    for i in range(n):
        side[i] = 2.0 if upper[i] == lower[i] else 0.0
    for run in range(PASSES):
        for i in range(n):
            for j in range(n):
                system[i, j] = A[i, j] if side[i] == 0.0 else damping[i] * A[i, j]
            if side[i] == 0.0:
                torque[i] = wanted[i] - v_free[i]
            else:
                system[i, i] += 1.0
                torque[i] = (upper[i] if side[i] > 0.0 else lower[i]) - damping[i] * v_free[i]
        eliminate(system, torque)
        changed = False
        for i in range(n):
            if side[i] == 2.0 or (changed and run >= BLOCK_PASSES):
                continue
            now = side[i]
            if now == 0.0:
                margin = ROUNDING * max(abs(upper[i]), abs(lower[i]))
                now = 1.0 if torque[i] > upper[i] + margin else -1.0 if torque[i] < lower[i] - margin else 0.0
            else:
                v = v_free[i]
                for j in range(n):
                    v += A[i, j] * torque[j]
                if (v - wanted[i]) * now > ROUNDING * max(abs(v_free[i]), abs(wanted[i])):
                    now = 0.0
            if now != side[i]:
                side[i], changed = now, True
        if not changed:
            break
    finite = True
    for i in range(n):
        joint = joints[i]
        joint.torque = torque[i]
        finite = finite and math.isfinite(torque[i])
        joint.effort = 0.0
        if joint.mode != FRICTION:
            w = wanted[i]
            slip = joint.coulomb if w > 0.0 else -joint.coulomb if w < 0.0 else 0.0
            joint.effort = min(max(torque[i] + slip + joint.viscous * w, -joint.limit), joint.limit)
    return run + 1 if finite else 0
