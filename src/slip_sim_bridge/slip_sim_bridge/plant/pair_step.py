"""Two elastic, slippery contacts on one object, compiled: forces before MuJoCo's step, deflection and slip after it.

A pad is a massless surface on a spring and a damper: the gripper on one side, the object on the other. The object's
material moves against the gripper by the twist w at the pad centre (pad axes); the surface follows by the rate of the
deflection xi, and what is left is slip v:

    w = xi' + v,    f = -K xi - D xi',    |S^-1 f| <= F(|S v|) on the axes of slip, v = 0 on the others

with f the wrench on the object at the pad centre and -f on the gripper, equal and opposite at one point. A step of dt
changes the motion by w = w_free + dt A f, A = J M^-1 J^T over both contacts (the loop through object and arms). The
damper is implicit and the spring explicit, so together with MuJoCo's semi-implicit Euler step the spring neither gains
nor loses energy. Eliminating xi' gives

    f = f_stick + B v,  B = (D^-1 + dt A)^-1,  f_stick = -B (w_free + D^-1 K xi)

so on the axes of slip v = A_hat (f - f_stick), A_hat = B_ss^-1: the form that the friction laws solve, contact by
contact, until both agree.
"""

from __future__ import annotations

import functools
import math
from typing import Any, Final

import numpy as np

from slip_core.arrays import Array
from slip_core.cholesky import back_substitute, cholesky, forward_substitute
from slip_core.compiled import IN1, IN2, INT, OUT1, OUT2, REAL, VOID, WHOLE1, kernel, part
from slip_core.records import REAL as NUMBER
from slip_core.records import layout, record
from slip_core.symmetric import Sym
from slip_core.vectors import Mat, Vec, mat, put, put_mat, vec
from slip_sim_bridge.friction import FrictionLaw
from slip_sim_bridge.friction.limit_surface import scaled
from slip_sim_bridge.plant import GRASP
from slip_sim_bridge.plant.grasp_step import GRASP_SIZE, solve_half

CONTACTS: Final = 2
ROWS: Final = 6 * CONTACTS
SLIPPING: Final = 3 * CONTACTS
PASSES: Final = 100
AGREEMENT: Final = 1e-13
"""Passes over both contacts until their forces agree, as a share of the largest."""

ELASTIC = layout(
    stiffness=(NUMBER, 6), damping=(NUMBER, 6), radius=NUMBER, law_state=(NUMBER, 3), deflection=(NUMBER, 6),
    slip=(NUMBER, 3), force=(NUMBER, 6), slip_rate=(NUMBER, 3), rubbed=NUMBER, damped=NUMBER,
)  # fmt: skip
"""One contact: K [N/m, N m/rad], D, torsional radius rho [m]; state of the friction law; deflection xi [m, rad] and
wrench f on the object [N, N m], pad axes; slip: pad on the object, x, y [m] {p} and angle [rad]; slip_rate v of the
object on the pad [m/s, rad/s]; energy that friction and damper have taken since the start [J]."""
PAIR = layout(contact=(ELASTIC, CONTACTS))
FRAME = layout(position=(NUMBER, 3), rotation=(NUMBER, (3, 3)))
"""Pose of a pad or of the object's centre of mass [m] {w}."""
FRAMES = layout(pad=(FRAME, CONTACTS), body=FRAME)


