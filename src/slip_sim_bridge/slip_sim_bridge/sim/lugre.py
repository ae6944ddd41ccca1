"""Elasto-plastic LuGre friction: bristles that spring back below the break-away load and flow at the limit.

In scaled coordinates (see `friction.py`) the bristle deflection z (3,) [m] and the slip rate u obey
    zdot  = u - alpha(|z|) max(0, u . z_hat) / z_ss(s) z,      z_ss(s) = F_dry(s) / stiffness
    f_hat = -(stiffness z + damping zdot + viscous u)
alpha is 0 for |z| <= breakaway_fraction z_ss (Dupont, Hayward, Armstrong, Altpeter 2002, IEEE TAC 47(5):787-792):
there the contact is a pure spring, so that a vibration below that load moves it to and fro without drift, which the
original LuGre model does not manage. Taking the slip rate along z_hat makes the planar model passive and turns the
bristle towards the slip without shortening it; on a straight line both forms are the same. Steady sliding gives F(s).

Backward Euler gives z' = kappa (z + dt u) with one unknown kappa in (0, 1], 1 = elastic. It is bounded,
|z'| <= max(|z|, z_ss), at any step; a stiff bristle needs no small step. Compiled form: `lugre_kernel`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from slip_core import sym3_kernel as sym3
from slip_core.errors import InputError
from slip_core.sym3_kernel import Sym3
from slip_core.vector_kernel import Three
from slip_sim_bridge.sim.friction import Stribeck
from slip_sim_bridge.sim.lugre_kernel import ROOT_ITERATIONS, ROOT_TOLERANCE, SHORTEST


@dataclass(frozen=True, slots=True)
class LuGre:
    """Bristles in front of a Stribeck curve.

    curve: steady sliding friction; stiffness [N/m] and damping [N s/m] of all bristles together, for motion along
    x, y or rho times the turn; breakaway_fraction: share of the limit up to which nothing flows, in [0, 1). A load
    that swings above it creeps a little in every cycle, so choose it above every load that must be held.
    """

    curve: Stribeck
    stiffness: float
    damping: float
    breakaway_fraction: float = 0.95

    def __post_init__(self) -> None:
        if not (math.isfinite(self.stiffness) and self.stiffness > 0.0):
            raise InputError("friction lugre.stiffness", got=self.stiffness, expected="a finite number above 0")
        if not (math.isfinite(self.damping) and self.damping >= 0.0):
            raise InputError("friction lugre.damping", got=self.damping, expected="a finite number >= 0")
        if not 0.0 <= self.breakaway_fraction < 1.0:
            raise InputError(
                "friction lugre.breakaway_fraction", got=self.breakaway_fraction, expected="a number from 0, below 1"
            )

    def limit(self, speed: float, normal_force: float) -> tuple[float, float]:
        """Return F(s) [N] and dF/ds [N s/m] in steady sliding at speed [m/s] under normal_force [N].

        Implements: ours: the bristles do not change steady sliding.
        """
        return self.curve.limit(speed, normal_force)

    def steepest_fall(self, normal_force: float) -> float:
        """Return max(0, -min dF/ds) [N s/m] under normal_force [N].

        Implements: ours: same bound as the curve behind the bristles.
        """
        return self.curve.steepest_fall(normal_force)

    def solve(
        self, u_free: Three, A_hat: Sym3, normal_force: float, dt: float, state: Three
    ) -> tuple[Three, Three, bool, Three]:
        """Step the bristles; scaled (3,), 6 floats, [N], [s], (3,) [m] -> (f_hat, u, elastic, next z).

        Implements: ours: backward Euler of the equations above, root of the flow rule in kappa.
        """
        z = self._shortened(state, normal_force)
        step = self._trial(1.0, u_free, A_hat, normal_force, dt, z)
        elastic = step[0] >= 0.0
        if not elastic:
            step = self._flow(step, u_free, A_hat, normal_force, dt, z)
        _, u, z_next = step
        k, d, c = self.stiffness, self.damping / dt, self.curve.viscous
        f_hat = (
            -(k * z_next[0] + d * (z_next[0] - z[0]) + c * u[0]),
            -(k * z_next[1] + d * (z_next[1] - z[1]) + c * u[1]),
            -(k * z_next[2] + d * (z_next[2] - z[2]) + c * u[2]),
        )
        return f_hat, u, elastic, z_next

    def _flow(
        self,
        at_one: tuple[float, Three, Three],
        u_free: Three,
        A_hat: Sym3,
        normal_force: float,
        dt: float,
        z: Three,
    ) -> tuple[float, Three, Three]:
        """Find kappa by regula falsi (Illinois): the residual is 1 at kappa = 0 and negative at 1."""
        low, high, r_low, r_high = 0.0, 1.0, 1.0, at_one[0]
        step, side = at_one, 0
        for _ in range(ROOT_ITERATIONS):
            kappa = (low * r_high - high * r_low) / (r_high - r_low)
            step = self._trial(kappa, u_free, A_hat, normal_force, dt, z)
            r = step[0]
            if abs(r) <= ROOT_TOLERANCE or high - low <= ROOT_TOLERANCE * kappa:
                break
            if r > 0.0:
                low, r_low = kappa, r
                if side > 0:
                    r_high *= 0.5
                side = 1
            else:
                high, r_high = kappa, r
                if side < 0:
                    r_low *= 0.5
                side = -1
        return step

    def _trial(
        self, kappa: float, u_free: Three, A_hat: Sym3, normal_force: float, dt: float, z: Three
    ) -> tuple[float, Three, Three]:
        """Return (residual of the flow rule, u, z') for a given kappa; the motion is a linear solve."""
        xx, xy, xz, yy, yz, zz = A_hat
        a = kappa * (self.stiffness * dt + self.damping) + self.curve.viscous
        b = self.stiffness * kappa + self.damping * (kappa - 1.0) / dt
        pull = sym3.multiply(A_hat, z)
        u = sym3.solve(
            (1.0 + a * xx, a * xy, a * xz, 1.0 + a * yy, a * yz, 1.0 + a * zz),
            (u_free[0] - b * pull[0], u_free[1] - b * pull[1], u_free[2] - b * pull[2]),
        )
        z_next = (kappa * (z[0] + dt * u[0]), kappa * (z[1] + dt * u[1]), kappa * (z[2] + dt * u[2]))
        length = math.sqrt(z_next[0] * z_next[0] + z_next[1] * z_next[1] + z_next[2] * z_next[2])
        along = u[0] * z_next[0] + u[1] * z_next[1] + u[2] * z_next[2]
        speed = math.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
        dry = self.curve.limit(speed, normal_force)[0] - self.curve.viscous * speed
        z_ss = max(dry / self.stiffness, SHORTEST)
        if along <= 0.0 or length <= self.breakaway_fraction * z_ss:
            return 1.0 - kappa, u, z_next
        flow = dt * self._alpha(length / z_ss) * along / (length * z_ss)
        return 1.0 - kappa - kappa * flow, u, z_next

    def _alpha(self, stretch: float) -> float:
        """Share of the slip that flows above the break-away fraction: a smooth sine from 0 to 1 at full stretch."""
        start = self.breakaway_fraction
        if stretch >= 1.0:
            return 1.0
        return 0.5 + 0.5 * math.sin(math.pi * (stretch - 0.5 * (1.0 + start)) / (1.0 - start))

    def _shortened(self, z: Three, normal_force: float) -> Three:
        """Let go what a smaller normal force cannot hold any more."""
        longest = self.curve.mu_s * normal_force / self.stiffness
        length = math.sqrt(z[0] * z[0] + z[1] * z[1] + z[2] * z[2])
        if length <= longest:
            return z
        scale = longest / length
        return z[0] * scale, z[1] * scale, z[2] * scale
