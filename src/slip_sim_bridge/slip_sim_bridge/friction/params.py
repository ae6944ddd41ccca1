"""Parameters of the friction laws."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import model_validator

from slip_core.params import ParameterModel, parameter


class LugreParams(ParameterModel):
    """Bristles of the elasto-plastic LuGre model."""

    stiffness: float = parameter(1.0e5, "bristle stiffness sigma_0", unit="N/m", gt=0.0)
    damping: float = parameter(50.0, "bristle damping sigma_1", unit="N s/m", ge=0.0)
    breakaway_fraction: float = parameter(
        0.95, "fraction of the static limit up to which the bristles are purely elastic", ge=0.0, lt=1.0
    )


class FrictionParams(ParameterModel):
    """Friction between pads and object on an ellipsoidal limit surface."""

    model: Literal["stribeck", "coulomb", "lugre"] = parameter("stribeck", "friction model; coulomb uses mu_k only")
    mu_s: float = parameter(0.5, "static friction coefficient", ge=0.0)
    mu_k: float = parameter(0.4, "kinetic friction coefficient", ge=0.0)
    stribeck_velocity: float = parameter(
        0.05, "speed at which friction has fallen to the kinetic level", unit="m/s", gt=0
    )
    viscous: float = parameter(0.05, "viscous friction force per slip speed, added to mu N", unit="N s/m", ge=0.0)
    torsional_radius: float = parameter(0.03, "largest friction torque over largest friction force", unit="m", gt=0.0)
    falls_at_s: float = parameter(
        0.0, "simulated time at which mu_s and mu_k fall to the fraction falls_to", unit="s", ge=0
    )
    falls_to: float = parameter(
        1.0, "fraction of mu_s and mu_k that remains from falls_at_s on, as on a greasy spot", ge=0.0, le=1.0
    )
    lugre: LugreParams = LugreParams()

    @model_validator(mode="after")
    def _static_above_kinetic(self) -> Self:
        if self.mu_s < self.mu_k:
            raise ValueError(f"friction.mu_s {self.mu_s} must not be below friction.mu_k {self.mu_k}")
        return self
