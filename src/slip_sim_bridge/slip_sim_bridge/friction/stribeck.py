"""Stribeck friction: F(s) = N (mu_k + (mu_s - mu_k) exp(-(s / stribeck_velocity)^2)) + viscous s.

The viscous part is a force per speed, which does not scale with N. Coulomb's law is the curve with mu_k alone.
"""

from __future__ import annotations

import math

from slip_core.compiled import part
from slip_core.records import Real, Record, dtype_of
from slip_core.symmetric import Sym
from slip_core.vectors import Vec
from slip_sim_bridge.friction.limit_surface import projection
from slip_sim_bridge.friction.params import FrictionParams


class Stribeck(Record):
    """Parameters of the curve."""

    mu_s: Real
    """Static friction over normal force."""
    mu_k: Real
    """Kinetic friction over normal force."""
    stribeck_velocity: Real
    """[m/s]."""
    viscous: Real
    """[N s/m]."""


LAYOUT = dtype_of(Stribeck)


def fill(law: Stribeck, params: FrictionParams) -> None:
    """Write the parameters to the record."""
    law.mu_k, law.stribeck_velocity = params.mu_k, params.stribeck_velocity
    law.mu_s, law.viscous = (params.mu_k, 0.0) if params.model == "coulomb" else (params.mu_s, params.viscous)


@part
def limit(law: Stribeck, speed: float, normal_force: float) -> tuple[float, float]:
    """Return F(s) [N] and dF/ds [N s/m] at speed [m/s] under normal_force [N]."""
    ratio = speed / law.stribeck_velocity
    extra = normal_force * (law.mu_s - law.mu_k) * math.exp(-ratio * ratio)
    slope = law.viscous - 2.0 * extra * ratio / law.stribeck_velocity
    return normal_force * law.mu_k + extra + law.viscous * speed, slope


project = projection(limit)


@part
def steepest_fall(law: Stribeck, normal_force: float) -> float:
    """Return max(0, -min dF/ds) [N s/m], reached at s = stribeck_velocity / sqrt(2)."""
    fall = math.sqrt(2.0 / math.e) * (law.mu_s - law.mu_k) * normal_force / law.stribeck_velocity
    return max(0.0, fall - law.viscous)


@part
def solve(law: Stribeck, u_free: Vec, A_hat: Sym, normal_force: float, dt: float, state: Vec) -> tuple[Vec, Vec, Vec]:
    """Project on the limit surface; rigid friction has no memory."""
    f_hat, u = project(law, u_free, A_hat, normal_force)
    return f_hat, u, state
