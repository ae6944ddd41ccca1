"""Closed loop in a plane, with the governor: hand = acceleration input, exact friction projection, no arm."""

from __future__ import annotations

import math
from collections import deque
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from test.referees.governor_bench import Governing, Governor
from test.referees.governor_paths import BentPath, rotation_of

PLANAR = [0, 1, 5]


def scene(mass, inertia, r, grip, mu_s, mu_k, radius, gravity, way, duration):
    return SimpleNamespace(
        mass=mass, inertia=inertia * np.eye(3), r=np.array([*r, 0.0]), radius=radius, grip=grip, mu_s=mu_s, mu_k=mu_k,
        force=mu_s * grip, gravity=np.array([*gravity, 0.0]), axes=np.array([1.0, 1, 0, 0, 0, 1]),
        way=np.array([way[0], way[1], 0, 0, 0, way[2]], float), duration=duration,
    )  # fmt: skip


PAPER = scene(0.5, 2e-3, (0.02, 0), 0.5, 0.5, 0.4, 0.03, (0, 0), (0.4, 0.3, 0.8), 2.0)
VERTICAL = scene(0.2, 3e-4, (0, 0.02), 4.616, 0.5, 0.45, 0.015, (0, -9.81), (0.3, 0.15, 0.4), 0.8)

K_D, D_D, M_D = np.array([5, 5, 4.5]), np.array([2.5, 2.5, 2.2]), np.array([0.4, 0.4, 0.3])


FLAG_DELAY, FLAG_THRESHOLD = 30, 1e-3
"""A sensor that only reports whether it slips: cycles, and the speed from which it does [m/s]."""


class Result(NamedTuple):
    """Of a run; worst: largest commanded load over what the guard lets pass."""

    slip_mm: float
    arrive: float
    overshoot_mm: float
    worst: float
    overrun: bool
    governor: Governor


