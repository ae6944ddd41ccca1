"""A safety filter of the grip: a control barrier function with a disturbance observer."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from slip_vic.experiments.baselines.schools import GripLaw
from slip_vic.experiments.law import Seen


class GraspCbf(GripLaw):
    """h = mu N - load >= 0 is kept by the rate u of the squeeze: min (u - u_0)^2 so that mu u - d + gamma h >= 0.

    d: rate of the load by a disturbance observer of first order, d = l (load - p), p' = d. u_0 goes back to the squeeze
    at first. With one input the QP is its own closed form, u = max(u_0, (d - gamma h) / mu).

    Source: Y. Kim, J. Kim, A. H. Li, A. D. Ames, C. Sloth, Robust adaptive safe robotic grasping with tactile sensing,
    arXiv:2411.07833: barrier, filter, observer. Ours, since theirs belong to their hand: gamma 20 1/s, l 50 1/s,
    return 2 1/s, and h with the load times 1.2.
    """

    gamma: ClassVar[float] = 20.0
    observer: ClassVar[float] = 50.0
    back: ClassVar[float] = 2.0
    margin: ClassVar[float] = 1.2

    def squeeze(self, arm: int, seen: Seen) -> float:
        """Return the squeeze after one period at the filtered rate."""
        load, dt = self.margin * self.load(seen), self.setup.period_s
        state = self.arms.setdefault(arm, np.array([load]))
        rate = self.observer * (load - float(state[0]))
        state[0] += (1.0 - np.exp(-self.observer * dt)) * (load - state[0])
        return max(seen.grip + self.filtered(seen.grip, load, rate) * dt, 0.0)

    def filtered(self, grip: float, load: float, rate: float) -> float:
        """Return the solution of the QP [N/s]."""
        nominal = self.back * (self.setup.grip - grip)
        return max(nominal, (rate - self.gamma * (self.mu * grip - load)) / self.mu)
