"""What the default backend computes around MuJoCo's step: friction before it, the read-out after it.

Plain forms, which tests hold these to: `grasp_motion.slip_joint_friction`, and `plant.gather` with the read-out methods
of `ImplicitPlant`. The arrays are MuJoCo's own memory; the last three degrees of freedom are the object's.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import IN1, IN2, INT, OUT1, REAL, VOID, WHOLE1, kernel, part
from slip_core.sym3_kernel import Sym3
from slip_core.vector_kernel import Three, three
from slip_sim_bridge.sim.friction_kernel import RHO, STIFFNESS, project, substeps_needed
from slip_sim_bridge.sim.lugre_kernel import bristles

ROOT_MARGIN, MOST_SUBSTEPS = 0.5, 64  # see `friction.substeps_needed`


@part
def solve_half(factor: Array, tree: Any, x: Array) -> None:
    """Replace x by L^-T x, with M = L^T D L as MuJoCo keeps it: rows of L side by side, the diagonal last."""
    n = x.shape[0]
    for step in range(n):
        i = n - 1 - step
        first, count = tree[i], tree[n + i]
        for at in range(first, first + count - 1):
            x[tree[2 * n + at]] -= factor[at] * x[i]


@part
def contact_motion(factor: Array, inverse_diagonal: Array, tree: Any, force: Array, x: float, y: float) -> Any:
    """Return the upper triangle of J M^-1 J^T, and J times the relative part of M^-1 force; `force` is used up."""
    n = force.shape[0]
    half = np.zeros((3, n))
    for k in range(3):
        half[k, n - 3 + k] = 1.0
        solve_half(factor, tree, half[k])
    solve_half(factor, tree, force)
    xx, xy, xz, yy, yz, zz, ax, ay, az = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(n):
        d, a, b, c = inverse_diagonal[j], half[0, j], half[1, j], half[2, j]
        xx += d * a * a
        xy += d * a * b
        xz += d * a * c
        yy += d * b * b
        yz += d * b * c
        zz += d * c * c
        pushed = d * force[j]
        ax += a * pushed
        ay += b * pushed
        az += c * pushed
    ux, uy = xz + y * zz, yz - x * zz
    mobility = (xx + y * (xz + ux), xy - x * xz + y * uy, ux, yy - x * (yz + uy), uy, zz)
    return mobility, (ax + y * az, ay - x * az, az)


@part
def contact_force(
    law: Array, v_free: Three, A_hat: Sym3, normal_force: float, dt: float, state: Three
) -> tuple[Three, Three]:
    """Return force and next state of `friction.solve_contact`."""
    if normal_force <= 0.0:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    rho = law[RHO]
    u_free = (v_free[0], v_free[1], rho * v_free[2])
    if law[STIFFNESS] == 0.0:
        f_hat, _ = project(law, u_free, A_hat, normal_force)
        return (f_hat[0], f_hat[1], rho * f_hat[2]), state
    f_hat, u, z = bristles(law, u_free, A_hat, normal_force, dt, state)
    turn = dt * u[2] / rho
    return (f_hat[0], f_hat[1], rho * f_hat[2]), (z[0] - turn * state[1], z[1] + turn * state[0], z[2])


@kernel(INT(IN1, IN1, WHOLE1, IN1, IN1, IN1, IN1, IN1, IN1, REAL, REAL, INT, INT, OUT1, OUT1))
def friction_step(
    factor: Array, inverse_diagonal: Array, tree: Any, qpos: Array, qvel: Array, bias: Array, stops: Array,
    effort: Array, law: Array, normal_force: float, period: float, substeps: int, keep: int, state: Array,
    applied: Array,
) -> int:  # fmt: skip
    """Write effort and the friction of the coming sub-step to `applied`; return the number of sub-steps of the period.

    Args:
        factor, inverse_diagonal: of the mass matrix, MuJoCo's qLD and qLDiagInv.
        tree: where a row of L begins, how long it is, and the column of every entry; (2 nv + entries,).
        qpos, qvel: joint state, relative joints last; (nv,).
        bias, stops: joint forces of motion and gravity, and of joint stops; (nv,) [N, N m].
        effort: of the arm; (n,) [N m].
        law: see `friction_kernel`.
        normal_force: [N].
        period: the control period [s].
        substeps: into how many steps the period is split; 0 chooses.
        keep: 1 where this is the step's last solution: `state` moves on, otherwise only its second half changes.
        state: of the friction law now, and after the step; (6,) [m].
        applied: joint forces; (nv,) [N, N m].

    Implements: ours: `grasp_motion.slip_joint_friction` in one call.
    """
    nv, n = len(qpos), len(effort)
    force = np.empty(nv)
    for i in range(nv):
        applied[i] = effort[i] if i < n else 0.0
        force[i] = applied[i] - bias[i] + stops[i]
    x, y, _ = three(qpos, n)
    vx, vy, wz = three(qvel, n)
    (xx, xy, xz, yy, yz, zz), (ax, ay, az) = contact_motion(factor, inverse_diagonal, tree, force, x, y)
    rho = law[RHO]
    if substeps == 0:
        whole = (
            period * xx, period * xy, rho * (period * xz),
            period * yy, rho * (period * yz), rho * rho * (period * zz),
        )  # fmt: skip
        substeps = substeps_needed(law, whole, normal_force, ROOT_MARGIN, MOST_SUBSTEPS)
    dt = period / substeps
    A_hat = (dt * xx, dt * xy, rho * (dt * xz), dt * yy, rho * (dt * yz), rho * rho * (dt * zz))
    v_free = (vx + y * wz + dt * ax, vy - x * wz + dt * ay, wz + dt * az)
    (fx, fy, tau), following = contact_force(law, v_free, A_hat, normal_force, dt, (state[0], state[1], state[2]))
    applied[n], applied[n + 1], applied[n + 2] = fx, fy, tau + y * fx - x * fy
    state[3], state[4], state[5] = following
    if keep == 1:
        state[0], state[1], state[2] = following
    return substeps


@kernel(VOID(IN1, IN1, IN1, IN1, IN1, IN1, IN1, IN2, OUT1))
def read_out(
    qpos: Array, qvel: Array, readings: Array, com: Array, turned: Array, spatial: Array, root: Array, p_R_o: Array,
    out: Array,
) -> None:  # fmt: skip
    """Write the record of `plant.Record` to `out`.

    Args:
        qpos, qvel: joint state, relative joints last; (nv,).
        readings: force and torque of the pad's sensors; (6,) [N, N m] {ee}.
        com: of the object; (3,) [m] {w}.
        turned: the grasp's frame {p} on the object; (9,) {p} to {w}.
        spatial: MuJoCo's twist of the object, angular first, at `root`; (6,) [rad/s, m/s] {w}.
        root: centre of mass of the whole tree; (3,) [m] {w}.
        p_R_o: {o} to {p}; (3, 3).
        out: (2 n + 36,).

    Implements: ours: `plant.gather` in one call.
    """
    nv = qpos.shape[0]
    n = nv - 3
    for i in range(n):
        out[i] = qpos[i]
        out[n + i] = qvel[i]
    at = 2 * n
    for i in range(6):
        out[at + i] = -readings[i]
    x, y, theta = three(qpos, n)
    vx, vy, wz = three(qvel, n)
    c, s = math.cos(theta), math.sin(theta)
    for i in range(at + 6, at + 18):
        out[i] = 0.0
    out[at + 6], out[at + 7], out[at + 11] = -c * x - s * y, s * x - c * y, -theta
    out[at + 12], out[at + 13], out[at + 17] = -vx - y * wz, -vy + x * wz, -wz
    for i in range(3):
        out[at + 18 + i] = com[i]
        out[at + 33 + i] = spatial[i]
        for j in range(3):
            total = 0.0
            for k in range(3):
                total += turned[3 * i + k] * p_R_o[k, j]
            out[at + 21 + 3 * i + j] = total
    wx, wy, wz = three(spatial, 0)
    dx, dy, dz = com[0] - root[0], com[1] - root[1], com[2] - root[2]
    out[at + 30] = spatial[3] - (dy * wz - dz * wy)
    out[at + 31] = spatial[4] - (dz * wx - dx * wz)
    out[at + 32] = spatial[5] - (dx * wy - dy * wx)
