"""From the `friction.*` parameters to the law that the solver uses."""

from __future__ import annotations

from slip_sim_bridge.sim.friction import Coulomb, FrictionLaw, Stribeck
from slip_sim_bridge.sim.lugre import LuGre
from slip_sim_bridge.sim.params import FrictionParams


def friction_law(params: FrictionParams) -> FrictionLaw:
    """Return the law named by `params.model`; coefficients [-], speeds [m/s], viscous and damping [N s/m].

    Implements: ours: one place that knows which parameter belongs to which law.
    """
    if params.model == "coulomb":
        return Coulomb(params.mu_k)
    curve = Stribeck(params.mu_s, params.mu_k, params.stribeck_velocity, params.viscous)
    if params.model == "stribeck":
        return curve
    bristles = params.lugre
    return LuGre(curve, bristles.stiffness, bristles.damping, bristles.breakaway_fraction)
