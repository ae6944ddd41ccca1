"""Coulomb friction: one coefficient, mu_k, at every speed, at rest too."""

from __future__ import annotations

from slip_core.compiled import part
from slip_core.records import Real, Record, dtype_of
from slip_core.symmetric import Sym
from slip_core.vectors import Vec
from slip_sim_bridge.friction.limit_surface import projection
from slip_sim_bridge.friction.params import FrictionParams


class Coulomb(Record):
    """Parameters of the law."""

    mu: Real
    """Friction over normal force."""


LAYOUT = dtype_of(Coulomb)
STATEFUL = False


def fill(law: Coulomb, params: FrictionParams) -> None:
    """Write the parameters to the record."""
    law.mu = params.mu_k


@part
def limit(law: Coulomb, speed: float, normal_force: float) -> tuple[float, float]:
    """Return F = mu N [N] and slope 0 [N s/m]."""
    return normal_force * law.mu, 0.0


project = projection(limit)


@part
def steepest_fall(law: Coulomb, normal_force: float) -> float:
    """Return 0 [N s/m]: a constant limit bounds no step."""
    return 0.0


@part
def solve(law: Coulomb, u_free: Vec, A_hat: Sym, normal_force: float, dt: float, state: Vec) -> tuple[Vec, Vec, Vec]:
    """Project on the limit surface; rigid friction has no memory."""
    f_hat, u = project(law, u_free, A_hat, normal_force)
    return f_hat, u, state
