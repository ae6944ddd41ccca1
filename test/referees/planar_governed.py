"""Closed loop in a plane, with the governor: hand = acceleration input, exact friction projection, no arm.

`table` gives the table of the design: slip, arrival, overshoot with and without governor.
"""

from __future__ import annotations

import math
from collections import deque
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from test.referees.governor_bench import Friction, Governing, Governor
from test.referees.governor_paths import BentPath, rotation_of

PLANAR = [0, 1, 5]


def scene(mass, inertia, r, grip, mu_s, mu_k, radius, gravity, way, duration):
    return SimpleNamespace(
        mass=mass, inertia=inertia * np.eye(3), r=np.array([*r, 0.0]), radius=radius, grip=grip, mu_s=mu_s, mu_k=mu_k,
        force=mu_s * grip, gravity=np.array([*gravity, 0.0]), axes=np.array([1.0, 1, 0, 0, 0, 1]),
        way=np.array([way[0], way[1], 0, 0, 0, way[2]], float), duration=duration,
    )  # fmt: skip


PAPER = scene(0.5, 2e-3, (0.02, 0), 0.5, 0.5, 0.4, 0.03, (0, 0), (0.4, 0.3, 0.8), 2.0)
GLASS = scene(0.144, 3.456e-4, (0, 0.03), 1.6, 0.4, 0.35, 0.015, (0, 0), (0.1, 0.45, 0.5), 0.8)
VERTICAL = scene(0.2, 3e-4, (0, 0.02), 4.616, 0.5, 0.45, 0.015, (0, -9.81), (0.3, 0.15, 0.4), 0.8)

K_D, D_D, M_D = np.array([5, 5, 4.5]), np.array([2.5, 2.5, 2.2]), np.array([0.4, 0.4, 0.3])


class Sensor(NamedTuple):
    """period and delay [cycles], dead band, noise, quantum [m/s]; angular ones as the presets have them."""

    period: int = 1
    delay: int = 0
    dead: float = 0.0
    dead_angular: float = 0.0
    noise: float = 0.0
    noise_angular: float = 0.0
    quantum: float = 0.0
    threshold: float = 5e-5


IDEAL = Sensor()
OPTICAL_120 = Sensor(8, 10, 2e-3, 0.1, 2.2e-4, 9e-3, 9.5e-4, 1.5e-3)
VISION_25 = Sensor(40, 80, 5e-3, 0.1, 3.3e-3, 6e-2, 0.0, 1.6e-2)
FLAG = Sensor(1, 30, 0.0, 0.0, 0.0, 0.0, 0.0, 1e-3)


class Result(NamedTuple):
    slip_mm: float
    peak_mm_s: float
    arrive: float
    overshoot_mm: float
    worst: float
    F_hat: float
    events: int
    overrun: bool
    governor: object


