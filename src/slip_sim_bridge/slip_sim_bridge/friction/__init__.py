"""Friction between pads and object: one file per law, behind one interface.

In scaled coordinates (see `limit_surface`) a law solves one implicit step. A new law is a file with what `FrictionLaw`
requires, its name in `LAWS` and in `friction/params.py`, and a test.
"""

from __future__ import annotations

import importlib
from typing import Any, Final, Protocol, cast

import numpy as np

from slip_core.arrays import Array
from slip_core.records import new, record
from slip_core.vectors import Sym, Vec
from slip_sim_bridge.friction.params import FrictionParams

LAWS: Final = {"stribeck": "stribeck", "coulomb": "stribeck", "lugre": "lugre"}
"""Module of each `friction.model`."""


class FrictionLaw(Protocol):
    """What the module of a law offers. `law` is a record of its `LAYOUT`; the last two functions are compiled parts."""

    def __hash__(self) -> int: ...

    LAYOUT: np.dtype[np.void]
    """Its parameters by name."""

    def fill(self, law: Any, params: FrictionParams) -> None:
        """Write the parameters to the record."""
        ...

    def steepest_fall(self, law: Any, normal_force: float) -> float:
        """Return max(0, -min dF/ds) [N s/m]: what limits the step size."""
        ...

    def solve(
        self, law: Any, u_free: Vec, A_hat: Sym, normal_force: float, dt: float, state: Vec
    ) -> tuple[Vec, Vec, Vec]:
        """Return force, velocity u = u_free + A_hat f_hat and next state of one implicit step, scaled; 3 numbers each.

        The state is the law's own, zero at first and without pressure; normal_force > 0 [N], dt [s].
        """
        ...


def friction_law(params: FrictionParams) -> tuple[FrictionLaw, Array]:
    """Return the law that `params.model` names, and its parameters laid out by its `LAYOUT`."""
    law = cast(FrictionLaw, importlib.import_module(f"{__name__}.{LAWS[params.model]}"))
    parameters = new(law.LAYOUT)
    law.fill(record(parameters, law.LAYOUT), params)
    return law, parameters
