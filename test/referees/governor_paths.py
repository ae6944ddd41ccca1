"""Paths in plain numpy for the governor's tests: displacement and rotation vector on world axes from a start pose."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from test.referees.arrays import skew


def jacobian(phi):
    """Left Jacobian: omega = J phi_dot."""
    angle = np.linalg.norm(phi)
    if angle < 1e-4:
        S = skew(phi)
        return np.eye(3) + S / 2 + S @ S / 6
    S = skew(phi / angle)
    return np.eye(3) + (1 - np.cos(angle)) / angle * S + (1 - np.sin(angle) / angle) * S @ S


class BentPath:
    """way * quintic + side * bump, six coordinates; at rest at both ends.

    way, side: (6,) [m, rad]; duration [s]; start: attitude of the pad (3, 3).
    """

    def __init__(self, way, duration, side=None, start=None):
        self.way, self.duration = np.asarray(way, float), duration
        self.side = np.zeros(6) if side is None else np.asarray(side, float)
        self.start = np.eye(3) if start is None else start
        self.level = not (self.way[3:5].any() or self.side[3:5].any())  # it turns about one axis: J is 1
        self._last = None, None

    def coordinates(self, t):
        T, u = self.duration, min(max(t / self.duration, 0.0), 1.0)
        rest = u - u * u
        blends = u**3 * (10 - 15 * u + 6 * u * u), 30 * rest**2, 60 * rest * (1 - 2 * u)
        bumps = 64 * rest**3, 192 * rest**2 * (1 - 2 * u), 384 * rest * ((1 - 2 * u) ** 2 - rest)
        return [(a * self.way + b * self.side) / T**k for k, (a, b) in enumerate(zip(blends, bumps, strict=True))]

    def at(self, t):
        """Position (3,), attitude (3, 3), twist (6,), acceleration (6,); {w}."""
        # a cycle asks for where the one before ended
        if self._last[0] != t:
            self._last = t, self._at(t)
        return self._last[1]

    def _at(self, t):
        value, rate, rate_rate = self.coordinates(t)
        phi = value[3:]
        if self.level:
            return value[:3], Rotation.from_rotvec(phi).as_matrix() @ self.start, rate, rate_rate
        J, h = jacobian(phi), 1e-5
        J_dot = (jacobian(phi + h * rate[3:]) - jacobian(phi - h * rate[3:])) / (2 * h)
        return (
            value[:3],
            Rotation.from_rotvec(phi).as_matrix() @ self.start,
            np.concatenate((rate[:3], J @ rate[3:])),
            np.concatenate((rate_rate[:3], J @ rate_rate[3:] + J_dot @ rate[3:])),
        )