def run(
    case, *, governor=True, law="vic", friction=1.0, mass=1.0, sensor=IDEAL, k_s=1000.0, end=8.0, falls=None, seed=0,
    window=1, guard=True, scaling=None, extra=None, estimator=Friction.LEARNT, **changes,
):  # fmt: skip
    """Return what becomes of a run; friction, mass: the true ones over those told; falls: (time, factor) of friction.

    scaling: uniform speed along the path instead of the governor. extra: called every cycle with (k, Governor).
    """
    dt, rng = 1e-3, np.random.default_rng(seed)
    path = BentPath(case.way, case.duration)
    G = None
    if governor:
        delay = (sensor.delay + sensor.period) * 1_000_000
        options = {
            "mode": Governing.SLOW_DOWN,
            "window": window,
            "threshold": sensor.threshold,
            "sensor_delay_ns": delay,
        }
        G = Governor(path, case, **{**options, **changes}, estimator=estimator).plan()
    m, J, rho = case.mass * mass, case.inertia[2, 2] * mass, case.radius
    M_inv, S = np.array([1 / m, 1 / m, 1 / J]), np.array([1, 1, rho])  # both diagonal
    told, noise = (
        np.array([case.mass, case.mass, case.inertia[2, 2]]),
        np.array([*[sensor.noise] * 2, sensor.noise_angular]),
    )
    g = np.array([*case.gravity[:2], 0.0])
    x, v = np.zeros(3), np.zeros(3)
    pose, twist = np.array([-case.r[0], -case.r[1], 0.0]), np.zeros(3)
    goal = case.way[PLANAR]
    f = np.zeros(3)  # on the object
    f[:2] = -m * g[:2]
    f[2] = m * (case.r[0] * -g[1] - case.r[1] * -g[0]) * -1.0
    slip, v_s, arrived, overshoot, peak, worst = np.zeros(2), np.zeros(3), math.nan, 0.0, 0.0, 0.0
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
        if G:
            h = np.zeros(6)
            h[[0, 1]], h[5] = R[:2, :2].T @ -f[:2], -f[2]
            G.feel(h, stamp)
        if k % sensor.period == 0:
            reading = v_s + rng.normal(size=3) * noise
            if sensor.quantum > 0:
                reading[:2] = sensor.quantum * np.round(reading[:2] / sensor.quantum)
            reading[:2] *= math.hypot(*reading[:2]) > sensor.dead
            reading[2] *= abs(reading[2]) > sensor.dead_angular
            on_the_way.append((k + sensor.delay, stamp, reading))
        while on_the_way and on_the_way[0][0] <= k:
            _, when, sample = on_the_way.popleft()
            if G:
                G.slip(when, math.sqrt(sample[0] ** 2 + sample[1] ** 2 + (rho * sample[2]) ** 2))
        # -- reference
        if G:
            p, R_d, v_d, a_d = G.before(np.array([x[0], x[1], 0]), R, np.array([v[0], v[1], 0, 0, 0, v[2]]))
            x_d = np.array([p[0], p[1], math.atan2(R_d[1, 0], R_d[0, 0])])
            v_d, a_d = v_d[PLANAR], a_d[PLANAR]
        else:
            sigma = scaling or 1.0
            x_d, v_d, a_d = (sigma**n * q[PLANAR] for n, q in enumerate(path.coordinates(sigma * now)))
        # -- law
        r = x[:2] - pose[:2]
        v_law = sample if law == "vic" else np.zeros(3)
        e, e_dot = x - x_d, v - v_d
        fade = np.exp(-100 * np.abs(v_law))
        gate = math.tanh(100 * math.hypot(*v_law))
        a_o = np.array([f[0], f[1], f[2] - r[1] * f[0] + r[0] * f[1]]) / told + g
        w_o = v[2] - v_law[2]
        follow = np.array([a_o[0] - a_o[2] * r[1] - w_o**2 * r[0], a_o[1] + a_o[2] * r[0] - w_o**2 * r[1], a_o[2]])
        a_C = a_d - fade * (K_D * e + D_D * e_dot) / M_D + gate * (follow - k_s * v_law)
        if G:
            six = np.zeros((2, 6))
            six[0, PLANAR], six[1, PLANAR] = a_C, a_d
            factor = G.after(six[0], six[1], R, w)
            a_C = factor * a_C if guard else a_C
            overrun |= bool(G.state.overrun)
            worst = max(worst, float(G.pad.commanded) / float(G.state.ceiling))
            if extra:
                extra(k, G)
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
        peak = max(peak, math.hypot(*v_s[:2]))
        there = math.hypot(*(x - goal)[:2]) < 1e-3 and abs(x[2] - goal[2]) < math.radians(0.5)
        arrived = math.nan if not there else now if math.isnan(arrived) else arrived
        overshoot = max(overshoot, float(direction @ (x - goal)[:2]))
        if not math.hypot(*(x - x_d)[:2]) < 3.0:
            break
    return Result(
        1e3 * float(np.hypot(*slip)), 1e3 * peak, arrived, 1e3 * overshoot, worst,
        float(G.state.estimate.F_hat) if G else math.nan, int(G.state.estimate.events) if G else 0,
        overrun, G,
    )  # fmt: skip


TO = {"mode": Governing.TIME_OPTIMAL}


