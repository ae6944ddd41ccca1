"""Second implementation of the joint state estimator: matrices, the full Riccati recursion, and time as it is."""

from __future__ import annotations

import itertools

import numpy as np
from scipy.linalg import expm


def matrices(bandwidth, dt):
    """Return F (3, 3) and G (3,) of (q, v, d) with a constant input, by the matrix exponential."""
    A = np.zeros((4, 4))
    A[0, 1] = 1.0
    A[1, 1:] = (-bandwidth, 1.0, bandwidth) if bandwidth else (0.0, 1.0, 1.0)
    E = expm(A * dt)
    return E[:3, :3], E[:3, 3]


def covariances(position, velocity, model, drift, bandwidth, dt, steps=20_000):
    """Return predicted and updated covariance and gain after many steps of the recursion from total doubt."""
    F, _ = matrices(bandwidth, dt)
    white = model * F[:, 2] * [1.0, 1.0, 0.0]
    Q = np.outer(white, white) + np.diag([0.0, 0.0, drift**2 * dt])
    H, R, P = np.eye(3)[:2], np.diag([position**2, velocity**2]), np.diag([1.0, 1.0, 1e4])
    for _ in range(steps):
        predicted = F @ P @ F.T + Q
        K = predicted @ H.T @ np.linalg.inv(H @ predicted @ H.T + R)
        P = (np.eye(3) - K @ H) @ predicted @ (np.eye(3) - K @ H).T + K @ R @ K.T
    return predicted, P, K


class Delayed:
    """A joint whose samples are `late` [s] old; inputs are kept with their times, and integrated between any two."""

    def __init__(self, gain, bandwidth, period, late, q, v):
        self.gain, self.bandwidth, self.period, self.late = gain, bandwidth, period, late
        self.x, self.at = np.array([q, v, 0.0]), -late
        self.inputs = []

    def _to(self, x, start, end):
        """Return the state at `end` [s]; before the first input it is that input's zero."""
        edges = sorted({start, end, *(t for t, _ in self.inputs if start < t < end)})
        for a, b in itertools.pairwise(edges):
            u = [u for t, u in self.inputs if t <= a + 1e-9]
            F, G = matrices(self.bandwidth, b - a)
            x = F @ x + G * (u[-1] if u else 0.0)
        return x

    def sample(self, now, q, v):
        """Return the estimate of now."""
        measured = now - self.late
        x = self._to(self.x, self.at, measured)
        self.x, self.at = x + self.gain @ (np.array([q, v]) - x[:2]), measured
        return self._to(self.x, measured, now)

    def act(self, now, u):
        self.inputs.append((now, u))