def run(case, *, law="vic", friction=1.0, mass=1.0, flag=False, k_s=1000.0, end=8.0, falls=None, extra=None, **changes):
    """Return the result of a run; friction, mass: the true ones over those configured.

    flag: whether the slip sensor is a late flag. falls: (time, factor) of friction. extra: called every cycle with G.
    """
    dt, delay = 1e-3, FLAG_DELAY if flag else 0
    path = BentPath(case.way, case.duration)
    options = {"threshold": FLAG_THRESHOLD, "sensor_delay_ns": (delay + 1) * 1_000_000} if flag else {}
    G = Governor(path, case, **{"sensor_delay_ns": 1_000_000, **options, **changes}).plan()
    m, J, rho = case.mass * mass, case.inertia[2, 2] * mass, case.radius
    M_inv, S = np.array([1 / m, 1 / m, 1 / J]), np.array([1, 1, rho])  # both diagonal
    model = np.array([case.mass, case.mass, case.inertia[2, 2]])
    g = np.array([*case.gravity[:2], 0.0])
    x, v = np.zeros(3), np.zeros(3)
    pose, twist = np.array([-case.r[0], -case.r[1], 0.0]), np.zeros(3)
    goal = case.way[PLANAR]
    f = np.zeros(3)  # on the object
    f[:2] = -m * g[:2]
    f[2] = m * (case.r[0] * -g[1] - case.r[1] * -g[0]) * -1.0
    slip, v_s, arrived, overshoot, worst = np.zeros(2), np.zeros(3), math.nan, 0.0, 0.0
    on_the_way, sample, overrun = deque(), np.zeros(3), False
    direction = goal[:2] / np.linalg.norm(goal[:2])

    def limit(s, now):
        share = friction * (falls[1] if falls is not None and now >= falls[0] else 1.0)
        mu = case.mu_k + (case.mu_s - case.mu_k) * math.exp(-((s / 0.05) ** 2))
        return share * mu * case.grip + 0.05 * s

    for k in range(round(end / dt)):
        now, stamp = k * dt, k * 1_000_000
        # -- wrench and slip sensor
        R = rotation_of(np.array([0, 0, x[2]]))
        w = np.array([0, 0, v[2]])
        h = np.zeros(6)
        h[[0, 1]], h[5] = R[:2, :2].T @ -f[:2], -f[2]
        G.record_load(h, stamp)
        on_the_way.append((k + delay, stamp, v_s))
        while on_the_way and on_the_way[0][0] <= k:
            _, when, sample = on_the_way.popleft()
            G.slip(when, math.sqrt(sample[0] ** 2 + sample[1] ** 2 + (rho * sample[2]) ** 2))
        # -- reference
        p, R_d, v_d, a_d = G.before(np.array([x[0], x[1], 0]), R, np.array([v[0], v[1], 0, 0, 0, v[2]]))
        x_d = np.array([p[0], p[1], math.atan2(R_d[1, 0], R_d[0, 0])])
        v_d, a_d = v_d[PLANAR], a_d[PLANAR]
        # -- law
        r = x[:2] - pose[:2]
        v_law = sample if law == "vic" else np.zeros(3)
        e, e_dot = x - x_d, v - v_d
        fade = np.exp(-100 * np.abs(v_law))
        gate = math.tanh(100 * math.hypot(*v_law))
        a_o = np.array([f[0], f[1], f[2] - r[1] * f[0] + r[0] * f[1]]) / model + g
        w_o = v[2] - v_law[2]
        follow = np.array([a_o[0] - a_o[2] * r[1] - w_o**2 * r[0], a_o[1] + a_o[2] * r[0] - w_o**2 * r[1], a_o[2]])
        a_C = a_d - fade * (K_D * e + D_D * e_dot) / M_D + gate * (follow - k_s * v_law)
        six = np.zeros((2, 6))
        six[0, PLANAR], six[1, PLANAR] = a_C, a_d
        a_C = G.after(six[0], six[1], R, w) * a_C
        overrun |= bool(G.state.overrun)
        worst = max(worst, float(G.pad.commanded) / float(G.state.ceiling))
        if extra:
            extra(G)
        # -- hand and object
        v = v + dt * a_C
        G_T = np.array([[1, 0, -r[1]], [0, 1, r[0]], [0, 0, 1.0]])
        S_G = S[:, None] * G_T
        A = dt * (S_G * M_inv) @ S_G.T
        free = twist + dt * g
        u_free = S * (G_T @ free - v)
        y = -np.linalg.solve(A, u_free)
        if math.hypot(*y) > limit(0.0, now):
            eigenvalues, V = np.linalg.eigh(A)
            pairs = list(zip(eigenvalues.tolist(), (V.T @ u_free).tolist(), strict=True))
            low, high = 0.0, float(np.linalg.norm(u_free))
            for _ in range(50):
                s = 0.5 * (low + high)
                F = limit(s, now)
                low, high = (s, high) if sum((c / (s + F * a)) ** 2 for a, c in pairs) > 1 else (low, s)
            F = limit(s, now)
            y = -F * np.linalg.solve(s * np.eye(3) + F * A, u_free)
        f = S * y
        twist = free + dt * M_inv * (G_T.T @ f)
        x, pose = x + dt * v, pose + dt * twist
        v_s = v - G_T @ twist
        c, s = math.cos(pose[2]), math.sin(pose[2])
        slip += dt * np.array([c * v_s[0] + s * v_s[1], c * v_s[1] - s * v_s[0]])
        there = math.hypot(*(x - goal)[:2]) < 1e-3 and abs(x[2] - goal[2]) < math.radians(0.5)
        arrived = math.nan if not there else now if math.isnan(arrived) else arrived
        overshoot = max(overshoot, float(direction @ (x - goal)[:2]))
        if not math.hypot(*(x - x_d)[:2]) < 3.0:
            break
    return Result(1e3 * float(np.hypot(*slip)), arrived, 1e3 * overshoot, worst, overrun, G)


TO = {"mode": Governing.TIME_OPTIMAL}


def uniform(G):
    """Return the largest constant sdot whose load is within the margin of the backward pass."""
    p, F = G.points, float(G.config.path_margin * G.config.margin * G.state.estimate.F_hat)
    load = p["xx"] * 1.0
    x = 1.0
    for xx, xc, cc in zip(load, p["xc"], p["cc"], strict=True):
        if xx > 0:
            x = min(x, (math.sqrt(max(xc * xc - xx * (cc - F * F), 0.0)) - xc) / xx)
    return math.sqrt(x)
