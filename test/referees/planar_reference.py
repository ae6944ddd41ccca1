"""Referee: the paper's planar experiment with a pad that follows its quintic exactly, in x, y and theta only.

No MuJoCo, no arm, no code of the suite; the friction step is solved by plain bisection.
"""

from __future__ import annotations

import math

import numpy as np


def quintic(time, duration):
    """Share of the way and its rate."""
    u = min(max(time / duration, 0.0), 1.0)
    return 10 * u**3 - 15 * u**4 + 6 * u**5, (30 * u**2 - 60 * u**3 + 30 * u**4) / duration


def carried_object(
    *, mass=0.5, inertia=2e-3, lever=0.02, way=(0.4, 0.3, 0.8), duration=2.0, end=3.0, grip=0.5, mu_s=0.5, mu_k=0.4,
    stribeck=0.05, viscous=0.05, rho=0.03, dt=1e-3,
):  # fmt: skip
    """Return slip distance [m], angle [rad] of the pad over the object at `end` [s], peak slip speed, |v_x| [m/s]."""
    way, S = np.array(way), np.diag([1.0, 1.0, rho])
    M_inv = np.diag([1 / mass, 1 / mass, 1 / inertia])
    pose, twist = np.array([-lever, 0.0, 0.0]), np.zeros(3)  # of the centre of mass
    peak, peak_x = 0.0, 0.0

    def limit(s):
        return grip * (mu_k + (mu_s - mu_k) * math.exp(-((s / stribeck) ** 2))) + viscous * s

    for k in range(round(end / dt)):
        share, rate = quintic((k + 1) * dt, duration)
        pad, pad_twist = share * way, rate * way
        r = pad[:2] - pose[:2]
        G_T = np.array([[1.0, 0.0, -r[1]], [0.0, 1.0, r[0]], [0.0, 0.0, 1.0]])
        A = dt * S @ G_T @ M_inv @ G_T.T @ S
        u_free = S @ (G_T @ twist - pad_twist)
        f = -np.linalg.solve(A, u_free)
        if np.linalg.norm(f) > limit(0.0):
            eigenvalues, V = np.linalg.eigh(A)
            pairs = list(zip(eigenvalues.tolist(), (V.T @ u_free).tolist(), strict=True))
            low, high = 0.0, float(np.linalg.norm(u_free))
            for _ in range(60):
                s = 0.5 * (low + high)
                F = limit(s)
                too_slow = sum((c / (s + F * a)) ** 2 for a, c in pairs) > 1.0
                low, high = (s, high) if too_slow else (low, s)
            f = -F * np.linalg.solve(s * np.eye(3) + F * A, u_free)
            u = u_free + A @ f
            peak, peak_x = max(peak, float(np.hypot(*u[:2]))), max(peak_x, abs(float(u[0])))
        twist = twist + dt * M_inv @ G_T.T @ (S @ f)
        pose = pose + dt * twist
    c, s = np.cos(pose[2]), np.sin(pose[2])
    grasped = pose[:2] + lever * np.array([c, s])
    return float(np.hypot(*(pad[:2] - grasped))), float(pad[2] - pose[2]), peak, peak_x