@part
def slip_row(k: int) -> int:
    """Return the row of the k-th axis of slip: x, y and about z of each contact."""
    return 6 * (k // 3) + (k % 3 if k % 3 < 2 else 5)


@part
def fill_rows(frames: Any, i: int, moving: Array, turning: Array, rows: Array) -> None:
    """Write the rows of contact i: twist of the object's material against the gripper at the pad centre, pad axes.

    Args:
        frames: FRAMES.
        i: contact.
        moving, turning: Jacobian of that pad; (3, nv) each {w}.
        rows: (12, nv); the last six columns are the object's: velocity {w} and turning on its own axes.
    """
    R, R_o = mat(frames.pad[i].rotation), mat(frames.body.rotation)
    r, nv = vec(frames.pad[i].position) - vec(frames.body.position), moving.shape[1]
    for j in range(nv - 6):
        linear = R.T() @ Vec(moving[0, j], moving[1, j], moving[2, j])
        angular = R.T() @ Vec(turning[0, j], turning[1, j], turning[2, j])
        put(rows[6 * i : 6 * i + 3, j], -linear)
        put(rows[6 * i + 3 : 6 * i + 6, j], -angular)
    axes, own = Mat(Vec(1.0, 0.0, 0.0), Vec(0.0, 1.0, 0.0), Vec(0.0, 0.0, 1.0)), R_o.T()
    for k in range(3):
        axis = axes.x if k == 0 else axes.y if k == 1 else axes.z
        turn = own.x if k == 0 else own.y if k == 1 else own.z
        put(rows[6 * i : 6 * i + 3, nv - 6 + k], R.T() @ axis)
        put(rows[6 * i + 3 : 6 * i + 6, nv - 6 + k], Vec(0.0, 0.0, 0.0))
        put(rows[6 * i : 6 * i + 3, nv - 3 + k], R.T() @ turn.cross(r))
        put(rows[6 * i + 3 : 6 * i + 6, nv - 3 + k], R.T() @ turn)


@part
def mobility_and_motion(
    factor: Array, inverse_diagonal: Array, tree: Any, rows: Array, force: Array, A: Array, pushed: Array
) -> None:
    """Write J M^-1 J^T to A (12, 12) and J M^-1 force to `pushed` (12,); `force` is used up."""
    nv = force.shape[0]
    half = rows.copy()
    solve_half(factor, tree, force)
    for a in range(ROWS):
        solve_half(factor, tree, half[a])
    for a in range(ROWS):
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
def pair_step(law: FrictionLaw) -> Any:
    """Compile the forces of the coming step for a friction law, which both contacts have."""
    law_layout = law.LAYOUT

    @kernel(INT(IN1, IN1, WHOLE1, IN1, IN1, IN1, IN1, IN2, IN2, IN2, IN2, IN2, IN1, REAL, OUT1, OUT2, OUT1))
    def step(
        factor: Array, inverse_diagonal: Array, tree: Array, qvel: Array, bias: Array, effort: Array, frames: Array,
        moving_0: Array, turning_0: Array, moving_1: Array, turning_1: Array, laws: Array, normal_force: Array,
        dt: float, pair: Array, rows: Array, applied: Array,
    ) -> int:  # fmt: skip
        """Write the joint forces of the coming step; return 1, or 0 where they are not finite.

        Args:
            factor, inverse_diagonal, tree: of the mass matrix, as of `grasp_step`.
            qvel, bias: joint velocities, and forces of motion and gravity; (nv,).
            effort: of both arms; (nv - 6,) [N m].
            frames: FRAMES.
            moving_0, turning_0, moving_1, turning_1: Jacobians of the pads; (3, nv) each {w}.
            laws: parameters of the friction law, a row per contact.
            normal_force: of each contact; (2,) [N]; without pressure nothing holds.
            dt: [s].
            pair: PAIR; force and slip_rate are written.
            rows: (12, nv); written for `pair_after`.
            applied: joint forces; (nv,) [N, N m].
        """
        p, at = record(pair, PAIR), record(frames, FRAMES)
        nv = len(qvel)
        fill_rows(at, 0, moving_0, turning_0, rows)
        fill_rows(at, 1, moving_1, turning_1, rows)
        force = np.empty(nv)
        for j in range(nv):
            applied[j] = effort[j] if j < nv - 6 else 0.0
            force[j] = applied[j] - bias[j]
        A, pushed = np.empty((ROWS, ROWS)), np.empty(ROWS)
        mobility_and_motion(factor, inverse_diagonal, tree, rows, force, A, pushed)
        right = np.empty(ROWS)
        for a in range(ROWS):
            c, k = p.contact[a // 6], a % 6
            held = normal_force[a // 6] > 0.0
            total = dt * pushed[a]
            for j in range(nv):
                total += rows[a, j] * qvel[j]
            damping = c.damping[k] if held else RELEASED
            right[a] = total + (c.stiffness[k] * c.deflection[k] / damping if held else 0.0)
            for b in range(ROWS):
                A[a, b] *= dt
            A[a, a] += 1.0 / damping
        B = np.empty((ROWS, ROWS))
        if not inverse(A, B):
            return 0
        B_slip, A_hat = np.empty((SLIPPING, SLIPPING)), np.empty((SLIPPING, SLIPPING))
        stick, all_stick = np.empty(SLIPPING), np.empty(ROWS)
        for a in range(ROWS):
            total = 0.0
            for b in range(ROWS):
                total -= B[a, b] * right[b]
            all_stick[a] = total
        for a in range(SLIPPING):
            stick[a] = all_stick[slip_row(a)]
            for b in range(SLIPPING):
                B_slip[a, b] = B[slip_row(a), slip_row(b)]
        if not inverse(B_slip, A_hat):
            return 0
        # Force and slip on the axes of slip, until both contacts agree. Not a part of its own: machine code is kept by
        # the names of what it calls, and a part in here has none, so that every process would compile anew.
        rubbing, slip, following = stick.copy(), np.zeros(SLIPPING), np.zeros(SLIPPING)
        for _ in range(PASSES):
            change, size = 0.0, 0.0
            for i in range(CONTACTS):
                rho, at = p.contact[i].radius, 3 * i
                free = np.zeros(3)
                for a in range(3):
                    total = 0.0
                    for b in range(SLIPPING):
                        own = at <= b < at + 3
                        total += A_hat[at + a, b] * ((0.0 if own else rubbing[b]) - stick[b])
                    free[a] = total
                block = Sym(
                    A_hat[at, at], A_hat[at, at + 1], A_hat[at, at + 2], A_hat[at + 1, at + 1],
                    A_hat[at + 1, at + 2], A_hat[at + 2, at + 2],
                )  # fmt: skip
                friction = record(laws[i], law_layout)
                f_hat, u = Vec(0.0, 0.0, 0.0), Vec(free[0], free[1], rho * free[2])
                if normal_force[i] > 0.0:
                    f_hat, u, after = law.solve(
                        friction, u, scaled(rho, block), normal_force[i], dt, vec(p.contact[i].law_state)
                    )
                    put(following[at : at + 3], after)
                new = Vec(f_hat.x, f_hat.y, rho * f_hat.z)
                old = vec(rubbing[at : at + 3])
                change, size = max(change, (new - old).norm()), max(size, new.norm())
                put(rubbing[at : at + 3], new)
                put(slip[at : at + 3], Vec(u.x, u.y, u.z / rho))
            if change <= AGREEMENT * size:
                break
        for a in range(ROWS):
            total = all_stick[a]
            for k in range(SLIPPING):
                total += B[a, slip_row(k)] * slip[k]
            p.contact[a // 6].force[a % 6] = total if normal_force[a // 6] > 0.0 else 0.0
        for i in range(CONTACTS):
            for k in range(3):
                p.contact[i].slip_rate[k] = slip[3 * i + k]
                p.contact[i].law_state[k] = following[3 * i + k]
        finite = True
        for j in range(nv):
            for a in range(ROWS):
                applied[j] += rows[a, j] * p.contact[a // 6].force[a % 6]
            finite = finite and math.isfinite(applied[j])
        return 1 if finite else 0

    return step


RELEASED: Final = 1e-9
"""Damping of a pad without pressure [N s/m]."""


@kernel(VOID(IN1, IN2, IN1, REAL, OUT1))
def pair_after(qvel: Array, rows: Array, normal_force: Array, dt: float, pair: Array) -> None:
    """Move deflection and slip of both contacts on; arguments as of `pair_step`, qvel after the step."""
    p = record(pair, PAIR)
    for i in range(CONTACTS):
        c = p.contact[i]
        w = np.zeros(6)
        for k in range(6):
            for j in range(len(qvel)):
                w[k] += rows[6 * i + k, j] * qvel[j]
        if not normal_force[i] > 0.0:
            c.deflection[:] = 0.0
            c.slip_rate[0], c.slip_rate[1], c.slip_rate[2] = w[0], w[1], w[5]
        for k in range(6):
            slip = c.slip_rate[k] if k < 2 else c.slip_rate[2] if k == 5 else 0.0
            rate = w[k] - slip if normal_force[i] > 0.0 else 0.0
            c.deflection[k] += dt * rate
            c.damped += dt * c.damping[k] * rate * rate
            c.rubbed -= dt * c.force[k] * slip
        turn = c.slip[2] - 0.5 * dt * c.slip_rate[2]
        cos, sin = math.cos(turn), math.sin(turn)
        c.slip[0] -= dt * (cos * c.slip_rate[0] - sin * c.slip_rate[1])
        c.slip[1] -= dt * (sin * c.slip_rate[0] + cos * c.slip_rate[1])
        c.slip[2] -= dt * c.slip_rate[2]


@kernel(VOID(IN1, INT, IN1, IN1, IN1, IN1, OUT1))
def read_pair(
    pair: Array, i: int, position: Array, velocity: Array, object_velocity: Array, frames: Array, out: Array
) -> None:
    """Write what can be read of one side to `out`, laid out by `ReadOut`.

    Args:
        pair: PAIR.
        i: side.
        position, velocity: of its joints; (n,) [rad], [rad/s].
        object_velocity: (6,): velocity of the centre of mass {w}, turning on the object's axes.
        frames: FRAMES.
        out: (2 n + 36,).

    Implements: h_ee of Eq. (1), v_s of Eq. (14), v_o of Eq. (10).
    """
    c, at = record(pair, PAIR).contact[i], record(frames, FRAMES)
    grasp, joints, n = record(out[:GRASP_SIZE], GRASP), out[GRASP_SIZE:], len(position)
    for j in range(n):
        joints[j], joints[n + j] = position[j], velocity[j]
    for k in range(6):
        grasp.wrench[k] = -c.force[k]
    put(grasp.slip_displacement[:3], Vec(c.slip[0], c.slip[1], 0.0))
    put(grasp.slip_displacement[3:], Vec(0.0, 0.0, c.slip[2]))
    put(grasp.slip_velocity[:3], Vec(-c.slip_rate[0], -c.slip_rate[1], 0.0))
    put(grasp.slip_velocity[3:], Vec(0.0, 0.0, -c.slip_rate[2]))
    R_o = mat(at.body.rotation)
    put(grasp.object_position, vec(at.body.position))
    put_mat(grasp.object_rotation, R_o)
    put(grasp.object_twist[:3], vec(object_velocity))
    put(grasp.object_twist[3:], R_o @ vec(object_velocity[3:]))
