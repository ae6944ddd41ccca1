"""Laws of other schools that command the squeeze alone: constant, reactive, from a friction model, a safety filter."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import replace
from typing import ClassVar

import numpy as np

from slip_core.arrays import Array
from slip_vic.experiments.law import Answer, Seen, Setup
from slip_vic.experiments.ours import Classical
from slip_vic.experiments.schools import PLAN_POINTS, measured_load, planned_load


class GripLaw(Classical, ABC):
    """Classical impedance control moves the arm; `squeeze` commands the grip of each."""

    needs: ClassVar[frozenset[str]] = frozenset({"wrench", "slip", "grip"})

    def reset(self, setup: Setup) -> None:
        """Begin a run."""
        super().reset(setup)
        self.setup, self.mu = setup, setup.friction_limit / setup.grip
        self.arms: dict[int, Array] = {}

    def step(self, seen: Seen) -> tuple[Answer, ...]:
        """Answer a tick."""
        pairs = zip(super().step(seen), (seen, *seen.others), strict=True)
        return tuple(
            None if answer is None else replace(answer, grip=self.squeeze(arm, one))
            for arm, (answer, one) in enumerate(pairs)
        )

    @abstractmethod
    def squeeze(self, arm: int, seen: Seen) -> float:
        """Return the squeeze that is wanted [N]."""

    def load(self, seen: Seen) -> float:
        """Return the load of the pad by the limit surface, force and torque together [N]."""
        return float(np.linalg.norm(measured_load(self.setup, seen.wrench)))


class FixedGrip(GripLaw):
    """N = factor * (largest load on the path) / mu.

    Source: the textbook's static friction, load by the limit surface of `measured_load`. Object, friction and
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
