"""Reactive grip: more at once where it slips, less again slowly."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from slip_vic.experiments.baselines.schools import GripLaw
from slip_vic.experiments.law import Seen


class SlipAwareHold(GripLaw):
    """N = 2 max(load_t, load_tau, 2 N) + 100 v_s; rises at once, decays by 0.95 a sample at 500 Hz.

    load_t and load_tau: the squeeze that the tangential force and the torsional torque need by themselves, F / mu and
    tau / (mu r). v_s: linear slip speed [m/s].

    Source: G. A. Waltersson, Y. Karayiannidis, planar friction modelling and slip-aware manipulation with parallel
    grippers; factor 2, floor 2 N, 100 N s/m, 0.95 and 500 Hz as in Gabrieleenx/
    Slip-Aware-Object-Manipulation-with-Parallel-Grippers (MIT).
    """

    factor: ClassVar[float] = 2.0
    floor: ClassVar[float] = 2.0
    slip_gain: ClassVar[float] = 100.0
    decay: ClassVar[float] = 0.95
    rate: ClassVar[float] = 500.0

    def squeeze(self, arm: int, seen: Seen) -> float:
        """Return the larger one of what the load needs and what is left of before."""
        tangential = float(np.hypot(seen.wrench[0], seen.wrench[1])) / self.mu
        torsional = abs(float(seen.wrench[5])) / (self.mu * self.setup.torsional_radius)
        speed = float(np.linalg.norm(seen.slip[:3]))
        wanted = self.factor * max(tangential, torsional, self.floor) + self.slip_gain * speed
        return max(wanted, seen.grip * self.decay ** (self.rate * self.setup.period_s))
