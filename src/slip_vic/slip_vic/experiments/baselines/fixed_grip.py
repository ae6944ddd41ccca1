"""Constant grip: squeeze once for the whole path, with a safety factor."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from slip_vic.experiments.baselines.schools import PLAN_POINTS, GripLaw, planned_load
from slip_vic.experiments.law import Seen, Setup


class FixedGrip(GripLaw):
    """N = factor * (largest load on the path) / mu.

    Source: the textbook's static friction, load by the limit surface of `schools.measured_load`. Object, friction and
    path are as configured; several arms share the load. factor 2: a usual safety factor of grippers; sweep it
    (`fixed_grip?factor=1.5`).
    """

    factor: ClassVar[float] = 2.0

    def reset(self, setup: Setup) -> None:
        """Look at the whole path."""
        super().reset(setup)
        times = np.linspace(0.0, setup.duration_s, PLAN_POINTS)
        most = max(float(np.linalg.norm(planned_load(setup, setup.reference(t)))) for t in times)
        self.force = self.factor * most / self.mu / len(setup.parameters)

    def squeeze(self, arm: int, seen: Seen) -> float:
        """Return the constant."""
        return self.force
