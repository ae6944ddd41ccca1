"""Elastic, slippery contacts on one object, compiled: forces before MuJoCo's step, deflection and slip after it.

A pad is a massless surface on a spring and a damper: the gripper on one side, the object on the other. The object's
material moves against the gripper by the twist w at the pad centre (pad axes); the surface follows by the rate of the
deflection xi, and what is left is slip v:

    w = xi' + v,    f = -K xi - D xi',    |S^-1 f| <= F(|S v|) on the axes of slip, v = 0 on the others

with f the wrench on the object at the pad centre and -f on the gripper, equal and opposite at one point. A step of dt
changes the motion by w = w_free + dt A f, A = J M^-1 J^T over all contacts (the loops through object and arms). The
damper is implicit and the spring explicit, so together with MuJoCo's semi-implicit Euler step the spring neither gains
nor loses energy. Eliminating xi' gives

    f = f_stick + B v,  B = (D^-1 + dt A)^-1,  f_stick = -B (w_free + D^-1 K xi)

so on the axes of slip v = A_hat (f - f_stick), A_hat = B_ss^-1: the form that the friction laws solve, contact by
contact, until all agree.
"""

from __future__ import annotations

import functools
import math
from typing import Any, Final

import numpy as np

from slip_core.arrays import Array
from slip_core.cholesky import back_substitute, cholesky, forward_substitute
from slip_core.compiled import IN1, IN2, INT, OUT1, OUT2, REAL, VOID, WHOLE1, kernel, part
from slip_core.records import POSE, Pose, Real, Record, Records, Vec3, Vec6, WholeArray, dtype_of, record, records
from slip_core.vectors import Mat, Sym, Vec, mat, put, vec
from slip_sim_bridge.friction import FrictionLaw
from slip_sim_bridge.friction.limit_surface import scaled
from slip_sim_bridge.plant.joint_step import solve_half

PASSES: Final = 100
AGREEMENT: Final = 1e-13
"""Passes over all contacts until their forces agree, as a share of the largest."""
RELEASED: Final = 1e-9
"""Damping of a pad without pressure [N s/m]."""


class ElasticContact(Record):
    """One contact; the axes are those of its pad."""

    stiffness: Vec6
    """K [N/m, N m/rad]."""
    damping: Vec6
    """D [N s/m, N m s/rad]."""
    radius: Real
    """Torsional radius rho [m]."""
    law_state: Vec3
    """Of the friction law."""
    deflection: Vec6
    """xi [m, rad]."""
    deflection_before: Vec6
    """The same one control period ago."""
    slip: Vec3
    """Pad on the object, x, y [m] {p} and angle [rad]."""
    force: Vec6
    """Wrench f on the object [N, N m]."""
    slip_rate: Vec3
    """v of the object on the pad: x, y [m/s], about z [rad/s]."""
    rubbed: Real
    """Energy that friction has taken since the start [J]."""
    damped: Real
    """Energy that the damper has taken since the start [J]."""


ELASTIC_CONTACT = dtype_of(ElasticContact)


