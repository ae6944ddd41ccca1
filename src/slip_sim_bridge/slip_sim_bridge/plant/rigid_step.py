"""The implicit step of the rigid grasp, compiled: friction before MuJoCo's step, and the read-out after it.

The object hangs on the pad centre by three relative joints: slide x, slide y, hinge z, the last three degrees of
freedom. The contact twist of the object relative to the pad is v = J [x', y', theta'], J = [[1, 0, y], [0, 1, -x],
[0, 0, 1]], and a step changes it by v = v_free + dt J M^-1 J^T f, which the friction law solves. The slip of the
control law is the opposite: v_s = -v, pad relative to object. The arrays are MuJoCo's own memory.
"""

from __future__ import annotations

import functools
import math
from typing import Any, Final

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import IN1, IN2, INT, OUT1, OUT2, REAL, VOID, WHOLE1, kernel, part
from slip_core.records import Real, Record, Vec3, WholeArray, dtype_of, record
from slip_core.vectors import ZERO, Sym, Vec, mat, put, put_mat, vec
from slip_sim_bridge.friction import FrictionLaw
from slip_sim_bridge.friction.limit_surface import scaled, substeps_needed
from slip_sim_bridge.plant import GRASP, GRASP_SIZE, Grasp
from slip_sim_bridge.plant.joint_step import AGREEMENT, DRIVE_PASSES, TORQUE, joint_step, solve_half

RANK: Final = 1e-12
"""Of a difference of residuals: the part that newer ones do not explain, below which it is redundant."""


class RigidContact(Record):
    """The contact of the rigid grasp."""

    period: Real
    """Control period [s]."""
    torsional_radius: Real
    """rho [m]."""
    state: Vec3
    """Of the friction law, now."""
    next_state: Vec3
    """The same after the coming step."""


RIGID_CONTACT = dtype_of(RigidContact)


@part
def contact_motion(
    factor: Array, inverse_diagonal: Array, tree: WholeArray, force: Array, x: float, y: float
) -> tuple[Sym, Vec]:
    """Return J M^-1 J^T, and J times the relative part of M^-1 force; `force` is used up."""
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
    mobility = Sym(xx + y * (xz + ux), xy - x * xz + y * uy, ux, yy - x * (yz + uy), uy, zz)
    return mobility, Vec(ax + y * az, ay - x * az, az)


@part
def remember(points: Array, values: Array, x: Array, value: Array, count: int) -> int:
    """Put a point and its value before the older ones and return how many are kept, at most n + 1; (n + 1, n)."""
    kept = min(count + 1, len(points))
    for i in range(kept - 1, 0, -1):
        points[i] = points[i - 1]
        values[i] = values[i - 1]
    points[0], values[0] = x, value
    return kept


@part
def next_point(points: Array, values: Array, count: int, x: Array) -> None:
    """Write to x where g(x) = x is expected, by the newest `count` points and values g of them; (n + 1, n), (n,).

    Anderson 1965, J. ACM 12(4):547-560, with a memory of n steps: the share of each step that makes the residual
    g(x) - x least, by orthogonalisation that begins at the newest. What is nearly linear needs n + 2 values of g.
    """
    n, steps = len(x), count - 1
    left = values[0] - points[0]
    basis, triangle, shares = np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)
    for j in range(steps):
        step = (values[j] - points[j]) - (values[j + 1] - points[j + 1])
        whole = 0.0
        for k in range(n):
            whole += step[k] * step[k]
        for i in range(j):
            for k in range(n):
                triangle[i, j] += basis[i, k] * step[k]
            for k in range(n):
                step[k] -= triangle[i, j] * basis[i, k]
        rest = 0.0
        for k in range(n):
            rest += step[k] * step[k]
        if rest > RANK * RANK * whole:
            triangle[j, j] = np.sqrt(rest)
            for k in range(n):
                basis[j, k] = step[k] / triangle[j, j]
    for j in range(steps - 1, -1, -1):
        if triangle[j, j] > 0.0:
            for k in range(n):
                shares[j] += basis[j, k] * left[k]
            for i in range(j + 1, steps):
                shares[j] -= triangle[j, i] * shares[i]
            shares[j] /= triangle[j, j]
    for k in range(n):
        x[k] = values[0, k]
        for j in range(steps):
            x[k] -= shares[j] * (values[j, k] - values[j + 1, k])


