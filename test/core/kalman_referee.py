"""Slow second implementation of the slip observer's filter: full matrices, samples in the order of their stamps."""

from __future__ import annotations

import numpy as np

H = np.array([[1.0, 0.0, 0.0]])


def predict(x, P, step, f, dt, q_v, q_b):
    F = np.array([[1.0, -dt, -dt * f], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    return F @ x + np.array([step, 0.0, 0.0]), F @ P @ F.T + np.diag([q_v, q_b, 0.0])


def correct(x, P, measured, variance):
    S = (H @ P @ H.T).item() + variance
    K = (P @ H.T / S).ravel()
    left = np.eye(3) - np.outer(K, H)
    # Joseph's form: symmetric and positive whatever the rounding.
    return x + K * (measured - x[0]), left @ P @ left.T + variance * np.outer(K, K)