@part
def slip_row(k: int) -> int:
    """Return the row of the k-th axis of slip: x, y and about z of each contact."""
    return 6 * (k // 3) + (k % 3 if k % 3 < 2 else 5)


@part
def fill_rows(pad: Pose, body: Pose, moving: Array, turning: Array, rows: Array) -> None:
    """Write the rows of a contact: twist of the object's material against the gripper at the pad centre, pad axes.

    Args:
        pad, body: pad and object.
        moving, turning: Jacobian of the pad; (3, nv) each {w}.
        rows: (6, nv); the last six columns are the object's: velocity {w} and turning on its own axes.
    """
    R, R_o = mat(pad.rotation), mat(body.rotation)
    r, nv = vec(pad.position) - vec(body.position), moving.shape[1]
    for j in range(nv - 6):
        linear = R.T() @ Vec(moving[0, j], moving[1, j], moving[2, j])
        angular = R.T() @ Vec(turning[0, j], turning[1, j], turning[2, j])
        put(rows[:3, j], -linear)
        put(rows[3:, j], -angular)
    axes, own = Mat(Vec(1.0, 0.0, 0.0), Vec(0.0, 1.0, 0.0), Vec(0.0, 0.0, 1.0)), R_o.T()
    for k in range(3):
        axis = axes.x if k == 0 else axes.y if k == 1 else axes.z
        turn = own.x if k == 0 else own.y if k == 1 else own.z
        put(rows[:3, nv - 6 + k], R.T() @ axis)
        put(rows[3:, nv - 6 + k], Vec(0.0, 0.0, 0.0))
        put(rows[:3, nv - 3 + k], R.T() @ turn.cross(r))
        put(rows[3:, nv - 3 + k], R.T() @ turn)


@part
def mobility_and_motion(
    factor: Array, inverse_diagonal: Array, tree: WholeArray, rows: Array, force: Array, A: Array, pushed: Array
) -> None:
    """Write J M^-1 J^T to A (m, m) and J M^-1 force to `pushed` (m,), rows (m, nv); `force` is used up."""
    nv, size = force.shape[0], rows.shape[0]
    half = rows.copy()
    solve_half(factor, tree, force)
    for a in range(size):
        solve_half(factor, tree, half[a])
    for a in range(size):
        total = 0.0
        for j in range(nv):
            total += half[a, j] * inverse_diagonal[j] * force[j]
        pushed[a] = total
        for b in range(a + 1):
            total = 0.0
            for j in range(nv):
                total += half[a, j] * inverse_diagonal[j] * half[b, j]
            A[a, b] = A[b, a] = total


@part
def inverse(S: Array, out: Array) -> bool:
    """Write the inverse of a symmetric positive definite matrix; False where it is not."""
    n = S.shape[0]
    L = np.empty((n, n))
    if not cholesky(S, L):
        return False
    for k in range(n):
        for j in range(n):
            out[k, j] = 1.0 if j == k else 0.0
        forward_substitute(L, out[k], out[k])
        back_substitute(L, out[k], out[k])
    return True


@functools.cache
def elastic_step(law: FrictionLaw) -> Any:
    """Compile the forces of the coming step for a friction law, which all contacts have."""
    law_layout = law.LAYOUT

    @kernel(INT, IN1, IN1, WHOLE1, IN1, IN1, IN1, IN2, IN2, IN2, IN1, REAL, OUT2, OUT2, OUT1)
    def step(
        factor: Array, inverse_diagonal: Array, tree: WholeArray, qvel: Array, bias: Array, effort: Array,
        frames: Array, jacobians: Array, laws: Array, normal_forces: Array, dt: float, state: Array, rows: Array,
        applied: Array,
    ) -> int:  # fmt: skip
        """Write the joint forces of the coming step; return 1, or 0 where they are not finite.

        Args:
            factor, inverse_diagonal, tree: of the mass matrix, as in `rigid_step`.
            qvel, bias: joint velocities, and forces of motion and gravity; (nv,).
            effort: joint efforts, and what pushes the object; (nv,) [N, N m].
            frames: a POSE per contact, then that of the object.
            jacobians: six rows per contact, linear first: of the pad {w}; (6 N, nv).
            laws: parameters of the friction law, a row per contact.
            normal_forces: of each contact; (N,) [N]; without pressure nothing holds.
            dt: [s].
            state: an ELASTIC_CONTACT per contact; force and slip_rate are written.
            rows: (6 N, nv); written for `elastic_after`.
            applied: joint forces; (nv,) [N, N m].
        """
        contacts: Records[ElasticContact] = records(state, ELASTIC_CONTACT)
        frame: Records[Pose] = records(frames, POSE)
        nv, count = len(qvel), len(normal_forces)
        size, slipping = 6 * count, 3 * count
        for i in range(count):
            at = 6 * i
            fill_rows(frame[i], frame[count], jacobians[at : at + 3], jacobians[at + 3 : at + 6], rows[at : at + 6])
        force = np.empty(nv)
        for j in range(nv):
            applied[j] = effort[j]
            force[j] = applied[j] - bias[j]
        A, pushed = np.empty((size, size)), np.empty(size)
        mobility_and_motion(factor, inverse_diagonal, tree, rows, force, A, pushed)
        right = np.empty(size)
        for a in range(size):
            c, k = contacts[a // 6], a % 6
            held = normal_forces[a // 6] > 0.0
            total = dt * pushed[a]
            for j in range(nv):
                total += rows[a, j] * qvel[j]
            damping = c.damping[k] if held else RELEASED
            right[a] = total + (c.stiffness[k] * c.deflection[k] / damping if held else 0.0)
            for b in range(size):
                A[a, b] *= dt
            A[a, a] += 1.0 / damping
        B = np.empty((size, size))
        if not inverse(A, B):
            return 0
        B_slip, A_hat = np.empty((slipping, slipping)), np.empty((slipping, slipping))
        stick, all_stick = np.empty(slipping), np.empty(size)
        for a in range(size):
            total = 0.0
            for b in range(size):
                total -= B[a, b] * right[b]
            all_stick[a] = total
        for a in range(slipping):
            stick[a] = all_stick[slip_row(a)]
            for b in range(slipping):
                B_slip[a, b] = B[slip_row(a), slip_row(b)]
        if not inverse(B_slip, A_hat):
            return 0
        # Force and slip on the axes of slip, until all contacts agree. Not a part of its own: machine code is kept by
        # the names of what it calls, and a part in here has none, so that every process would compile again.
        rubbing, slip, following = stick.copy(), np.zeros(slipping), np.zeros(slipping)
        for _ in range(PASSES):
            change, largest = 0.0, 0.0
            for i in range(count):
                rho, at = contacts[i].radius, 3 * i
                free = np.zeros(3)
                for a in range(3):
                    total = 0.0
                    for b in range(slipping):
                        own = at <= b < at + 3
                        total += A_hat[at + a, b] * ((0.0 if own else rubbing[b]) - stick[b])
                    free[a] = total
                block = Sym(
                    A_hat[at, at], A_hat[at, at + 1], A_hat[at, at + 2], A_hat[at + 1, at + 1],
                    A_hat[at + 1, at + 2], A_hat[at + 2, at + 2],
                )  # fmt: skip
                friction = record(laws[i], law_layout)
                f_hat, u = Vec(0.0, 0.0, 0.0), Vec(free[0], free[1], rho * free[2])
                if normal_forces[i] > 0.0:
                    f_hat, u, after = law.solve(
                        friction, u, scaled(rho, block), normal_forces[i], dt, vec(contacts[i].law_state)
                    )
                    put(following[at : at + 3], after)
                new = Vec(f_hat.x, f_hat.y, rho * f_hat.z)
                old = vec(rubbing[at : at + 3])
                change, largest = max(change, (new - old).norm()), max(largest, new.norm())
                put(rubbing[at : at + 3], new)
                put(slip[at : at + 3], Vec(u.x, u.y, u.z / rho))
            if change <= AGREEMENT * largest:
                break
        for a in range(size):
            total = all_stick[a]
            for k in range(slipping):
                total += B[a, slip_row(k)] * slip[k]
            contacts[a // 6].force[a % 6] = total if normal_forces[a // 6] > 0.0 else 0.0
        for i in range(count):
            for k in range(3):
                contacts[i].slip_rate[k] = slip[3 * i + k]
                contacts[i].law_state[k] = following[3 * i + k]
        finite = True
        for j in range(nv):
            for a in range(size):
                applied[j] += rows[a, j] * contacts[a // 6].force[a % 6]
            finite = finite and math.isfinite(applied[j])
        return 1 if finite else 0

    return step


@kernel(VOID, IN1, IN2, IN1, REAL, OUT2)
def elastic_after(qvel: Array, rows: Array, normal_forces: Array, dt: float, state: Array) -> None:
    """Advance deflection and slip of all contacts; arguments as in `elastic_step`, qvel after the step.

    A pad without pressure touches nothing: it is not bent, and its slip stays as it ended.
    """
    contacts: Records[ElasticContact] = records(state, ELASTIC_CONTACT)
    for i in range(len(normal_forces)):
        c = contacts[i]
        if not normal_forces[i] > 0.0:
            c.deflection[:] = 0.0
            c.slip_rate[:] = 0.0
            continue
        w = np.zeros(6)
        for k in range(6):
            for j in range(len(qvel)):
                w[k] += rows[6 * i + k, j] * qvel[j]
        for k in range(6):
            slip = c.slip_rate[k] if k < 2 else c.slip_rate[2] if k == 5 else 0.0
            rate = w[k] - slip
            c.deflection[k] += dt * rate
            c.damped += dt * c.damping[k] * rate * rate
            c.rubbed -= dt * c.force[k] * slip
        turn = c.slip[2] - 0.5 * dt * c.slip_rate[2]
        cos, sin = math.cos(turn), math.sin(turn)
        c.slip[0] -= dt * (cos * c.slip_rate[0] - sin * c.slip_rate[1])
        c.slip[1] -= dt * (sin * c.slip_rate[0] + cos * c.slip_rate[1])
        c.slip[2] -= dt * c.slip_rate[2]
