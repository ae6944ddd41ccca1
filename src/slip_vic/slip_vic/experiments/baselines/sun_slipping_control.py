"""Model-based grip: the static limit surface, and more by a slip velocity that a friction model estimates."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from slip_core.arrays import Array
from slip_vic.experiments.baselines.schools import GripLaw
from slip_vic.experiments.law import Seen


class SunSlippingControl(GripLaw):
    """N = 1.1 N_static + abs(13 v + I(v)), at most 10 N; I is of first order with the DC gain 35.

    N_static: load over mu. v: sliding speed of a LuGre observer on the load, in which the bristles' deflection z is the
    state: z' = v - sigma_0 v z / g, v = gain (load - sigma_0 z), with g the friction limit at the squeeze that is
    commanded. In steady sliding sigma_0 z = g, so that v is the load beyond the limit times the gain.

    Source: M. Costanzo, G. De Maria, C. Natale, Two-fingered in-hand object handling based on force/tactile feedback,
    IEEE T-RO 36 (2020) 157-173, and Appl. Sci. 13 (2023) 921: 1.1, 13, 35 and 10 N. Ours: lag of I 0.1 s, sigma_0
    1000 N/m, gain 1 m/(N s), since those of the papers belong to their pads.
    """

    margin: ClassVar[float] = 1.1
    proportional: ClassVar[float] = 13.0
    dc_gain: ClassVar[float] = 35.0
    most: ClassVar[float] = 10.0
    lag_s: ClassVar[float] = 0.1
    sigma_0: ClassVar[float] = 1000.0
    gain: ClassVar[float] = 1.0

    def squeeze(self, arm: int, seen: Seen) -> float:
        """Return static part and slip part."""
        state = self.arms.setdefault(arm, np.zeros(2))  # z [m], I [N]
        load, dt = self.load(seen), self.setup.period_s
        speed = self.observed(state, load, max(self.mu * seen.grip, 1e-6), dt)
        state[1] += (1.0 - math.exp(-dt / self.lag_s)) * (self.dc_gain * speed - state[1])
        return min(self.margin * load / self.mu + abs(self.proportional * speed + state[1]), self.most)

    def observed(self, state: Array, load: float, limit: float, dt: float) -> float:
        """Return the sliding speed [m/s], and step the deflection: exactly for a constant speed."""
        speed = max(self.gain * (load - self.sigma_0 * state[0]), 0.0)
        fall = self.sigma_0 * (self.gain + speed / limit)
        steady = self.gain * load / fall
        state[0] = steady + (state[0] - steady) * math.exp(-fall * dt)
        return speed
