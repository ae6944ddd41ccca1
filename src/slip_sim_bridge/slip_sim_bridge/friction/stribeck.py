"""Stribeck friction: F(s) = N (mu_k + (mu_s - mu_k) exp(-(s / stribeck_velocity)^2)) + viscous s.

The viscous part is a force per speed, which does not scale with N. Coulomb's law is the curve with mu_k alone.
"""

from __future__ import annotations

import math

from slip_core.compiled import part
from slip_core.records import Real, Record, dtype_of
from slip_core.vectors import ZERO, Sym, Vec, with_diagonal
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

ROOT_TOLERANCE = 1e-13  # of |.| = 1: rounding level of the secular equation
ROOT_ITERATIONS = 80  # bisection alone would need 45


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


@part
def steepest_fall(law: Stribeck, normal_force: float) -> float:
    """Return max(0, -min dF/ds) [N s/m], reached at s = stribeck_velocity / sqrt(2)."""
    fall = math.sqrt(2.0 / math.e) * (law.mu_s - law.mu_k) * normal_force / law.stribeck_velocity
    return max(0.0, fall - law.viscous)


@part
def solve(law: Stribeck, u_free: Vec, A_hat: Sym, normal_force: float, dt: float, state: Vec) -> tuple[Vec, Vec, Vec]:
    """Project on the limit surface; rigid friction has no memory.

    Stick where F(0) holds the load. Otherwise maximum dissipation, f_hat = -F(s) u / s: the speed is the root of
    |(s I + F(s) A_hat)^-1 u_free| = 1, bracketed by (0, |u_free|] and found by Newton steps on 1/|.| - 1, which is
    nearly a straight line in s.
    """
    hold = A_hat.solve(u_free)
    breakaway, _ = limit(law, 0.0, normal_force)
    if hold.dot(hold) <= breakaway * breakaway:
        return -hold, ZERO, state

    free_speed = u_free.norm()
    low, high = 0.0, free_speed
    force, _ = limit(law, free_speed, normal_force)
    speed = free_speed - force * u_free.dot(A_hat @ u_free) / (free_speed * free_speed)
    if not low < speed <= high:
        speed = 0.5 * high
    w, size = u_free, 1.0
    for _ in range(ROOT_ITERATIONS):
        force, slope = limit(law, speed, normal_force)
        M = with_diagonal(speed, force * A_hat)
        w = M.solve(u_free)
        size = w.norm()
        if abs(size - 1.0) <= ROOT_TOLERANCE:
            break
        if size > 1.0:
            low = speed
        else:
            high = speed
        gain = M.solve(w).dot(w + slope * (A_hat @ w))
        step = (size - 1.0) * size * size / gain if gain > 0.0 else math.inf
        following = speed + step
        if not low < following < high:
            following = 0.5 * (low + high)
        if abs(following - speed) <= ROOT_TOLERANCE * speed:
            break
        speed = following
    direction = (1.0 / size) * w
    return -force * direction, speed * direction, state