ROWS = {
    "classical": (PAPER, {"governor": False, "law": "classical"}),
    "the paper's law": (PAPER, {"governor": False}),
    "governor TO": (PAPER, dict(margin=1.0, **TO)),
    "governor SD": (PAPER, {"margin": 1.0}),
    "governor SD, margin 0.95": (PAPER, {"margin": 0.95}),
    "uniform scaling, same margin": (PAPER, {"governor": False, "law": "classical", "scaling": -1.0}),
    "friction -20 %, vic alone": (PAPER, {"governor": False, "friction": 0.8}),
    "friction -20 %, SD": (PAPER, {"friction": 0.8}),
    "friction -40 %, vic alone": (PAPER, {"governor": False, "friction": 0.6}),
    "friction -40 %, SD": (PAPER, {"friction": 0.6}),
    "friction -40 %, TO": (PAPER, dict(friction=0.6, **TO)),
    "unknown, SD": (PAPER, {"told": 0.5, "probing": True}),
    "unknown, TO": (PAPER, dict(told=0.5, probing=True, **TO)),
    "unknown, 120 Hz, SD": (PAPER, {"told": 0.5, "probing": True, "sensor": OPTICAL_120, "law": "classical"}),
    "-40 %, 120 Hz, classical below": (PAPER, {"friction": 0.6, "sensor": OPTICAL_120, "law": "classical"}),
    "-40 %, 120 Hz, vic (k_s 44) below": (PAPER, {"friction": 0.6, "sensor": OPTICAL_120, "k_s": 44.0}),
    "-40 %, 120 Hz, vic (k_s 44) alone": (
        PAPER,
        {"governor": False, "friction": 0.6, "sensor": OPTICAL_120, "k_s": 44.0},
    ),
    "-40 %, 25 Hz, classical below": (PAPER, {"friction": 0.6, "sensor": VISION_25, "law": "classical"}),
    "flag 30 ms, classical, -20 %": (PAPER, {"friction": 0.8, "sensor": FLAG, "law": "classical"}),
    "flag 30 ms, classical, -40 %": (PAPER, {"friction": 0.6, "sensor": FLAG, "law": "classical"}),
    "mass +40 %: classical": (PAPER, {"governor": False, "law": "classical", "mass": 1.4}),
    "mass +40 %: vic": (PAPER, {"governor": False, "mass": 1.4}),
    "mass +40 %: SD": (PAPER, {"mass": 1.4}),
    "mass +25 %: SD": (PAPER, {"mass": 1.25}),
    "mass -25 %: SD": (PAPER, {"mass": 0.75}),
    "friction falls 20 % half way": (PAPER, {"falls": (1.0, 0.8)}),
    "friction falls 40 % half way": (PAPER, {"falls": (1.0, 0.6)}),
    "friction falls 20 % half way, TO": (PAPER, dict(falls=(1.0, 0.8), **TO)),
    "glass: classical": (GLASS, {"governor": False, "law": "classical", "end": 4.0}),
    "glass: SD": (GLASS, {"end": 4.0, "margin": 1.0}),
    "glass: TO": (GLASS, dict(end=4.0, margin=1.0, **TO)),
    "vertical: classical": (VERTICAL, {"governor": False, "law": "classical", "end": 4.0}),
    "vertical: SD, margin 1": (VERTICAL, {"end": 4.0, "margin": 1.0}),
    "vertical: TO, margin 1": (VERTICAL, dict(end=4.0, margin=1.0, **TO)),
}


def row(name, **more):
    case, options = ROWS[name]
    options = {**options, **more}
    if options.get("scaling") == -1.0:
        margin = Governor(BentPath(case.way, case.duration), case, margin=1.0).plan()
        options["scaling"] = uniform(margin)
    if options.pop("probing", False):
        options["estimator"] = Friction.UNKNOWN
    return run(case, **options)


def uniform(G):
    """Return the largest constant sdot whose load is within the margin of the backward pass."""
    p, F = G.points, float(G.config.path_margin * G.config.margin * G.state.estimate.F_hat)
    load = p["xx"] * 1.0
    x = 1.0
    for xx, xc, cc in zip(load, p["xc"], p["cc"], strict=True):
        if xx > 0:
            x = min(x, (math.sqrt(max(xc * xc - xx * (cc - F * F), 0.0)) - xc) / xx)
    return math.sqrt(x)


def table(rows=None):
    """Yield the lines of the table, as `python -m pytest test/unit/reference -k table -s` prints them."""
    for name in rows or ROWS:
        q = row(name)
        yield (
            f"{name:36s} slip {q.slip_mm:8.4f} mm  peak {q.peak_mm_s:7.3f} mm/s  arrive {q.arrive:6.3f}  "
            f"overshoot {q.overshoot_mm:7.3f} mm  load/limit {q.worst:5.3f}  F^ {q.F_hat:6.4f} ({q.events})"
            f"{'  overrun' if q.overrun else ''}"
        )
