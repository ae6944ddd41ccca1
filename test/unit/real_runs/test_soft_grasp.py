"""The hanging object in soft pads against closed forms, and against its differential equations solved by scipy."""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp

from slip_core.records import new, record
from slip_sim_bridge.friction import lugre
from tools.real_data.soft_grasp import COLUMNS, OBJECT, G, carry

LEVER, GYRATION, RHO = 0.1, 0.06, 0.006


def simulate(t, a, step=2e-4, **changed):
    """Return the motion of a grasp that holds well, but for what is changed."""
    given = {
        "lever": LEVER, "gyration": GYRATION, "tilt": 0.0, "thinning": 0.0, "release": 1.0, "mu_s": 1e3, "mu_k": 1e3,
        "stribeck": 0.01, "viscous": 0.0, "stiffness": 1e5, "damping": 0.0, "breakaway": 0.5, "rho": RHO,
    } | changed  # fmt: skip
    numbers, friction = new(OBJECT), new(lugre.LAYOUT)
    thing, law = record(numbers, OBJECT), record(friction, lugre.LAYOUT)
    for name in ("lever", "gyration", "tilt", "thinning", "release"):
        setattr(thing, name, given[name])
    law.curve.mu_s, law.curve.mu_k = given["mu_s"], given["mu_k"]
    law.curve.stribeck_velocity, law.curve.viscous = given["stribeck"], given["viscous"]
    law.stiffness, law.damping = given["stiffness"], given["damping"]
    law.breakaway_fraction, law.torsional_radius = given["breakaway"], given["rho"]
    motion = np.empty((t.size, COLUMNS))
    carry(numbers, friction, t, a, step, motion)
    return motion


def test_agrees_with_the_differential_equations():
    """The same equations written out anew, continuous in time, solved by an adaptive stiff integrator."""
    t = np.linspace(0.0, 1.5, 151)
    a = 0.7 * np.sin(4.0 * t)
    grip = {"mu_s": 1.3 * G, "mu_k": 1.2 * G, "viscous": 0.5, "stiffness": 4e4, "damping": 800.0, "breakaway": 0.7}
    tilt, vs = -0.02, 0.02

    def rate(time, y):
        rx, ry, vx, vy, w, _angle, _slid, *z = y
        z = np.array(z)
        u = np.array([vx + w * ry, vy - w * rx, w * RHO])
        speed, length = np.linalg.norm(u), np.linalg.norm(z)
        z_ss = (grip["mu_k"] + (grip["mu_s"] - grip["mu_k"]) * math.exp(-((speed / vs) ** 2))) / grip["stiffness"]
        x = length / z_ss
        share = 0.0 if x <= 0.7 else 1.0 if x >= 1.0 else 0.5 + 0.5 * math.sin(math.pi * (x - 0.85) / 0.3)
        zd = u - share * max(0.0, u @ z / max(length, 1e-12)) / z_ss * z
        f = -(grip["stiffness"] * z + grip["damping"] * zd + grip["viscous"] * u)
        turned = zd + w * np.array([-z[1], z[0], 0.0])
        acceleration = 0.7 * math.sin(4.0 * time)
        wd = (RHO * f[2] - rx * f[1] + ry * f[0]) / GYRATION**2
        return [vx, vy, f[0] - acceleration, f[1] - G, wd, w, -u[1], *turned]

    rx, ry = LEVER * math.sin(tilt), -LEVER * math.cos(tilt)
    start = [rx, ry, 0.0, 0.0, 0.0, 0.0, 0.0, *(-np.array([0.0, G, rx * G / RHO]) / grip["stiffness"])]
    exact = solve_ivp(rate, (0.0, 1.5), start, "LSODA", t_eval=t, rtol=1e-8, atol=1e-10, max_step=5e-3).y
    motion = simulate(t, a, step=5e-5, tilt=tilt, stribeck=vs, **grip)
    assert np.ptp(exact[5]) > math.radians(5.0)
    assert np.abs(motion[:, 0] - exact[5]).max() < 0.01 * np.ptp(exact[5])
    assert np.abs(motion[:, 3] - exact[6]).max() < 0.02 * np.ptp(exact[6])
