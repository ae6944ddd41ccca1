"""Predicted motion: the velocity nearest to the nominal one for which no slip is predicted."""

from __future__ import annotations

from typing import ClassVar, Final

import numpy as np

from slip_core.arrays import Array
from slip_core.types import PadMotion
from slip_vic.experiments.law import Seen, Setup
from slip_vic.experiments.schools import MotionLaw, planned_load

SAMPLES: Final = 10
RATE: Final = 60.0
BASES: Final = 4
WIDTH: Final = 0.015
MOST: Final = 0.15
"""Horizon, its rate [Hz], Gaussian bases over it and their width h, largest change of the velocity [m/s]: Nazari et
al., and imanlab/proactive-slip-control (MIT)."""
ROUNDS: Final = 40
"""Of the alternating projections (ours)."""
WEIGHT: Final = 10.0
"""Of the change of the velocity in them; the solution is the same, 10 comes there fast (ours)."""


class ProactiveSlipControl(MotionLaw):
    """At 60 Hz: v = v_nominal + Phi w over 10 samples, least |Phi w| with load(v') <= limit and |Phi w| <= 0.15 m/s.

    The limit surface predicts slip, in the place of the publication's LSTM. v_nominal goes back to the path:
    v_d + back (x_d - x). Attitude is not changed.

    Source: K. Nazari, W. Mandil, A. Ghalamzan, Proactive slip control by learned slip model and trajectory adaptation,
    CoRL 2022. Ours: back 3 1/s, margin 0.9 of the friction limit, solved by ADMM.
    """

    margin: ClassVar[float] = 0.9
    back: ClassVar[float] = 3.0

    def reset(self, setup: Setup) -> None:
        """Begin at the path's start."""
        super().reset(setup)
        self._bases = gaussian_bases()
        self._change = np.diff(self._bases, axis=0, prepend=np.zeros((1, BASES))) * RATE
        start = setup.reference(0.0)
        self._position, self._velocity = start.position.copy(), np.zeros(3)
        self._acceleration, self._next, self._last = np.zeros(3), 0.0, 0.0

    def wanted(self, seen: Seen) -> PadMotion:
        """Return the reference as it is changed."""
        dt, self._last = seen.time - self._last, seen.time
        self._position = self._position + dt * self._velocity + 0.5 * dt**2 * self._acceleration
        self._velocity = self._velocity + dt * self._acceleration
        if seen.time >= self._next:
            self._next += 1.0 / RATE
            self._acceleration = (self.planned(seen.time) - self._velocity) * RATE
        path = self.setup.reference(seen.time)
        twist = np.concatenate((self._velocity, path.twist[3:]))
        return PadMotion(
            self._position, path.rotation, twist, np.concatenate((self._acceleration, path.acceleration[3:]))
        )

    def planned(self, now: float) -> Array:
        """Return the velocity at the end of the first sample (3,) [m/s]."""
        ahead = [self.setup.reference(now + (k + 1) / RATE) for k in range(SAMPLES)]
        at, nominal = self._position.copy(), np.empty((SAMPLES, 3))
        for k, point in enumerate(ahead):
            nominal[k] = point.twist[:3] + self.back * (point.position - at)
            at = at + nominal[k] / RATE
        before = np.vstack((self._velocity, nominal[:-1]))
        free = [planned_load(self.setup, still(point)) for point in ahead]
        A = np.array([load_of_acceleration(self.setup, point.rotation) for point in ahead])
        b = np.array(free) + np.einsum("kij,kj->ki", A, (nominal - before) * RATE)
        return nominal[0] + nearest(self._bases, self._change, A, b, self.margin * self.setup.friction_limit)[0]


def load_of_acceleration(setup: Setup, rotation: Array) -> Array:
    """Return what a linear acceleration of the pad adds to its load, as a matrix (3, 3) [N s2/m]."""
    x, y, z = rotation.T
    lever = -rotation @ setup.grasp_rotation.T @ setup.grasp_position
    return setup.mass * np.array([x, y, np.cross(z, lever) / setup.torsional_radius])


def gaussian_bases() -> Array:
    """Return the bases over the horizon as (SAMPLES, BASES); exp(-(t - c)^2 / (2 h)), t from 0 to 1."""
    t, c = np.linspace(0.0, 1.0, SAMPLES), np.linspace(0.0, 1.0, BASES)
    return np.exp(-((t[:, None] - c) ** 2) / (2.0 * WIDTH))


def still(point: PadMotion) -> PadMotion:
    """Return a point with its attitude and spin, without a linear acceleration."""
    return point._replace(acceleration=point.acceleration * [0, 0, 0, 1, 1, 1])


def nearest(bases: Array, change: Array, A: Array, b: Array, limit: float) -> Array:
    """Return the least change of the velocity (SAMPLES, 3) [m/s] for which |A v' + b| <= limit and |v| <= MOST.

    ADMM (Boyd et al. 2011, 5.1): the load of each sample and the velocity are projected on their balls in turn.

    Args:
        bases: Phi; change: its derivative; A: load of an acceleration (SAMPLES, 3, 3); b: load without (SAMPLES, 3).
        limit: of the load [N].
    """
    if (np.linalg.norm(b, axis=1) <= limit).all():
        return np.zeros((SAMPLES, 3))
    scale = MOST / limit  # of a load, so that both constraints weigh alike
    rows = scale * np.einsum("kij,kb->kibj", A, change).reshape(3 * SAMPLES, 3 * BASES)
    velocity = np.einsum("kb,ij->kibj", bases, np.eye(3)).reshape(3 * SAMPLES, 3 * BASES)
    stacked, offset = np.vstack((rows, velocity)), np.concatenate((scale * b.ravel(), np.zeros(3 * SAMPLES)))
    solve = np.linalg.inv(WEIGHT * velocity.T @ velocity + stacked.T @ stacked + 1e-9 * np.eye(3 * BASES)) @ stacked.T
    z, u = offset.copy(), np.zeros_like(offset)
    w = np.zeros(3 * BASES)
    for _ in range(ROUNDS):
        w = solve @ (z - u - offset)
        y = stacked @ w + offset
        z = ball((y + u).reshape(-1, 3), MOST).ravel()
        u += y - z
    return ball((velocity @ w).reshape(-1, 3), MOST)


def ball(points: Array, radius: float) -> Array:
    """Return points (m, 3), those outside of a ball moved to it."""
    size = np.linalg.norm(points, axis=1, keepdims=True)
    return points * np.minimum(1.0, radius / np.maximum(size, 1e-12))
