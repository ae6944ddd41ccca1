"""From the `friction.*` parameters to the law that the solver uses, and to the numbers that its kernel takes."""

from __future__ import annotations

from slip_core.arrays import Array, readonly
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


def packed_law(law: FrictionLaw, rho: float) -> Array:
    """Return the law and the torsional radius [m] as the kernels take them; (8,), layout in `friction_kernel`.

    Implements: ours: Coulomb's law is a Stribeck curve without its hump; without bristles their stiffness is 0.
    """
    if isinstance(law, Coulomb):
        return readonly((law.mu, law.mu, 1.0, 0.0, 0.0, 0.0, 0.0, rho))
    if isinstance(law, LuGre):
        return readonly((*_curve(law.curve), law.stiffness, law.damping, law.breakaway_fraction, rho))
    if isinstance(law, Stribeck):
        return readonly((*_curve(law), 0.0, 0.0, 0.0, rho))
    raise TypeError(f"no kernel for {type(law).__name__}")


def _curve(law: Stribeck) -> tuple[float, float, float, float]:
    return law.mu_s, law.mu_k, law.stribeck_velocity, law.viscous
