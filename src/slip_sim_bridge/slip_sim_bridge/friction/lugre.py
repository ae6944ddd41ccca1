"""Elasto-plastic LuGre friction: bristles that spring back below the break-away load and flow at the limit.

In scaled coordinates (see `limit_surface`) the bristle deflection z (3,) [m] and the slip rate u obey
    zdot  = u - alpha(|z|) max(0, u . z_hat) / z_ss(s) z,      z_ss(s) = F_dry(s) / stiffness
    f_hat = -(stiffness z + damping zdot + viscous u)
alpha is 0 for |z| <= breakaway_fraction z_ss (Dupont, Hayward, Armstrong, Altpeter 2002, IEEE TAC 47(5):787-792):
there the contact is a pure spring, so that a vibration below that load moves it to and fro without drift, which the
original LuGre model does not manage. Taking the slip rate along z_hat makes the planar model passive and turns the
bristle towards the slip without shortening it; on a straight line both forms are the same. Steady sliding gives F(s)
of the Stribeck curve. A load that oscillates above the break-away fraction creeps a little in every cycle.

Backward Euler gives z' = kappa (z + dt u) with one unknown kappa in (0, 1], 1 = elastic. It is bounded,
|z'| <= max(|z|, z_ss), at any step; a stiff bristle needs no small step.
"""

from __future__ import annotations

import math

from slip_core.compiled import part
from slip_core.records import Real, Record, dtype_of
from slip_core.vectors import Sym, Vec, with_diagonal
from slip_sim_bridge.friction import stribeck
from slip_sim_bridge.friction.params import FrictionParams


class Lugre(Record):
    """Parameters of the bristles and of the curve behind them."""

    curve: stribeck.Stribeck
    stiffness: Real
    """sigma_0 [N/m]."""
    damping: Real
    """sigma_1 [N s/m]."""
    breakaway_fraction: Real
    torsional_radius: Real
    """rho [m]."""


LAYOUT = dtype_of(Lugre)

ROOT_TOLERANCE = 1e-12  # of kappa
ROOT_ITERATIONS = 100
SHORTEST = 1e-12  # m: full stretch where there is no dry friction; its force is nil


def fill(law: Lugre, params: FrictionParams) -> None:
    """Write the parameters to the record; stiffness and damping are those of all bristles together."""
    stribeck.fill(law.curve, params)
    law.stiffness, law.damping = params.lugre.stiffness, params.lugre.damping
    law.breakaway_fraction, law.torsional_radius = params.lugre.breakaway_fraction, params.torsional_radius


@part
def steepest_fall(law: Lugre, normal_force: float) -> float:
    """Return max(0, -min dF/ds) [N s/m] of the curve behind the bristles."""
    return stribeck.steepest_fall(law.curve, normal_force)


@part
def shortened(law: Lugre, z: Vec, normal_force: float) -> Vec:
    """Let go what a smaller normal force cannot hold any more."""
    longest = law.curve.mu_s * normal_force / law.stiffness
    length = z.norm()
    if length <= longest:
        return z
    return (longest / length) * z


@part
def flowing_share(start: float, stretch: float) -> float:
    """Return alpha above the break-away fraction: a smooth sine from 0 to 1 at full stretch."""
    if stretch >= 1.0:
        return 1.0
    return 0.5 + 0.5 * math.sin(math.pi * (stretch - 0.5 * (1.0 + start)) / (1.0 - start))


@part
def trial(
    law: Lugre, kappa: float, u_free: Vec, A_hat: Sym, normal_force: float, dt: float, z: Vec
) -> tuple[float, Vec, Vec]:
    """Return (residual of the flow rule, u, z') for a given kappa; the motion is a linear solve."""
    viscous = law.curve.viscous
    a = kappa * (law.stiffness * dt + law.damping) + viscous
    b = law.stiffness * kappa + law.damping * (kappa - 1.0) / dt
    u = with_diagonal(1.0, a * A_hat).solve(u_free - b * (A_hat @ z))
    z_next = kappa * (z + dt * u)
    length, along, speed = z_next.norm(), u.dot(z_next), u.norm()
    dry = stribeck.limit(law.curve, speed, normal_force)[0] - viscous * speed
    z_ss = max(dry / law.stiffness, SHORTEST)
    if along <= 0.0 or length <= law.breakaway_fraction * z_ss:
        return 1.0 - kappa, u, z_next
    flow = dt * flowing_share(law.breakaway_fraction, length / z_ss) * along / (length * z_ss)
    return 1.0 - kappa - kappa * flow, u, z_next


@part
def solve(law: Lugre, u_free: Vec, A_hat: Sym, normal_force: float, dt: float, state: Vec) -> tuple[Vec, Vec, Vec]:
    """Step the bristles, `state` = z; kappa by regula falsi (Illinois), the residual is 1 at 0 and negative at 1.

    Deflections turn with the object, or a shaken contact would walk by geometry alone.
    """
    z = shortened(law, state, normal_force)
    r, u, z_next = trial(law, 1.0, u_free, A_hat, normal_force, dt, z)
    if r < 0.0:
        low, high, r_low, r_high, side = 0.0, 1.0, 1.0, r, 0
        for _ in range(ROOT_ITERATIONS):
            kappa = (low * r_high - high * r_low) / (r_high - r_low)
            r, u, z_next = trial(law, kappa, u_free, A_hat, normal_force, dt, z)
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
    f_hat = -(law.stiffness * z_next + (law.damping / dt) * (z_next - z) + law.curve.viscous * u)
    turn = dt * u.z / law.torsional_radius
    return f_hat, u, Vec(z_next.x - turn * state.y, z_next.y + turn * state.x, z_next.z)
