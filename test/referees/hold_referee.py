"""HOLD in plain numpy: skew matrices and the joint-space inertia as a matrix."""

from __future__ import annotations

import math

import numpy as np

from slip_core.arrays import Array
from slip_vic_controller.safety.hold import EXCESS, LOAD_LEVER, SLOWEST
from test.referees.law_referee import S, two


def held_inertia(M: Array, J: Array, r: Array, mass: float, inertia: Array) -> Array:
    """Return M + J_o^T B_o J_o / 2; r = x_c - x_o {w}, inertia {w}."""
    J_v = J[:3] + S(r) @ J[3:]
    return M + 0.5 * (mass * J_v.T @ J_v + J[3:].T @ inertia @ J[3:])


def load_error(error: Array, model: Array, measured: Array, dt: float, memory_s: float, least: float) -> Array:
    most = max(float(np.linalg.norm(model[:3])), least)
    wanted = np.concatenate(
        (_shortened(measured[:3] - model[:3], most), _shortened(measured[3:] - model[3:], LOAD_LEVER * most))
    )
    share = math.exp(-dt / memory_s)
    return share * error + (1.0 - share) * wanted


def _shortened(v: Array, most: float) -> Array:
    return v * min(1.0, most / max(float(np.linalg.norm(v)), 1e-300))


def gains_for_delay(stiffness: float, damping: float, delay_s: float) -> tuple[float, float]:
    margin = 0.75 * delay_margin(stiffness, damping, EXCESS)
    s = 1.0 if delay_s <= margin else max(SLOWEST, margin / delay_s)
    return s**2 * stiffness, s * damping


def delay_margin(stiffness: float, damping: float, excess: float) -> float:
    """Return the phase margin of excess (d s + k) / s^2 over the crossover; that by bisection of |L(j w)| = 1."""
    low, high = 0.0, 1e6
    for _ in range(200):
        w = 0.5 * (low + high)
        low, high = (w, high) if abs(excess * (damping * 1j * w + stiffness)) > w * w else (low, w)
    phase = math.atan2(damping * low, stiffness)  # of d s + k; the two integrators take pi, which is where it swings
    return phase / low


def object_load(R: Array, r: Array, weight: Array) -> Array:
    """Return the wrench on the pad of a resting object {ee}."""
    return two(R.T) @ np.concatenate((weight, -np.cross(r, weight)))


def hold_torque(
    arm, pad: Array, q: Array, qd: Array, posture: Array, r_pad: Array, gains: tuple[float, float], mass: float,
    inertia: Array, weight: Array, error: Array, *, carries: bool,
) -> Array:  # fmt: skip
    """Return g + (M + J_o^T B_o J_o / 2) (k (q_0 - q) - d qd) - J^T h."""
    R, (k, d) = arm.rotation, gains
    R_o, r = R @ pad.T, R @ r_pad
    H = held_inertia(arm.M, arm.J, r, mass, R_o @ inertia @ R_o.T)
    torque = arm.gravity + H @ (k * (posture - q) - d * qd)
    return torque - carries * (arm.J.T @ two(R) @ (object_load(R, r, weight) + error))
