"""Paths in plain numpy for the governor's tests: displacement and rotation vector on world axes from a start pose."""

from __future__ import annotations

import numpy as np


def skew(a):
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0.0]])


def rotation_of(phi):
    angle = np.linalg.norm(phi)
    if angle < 1e-12:
        return np.eye(3) + skew(phi)
    S = skew(phi / angle)
    return np.eye(3) + np.sin(angle) * S + (1 - np.cos(angle)) * S @ S


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
        blend = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])
        bump = 64 * np.polynomial.Polynomial([0, 1, -1]) ** 3
        self._last = None, None
        self.blends = [(blend.deriv(k), bump.deriv(k)) if k else (blend, bump) for k in range(3)]

    def coordinates(self, t):
        u = min(max(t / self.duration, 0.0), 1.0)
        return [(a(u) * self.way + b(u) * self.side) / self.duration**k for k, (a, b) in enumerate(self.blends)]

    def at(self, t):
        """Position (3,), attitude (3, 3), twist (6,), acceleration (6,); {w}."""
        # a cycle asks for where the one before ended
        if self._last[0] != t:
            self._last = t, self._at(t)
        return self._last[1]

    def _at(self, t):
        value, rate, rate_rate = self.coordinates(t)
        phi, J, h = value[3:], jacobian(value[3:]), 1e-5
        J_dot = (jacobian(phi + h * rate[3:]) - jacobian(phi - h * rate[3:])) / (2 * h)
        return (
            value[:3],
            rotation_of(phi) @ self.start,
            np.concatenate((rate[:3], J @ rate[3:])),
            np.concatenate((rate_rate[:3], J @ rate_rate[3:] + J_dot @ rate[3:])),
        )
