"""Friction of a pad as an implicit projection on its limit surface: exact stick, and slip by maximum dissipation.

The contact twist v = (vx, vy, wz) is the velocity of one surface over the other at the pad centre, on pad axes;
f = (fx, fy, tau_z) is the friction on the moving surface. With S = diag(1, 1, rho) all motions share one speed
s = |S v| and all loads one limit |S^-1 f| <= F(s). `Coulomb` and `Stribeck` are rigid laws: F is all they have.
`LuGre` (in `lugre.py`) puts elastic bristles in front of the same F.

These are the formulas to read, and the referee of their compiled form in `friction_kernel`, which runs in every step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from slip_core import sym3_kernel as sym3
from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_core.sym3_kernel import Sym3
from slip_core.vector_kernel import Three
from slip_sim_bridge.sim.friction_kernel import ROOT_ITERATIONS, ROOT_TOLERANCE

NO_STATE: Three = (0.0, 0.0, 0.0)
"""State of a contact before its first step; rigid laws never change it."""


@dataclass(frozen=True, slots=True)
class ContactSolution:
    """One implicit friction step, all on pad axes.

    force (3,) [N, N, N m] on the moving surface; velocity (3,) [m/s, m/s, rad/s] after the step; stick is True where
    nothing slid; state (3,) [m] is what the law wants back in the next step.
    """

    force: Array
    velocity: Array
    stick: bool
    state: Three


class FrictionLaw(Protocol):
    """A friction law as the solver needs it; instances are immutable, memory travels in `state`."""

    def limit(self, speed: float, normal_force: float) -> tuple[float, float]:
        """Return F(s) [N] and dF/ds [N s/m] in steady sliding at speed s [m/s] under normal_force [N]."""
        ...

    def steepest_fall(self, normal_force: float) -> float:
        """Return max(0, -min dF/ds) [N s/m]: what limits the step size."""
        ...

    def solve(
        self, u_free: Three, A_hat: Sym3, normal_force: float, dt: float, state: Three
    ) -> tuple[Three, Three, bool, Three]:
        """Return (f_hat = S^-1 f, u = S v, stick, next state) of one implicit step in scaled coordinates."""
        ...


@dataclass(frozen=True, slots=True)
class Coulomb:
    """Constant friction coefficient mu [-]."""

    mu: float

    def __post_init__(self) -> None:
        _check("friction mu", self.mu)

    def limit(self, speed: float, normal_force: float) -> tuple[float, float]:
        """Return F = mu N [N] and slope 0 [N s/m].

        Implements: ours: Coulomb friction.
        """
        return self.mu * normal_force, 0.0

    def steepest_fall(self, normal_force: float) -> float:
        """Return 0 [N s/m]: a constant limit bounds no step.

        Implements: ours: Coulomb friction.
        """
        return 0.0

    def solve(
        self, u_free: Three, A_hat: Sym3, normal_force: float, dt: float, state: Three
    ) -> tuple[Three, Three, bool, Three]:
        """Project on the limit surface; scaled (3,), 6 floats, [N], [s], (3,) -> (f_hat, u, stick, state).

        Implements: ours: rigid friction has no memory.
        """
        return *project(self, u_free, A_hat, normal_force), state


@dataclass(frozen=True, slots=True)
class Stribeck:
    """F(s) = N (mu_k + (mu_s - mu_k) exp(-(s / stribeck_velocity)^2)) + viscous s.

    mu_s, mu_k [-]; stribeck_velocity [m/s]; viscous [N s/m], a force per speed that does not scale with N.
    """

    mu_s: float
    mu_k: float
    stribeck_velocity: float
    viscous: float = 0.0

    def __post_init__(self) -> None:
        _check("friction mu_k", self.mu_k)
        _check("friction mu_s", self.mu_s)
        _check("friction viscous", self.viscous)
        _check("friction stribeck_velocity", self.stribeck_velocity, positive=True)
        if self.mu_s < self.mu_k:
            raise InputError("friction mu_s", got=self.mu_s, expected=f"at least mu_k = {self.mu_k}")

    def limit(self, speed: float, normal_force: float) -> tuple[float, float]:
        """Return F(s) [N] and dF/ds [N s/m] at speed [m/s] under normal_force [N].

        Implements: ours: Stribeck curve with the viscous part as a force per speed.
        """
        ratio = speed / self.stribeck_velocity
        extra = normal_force * (self.mu_s - self.mu_k) * math.exp(-ratio * ratio)
        slope = self.viscous - 2.0 * extra * ratio / self.stribeck_velocity
        return normal_force * self.mu_k + extra + self.viscous * speed, slope

    def steepest_fall(self, normal_force: float) -> float:
        """Return max(0, -min dF/ds) [N s/m] under normal_force [N], reached at s = stribeck_velocity / sqrt(2).

        Implements: ours: extremum of the Stribeck slope, sqrt(2/e) (mu_s - mu_k) N / v_s - c.
        """
        fall = math.sqrt(2.0 / math.e) * (self.mu_s - self.mu_k) * normal_force / self.stribeck_velocity
        return max(0.0, fall - self.viscous)

    def solve(
        self, u_free: Three, A_hat: Sym3, normal_force: float, dt: float, state: Three
    ) -> tuple[Three, Three, bool, Three]:
        """Project on the limit surface; scaled (3,), 6 floats, [N], [s], (3,) -> (f_hat, u, stick, state).

        Implements: ours: rigid friction has no memory.
        """
        return *project(self, u_free, A_hat, normal_force), state


def solve_contact(
    v_free: Array, A: Array, normal_force: float, dt: float, law: FrictionLaw, state: Three, rho: float
) -> ContactSolution:
    """Solve one implicit friction step: v = v_free + A f with f admissible and of maximum dissipation.

    Args:
        v_free: contact twist after the step without friction; (3,) [m/s, m/s, rad/s] pad axes.
        A: twist change per unit of force held for the step, dt J M^-1 J^T, symmetric positive definite; (3, 3).
        normal_force: N [N]; without pressure (N <= 0) there is no friction, not even viscous.
        dt: step [s].
        law: friction law.
        state: `NO_STATE` at first, then the `state` of the last solution; (3,) [m].
        rho: torsional radius [m]: tau_z = rho F alone breaks the pad loose.

    Implements: ours: |S^-1 f| <= F(s), with f = -F(s) S u / s in slip (ellipsoidal limit surface).
    """
    vx, vy, wz = v_free.tolist()
    if normal_force <= 0.0:
        return ContactSolution(_readonly(0.0, 0.0, 0.0), _readonly(vx, vy, wz), False, NO_STATE)
    f_hat, u, stick, following = law.solve((vx, vy, rho * wz), sym3.scaled_upper(A, rho), normal_force, dt, state)
    if following is not state:  # deflections turn with the object, or a shaken contact would walk by geometry alone
        turn = dt * u[2] / rho
        following = (following[0] - turn * state[1], following[1] + turn * state[0], following[2])
    return ContactSolution(
        _readonly(f_hat[0], f_hat[1], rho * f_hat[2]), _readonly(u[0], u[1], u[2] / rho), stick, following
    )


def project(law: FrictionLaw, u_free: Three, A_hat: Sym3, normal_force: float) -> tuple[Three, Three, bool]:
    """Solve a rigid law in scaled coordinates; (3,) [m/s], 6 floats [m/s/N], [N] -> (f_hat [N], u [m/s], stick).

    Stick where F(0) holds the load. Otherwise the speed is the root of |(s I + F(s) A_hat)^-1 u_free| = 1,
    bracketed by (0, |u_free|] and found by Newton steps on 1/|.| - 1, which is nearly a straight line in s.

    Implements: ours: maximum dissipation f_hat = -F(s) u / s put into u = u_free + A_hat f_hat.
    """
    hold = sym3.solve(A_hat, u_free)
    breakaway, _ = law.limit(0.0, normal_force)
    if hold[0] * hold[0] + hold[1] * hold[1] + hold[2] * hold[2] <= breakaway * breakaway:
        return (-hold[0], -hold[1], -hold[2]), (0.0, 0.0, 0.0), True

    ux, uy, uz = u_free
    free_speed = math.sqrt(ux * ux + uy * uy + uz * uz)
    pushed = sym3.multiply(A_hat, u_free)
    low, high = 0.0, free_speed
    force, _ = law.limit(free_speed, normal_force)
    speed = free_speed - force * (ux * pushed[0] + uy * pushed[1] + uz * pushed[2]) / (free_speed * free_speed)
    if not low < speed <= high:
        speed = 0.5 * high
    xx, xy, xz, yy, yz, zz = A_hat
    for _ in range(ROOT_ITERATIONS):
        force, slope = law.limit(speed, normal_force)
        M = (speed + force * xx, force * xy, force * xz, speed + force * yy, force * yz, speed + force * zz)
        w = sym3.solve(M, u_free)
        norm = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
        if abs(norm - 1.0) <= ROOT_TOLERANCE:
            break
        if norm > 1.0:
            low = speed
        else:
            high = speed
        q, p = sym3.solve(M, w), sym3.multiply(A_hat, w)
        gain = q[0] * (w[0] + slope * p[0]) + q[1] * (w[1] + slope * p[1]) + q[2] * (w[2] + slope * p[2])
        step = (norm - 1.0) * norm * norm / gain if gain > 0.0 else math.inf
        following = speed + step
        if not low < following < high:
            following = 0.5 * (low + high)
        if abs(following - speed) <= ROOT_TOLERANCE * speed:
            break
        speed = following
    scale = 1.0 / norm
    direction = (w[0] * scale, w[1] * scale, w[2] * scale)
    f_hat = (-force * direction[0], -force * direction[1], -force * direction[2])
    return f_hat, (speed * direction[0], speed * direction[1], speed * direction[2]), False


def substeps_needed(
    A: Array, normal_force: float, law: FrictionLaw, rho: float, margin: float = 0.5, most: int = 64
) -> int:
    """Return into how many sub-steps a step must be split so that the slip speed is the only root.

    Args:
        A: twist change per unit of force held for the whole step; (3, 3) [m/s/N ...] pad axes.
        normal_force: [N].
        law: friction law; only the falling part of its curve matters.
        rho: torsional radius [m].
        margin: allowed size of |dF/ds| lambda_max(A_hat); the root is unique below 1.
        most: upper bound of the answer.

    Implements: ours: dt |mu'(s)| N lambda_max(A/dt) < 1, in scaled coordinates.
    """
    fall = law.steepest_fall(max(0.0, normal_force))
    if fall == 0.0:
        return 1
    product = fall * sym3.largest_eigenvalue(sym3.scaled_upper(A, rho))
    return max(1, min(most, math.ceil(product / margin)))


def _readonly(x: float, y: float, z: float) -> Array:
    array = np.array((x, y, z))
    array.setflags(write=False)
    return array


def _check(what: str, value: float, *, positive: bool = False) -> None:
    if not math.isfinite(value) or value < 0.0 or (positive and value == 0.0):
        raise InputError(what, got=value, expected="a finite number above 0" if positive else "a finite number >= 0")