@functools.cache
def rigid_step(law: FrictionLaw) -> Any:
    """Compile the step for a friction law: effort and friction of the coming sub-step become joint forces."""
    law_layout = law.LAYOUT

    @kernel(INT, IN1, IN1, WHOLE1, IN1, IN1, IN1, IN1, IN1, IN1, OUT1, REAL, INT, INT, OUT2, OUT1)
    def step(
        factor: Array, inverse_diagonal: Array, tree: WholeArray, qpos: Array, qvel: Array, bias: Array, stops: Array,
        effort: Array, parameters: Array, pad: Array, normal_force: float, substeps: int, keep: int, drives: Array,
        applied: Array,
    ) -> int:  # fmt: skip
        """Write the joint forces to `applied` and return the number of sub-steps of the period, 0 if not finite.

        Args:
            factor, inverse_diagonal: of the mass matrix, MuJoCo's qLD and qLDiagInv.
            tree: where a row of L begins, how long it is, and the column of every entry; (2 nv + entries,).
            qpos, qvel: joint state, relative joints last; (nv,).
            bias, stops: joint forces of motion and gravity, and of joint stops; (nv,) [N, N m].
            effort: of the arm; (n,) [N m].
            parameters: of the friction law.
            pad: laid out by `RIGID_CONTACT`; `next_state` is written.
            normal_force: [N]; without pressure there is no friction, not even viscous.
            substeps: into how many steps the period is split; 0 chooses, where no drives act on the joints.
            keep: 1 where this is the step's last solution, and `state` moves on too.
            drives: a JOINT_DRIVE per joint, whose torques are written; (n, 8), or (0, 8) where none acts on them.
            applied: joint forces; (nv,) [N, N m]. With drives those of the relative joints are tried first.

        Friction of the grasp and torques of the drives depend on each other: both are repeated until they fit, the
        grasp last.
        """
        contact: RigidContact = record(pad, RIGID_CONTACT)
        friction = record(parameters, law_layout)
        nv, n = len(qpos), len(effort)
        place, rate, rho = vec(qpos[n:]), vec(qvel[n:]), contact.torsional_radius
        x, y = place.x, place.y
        slip, force = applied[n:].copy(), np.empty(nv)
        points, values = np.empty((nv - n + 1, nv - n)), np.empty((nv - n + 1, nv - n))
        count, following = 0, ZERO
        for _ in range(DRIVE_PASSES):
            for i in range(n):
                applied[i] = effort[i]
            if len(drives) > 0:
                for i in range(nv):
                    force[i] = (effort[i] if i < n else slip[i - n]) - bias[i] + stops[i]
                dt = contact.period / substeps
                if not joint_step(factor, inverse_diagonal, tree, qpos, qvel, force, dt, drives):
                    return 0
                for i in range(n):
                    applied[i] += drives[i, TORQUE]
            for i in range(nv):
                force[i] = (applied[i] if i < n else 0.0) - bias[i] + stops[i]
            mobility, acceleration = contact_motion(factor, inverse_diagonal, tree, force, x, y)
            if substeps == 0:
                fall = law.steepest_fall(friction, max(0.0, normal_force))
                substeps = substeps_needed(fall, scaled(rho, contact.period * mobility))
            dt = contact.period / substeps
            v_free = Vec(rate.x + y * rate.z, rate.y - x * rate.z, rate.z) + dt * acceleration
            f_hat, following = ZERO, ZERO
            if normal_force > 0.0:
                u_free = Vec(v_free.x, v_free.y, rho * v_free.z)
                A_hat = scaled(rho, dt * mobility)
                f_hat, _, following = law.solve(friction, u_free, A_hat, normal_force, dt, vec(contact.state))
            put(applied[n:], Vec(f_hat.x, f_hat.y, rho * f_hat.z + y * f_hat.x - x * f_hat.y))
            if len(drives) == 0 or np.abs(applied[n:] - slip).max() < AGREEMENT:
                break
            count = remember(points, values, slip, applied[n:], count)
            next_point(points, values, count, slip)
        put(contact.next_state, following)
        if keep == 1:
            put(contact.state, following)
        return substeps

    return step


@kernel(VOID, IN1, IN1, IN1, IN1, IN2, IN1, IN1, IN2, IN1, IN2, OUT1)
def read_rigid(
    qpos: Array, qvel: Array, readings: Array, com: Array, turned: Array, spatial: Array, root: Array, p_R_o: Array,
    pad_position: Array, pad_rotation: Array, out: Array,
) -> None:  # fmt: skip
    """Write what can be read of arm and grasp to `out`, laid out by `plant.read_out`.

    Args:
        qpos, qvel: joint state, relative joints last; (nv,).
        readings: force and torque of the pad's sensors; (6,) [N, N m] {ee}.
        com: of the object; (3,) [m] {w}.
        turned: the grasp's frame {p} on the object; (3, 3) {p} to {w}.
        spatial: MuJoCo's twist of the object, angular first, at `root`; (6,) [rad/s, m/s] {w}.
        root: centre of mass of the whole tree; (3,) [m] {w}.
        p_R_o: {o} to {p}; (3, 3).
        pad_position, pad_rotation: (3,) [m] {w}, (3, 3) {ee} to {w}.
        out: (2 n + 54,), all but `pad_yield`: a rigid pad does not yield.

    Implements: h_ee of Eq. (1), v_s of Eq. (14), v_o of Eq. (10).
    """
    n = qpos.shape[0] - 3
    grasp: Grasp = record(out[:GRASP_SIZE], GRASP)
    joints = out[GRASP_SIZE:]
    for i in range(n):
        joints[i] = qpos[i]
        joints[n + i] = qvel[i]
    for i in range(6):
        grasp.wrench[i] = -readings[i]
    place, rate = vec(qpos[n:]), vec(qvel[n:])
    x, y, theta = place.x, place.y, place.z
    c, s = math.cos(theta), math.sin(theta)
    put(grasp.slip_displacement[:3], Vec(-c * x - s * y, s * x - c * y, 0.0))
    put(grasp.slip_displacement[3:], Vec(0.0, 0.0, -theta))
    put(grasp.slip_velocity[:3], Vec(-rate.x - y * rate.z, -rate.y + x * rate.z, 0.0))
    put(grasp.slip_velocity[3:], Vec(0.0, 0.0, -rate.z))
    put(grasp.object_position, vec(com))
    put_mat(grasp.object_rotation, mat(turned) @ mat(p_R_o))
    turning = vec(spatial[:3])
    put(grasp.object_twist[:3], vec(spatial[3:]) - (vec(com) - vec(root)).cross(turning))
    put(grasp.object_twist[3:], turning)
    put(grasp.pad_position, vec(pad_position))
    put_mat(grasp.pad_rotation, mat(pad_rotation))
