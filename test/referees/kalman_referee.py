"""The filter of the slip observer with full matrices: x (..., 3) = (v, b, c), P (..., 3, 3), of any number of axes."""

from __future__ import annotations

import math

import numpy as np

H = np.array([1.0, 0.0, 0.0])
ONE = np.eye(3)
RARE = 1e-6  # share of the dead band below which only its near edge matters


def predict(x, P, step, f, dt, q_v, q_b):
    n = x.shape[:-1]
    F = np.zeros((*n, 3, 3)) + ONE
    F[..., 0, 1], F[..., 0, 2] = -dt, -dt * f
    Q = np.zeros((*n, 3, 3))
    Q[..., 0, 0], Q[..., 1, 1] = q_v, q_b
    u = np.zeros((*n, 3))
    u[..., 0] = step
    return (F @ x[..., None])[..., 0] + u, F @ P @ F.swapaxes(-1, -2) + Q


def correct(x, P, z, R):
    S = P[..., 0, 0] + R
    K = P[..., :, 0] / S[..., None]
    left = ONE - K[..., :, None] * H
    # Joseph's form: symmetric and positive whatever the rounding.
    spread = np.asarray(R)[..., None, None] * (K[..., :, None] * K[..., None, :])
    return x + K * (z - x[..., 0])[..., None], left @ P @ left.swapaxes(-1, -2) + spread


def correct_within(x, P, band, R):
    """Mean and covariance given that a measurement lies within +-band: law of total expectation and variance."""
    S = P[0, 0] + R
    deviation = math.sqrt(S)
    low, high = (-band - x[0]) / deviation, (band - x[0]) / deviation
    inside = 0.5 * (math.erf(high / math.sqrt(2.0)) - math.erf(low / math.sqrt(2.0)))
    if inside < RARE:
        return correct(x, P, math.copysign(band, x[0]), np.asarray(R))

    def density(a):
        return math.exp(-0.5 * a * a) / math.sqrt(2.0 * math.pi)

    mean = x[0] + deviation * (density(low) - density(high)) / inside
    share = 1.0 + (low * density(low) - high * density(high)) / inside - ((density(low) - density(high)) / inside) ** 2
    K = P[:, 0] / S
    return x + K * (mean - x[0]), P - np.outer(K, K) * (S - share * S)
