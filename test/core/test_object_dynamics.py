"""Rigid-body dynamics of the object against matrices, momentum and free fall."""

from __future__ import annotations

import numpy as np
import pytest

from slip_vic_controller.core import object_dynamics as dynamics
from slip_vic_controller.core.object_dynamics import ObjectModel

from .law_referee import exponential

ROUNDING = 1e-12
MOMENTUM = 1e-7  # midpoint integration with 1 ms over 0.3 s: second order
GRAVITY = np.array([0.3, -0.2, -9.7])
INERTIA = np.array([[0.004, 0.0005, -0.0003], [0.0005, 0.006, 0.0002], [-0.0003, 0.0002, 0.005]])
MODEL = ObjectModel(0.7, INERTIA, GRAVITY)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_acceleration_solves_the_equation_of_motion(seed: int) -> None:
    rng = np.random.default_rng(seed)
    R_o, v_o, h_o = exponential(rng.normal(size=3)), rng.normal(size=6), rng.normal(size=6)
    a_o = dynamics.object_acceleration(MODEL, R_o, v_o[3:], h_o)
    left = dynamics.B_o(MODEL, R_o) @ a_o + dynamics.C_o(MODEL, R_o, v_o[3:]) @ v_o + dynamics.g_o(MODEL)
    np.testing.assert_allclose(left, -h_o, atol=ROUNDING)


def test_free_object_falls_with_gravity() -> None:
    a_o = dynamics.object_acceleration(MODEL, np.eye(3), np.zeros(3), np.zeros(6))
    np.testing.assert_allclose(a_o, [*GRAVITY, 0.0, 0.0, 0.0], atol=ROUNDING)


def test_wrench_that_carries_the_weight_keeps_it_at_rest() -> None:
    """h_o is the object's wrench on the robot: a held object pulls the robot down with m g."""
    h_o = np.concatenate((MODEL.mass * GRAVITY, np.zeros(3)))
    np.testing.assert_allclose(dynamics.object_acceleration(MODEL, np.eye(3), np.zeros(3), h_o), 0.0, atol=ROUNDING)


def test_free_rotation_keeps_angular_momentum_and_energy() -> None:
    R, w, dt = np.eye(3), np.array([1.0, 4.0, -2.0]), 1e-3

    def quantities(R: np.ndarray, w: np.ndarray) -> np.ndarray:
        L = R @ INERTIA @ R.T @ w
        return np.array([*L, 0.5 * w @ L])

    before = quantities(R, w)
    for _ in range(300):
        w_mid = w + 0.5 * dt * dynamics.object_acceleration(MODEL, R, w, np.zeros(6))[3:]
        R_mid = exponential(0.5 * dt * w) @ R
        w = w + dt * dynamics.object_acceleration(MODEL, R_mid, w_mid, np.zeros(6))[3:]
        R = exponential(dt * w_mid) @ R
    np.testing.assert_allclose(quantities(R, w), before, atol=MOMENTUM)


@pytest.mark.parametrize("seed", [1, 2])
def test_P_maps_contact_twist_to_coriolis_acceleration(seed: int) -> None:
    rng = np.random.default_rng(seed)
    R_o, v_o, r = exponential(rng.normal(size=3)), rng.normal(size=6), rng.normal(size=3)
    G = np.eye(6)
    G[3:, :3] = [[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]]
    B_o, C_o = dynamics.B_o(MODEL, R_o), dynamics.C_o(MODEL, R_o, v_o[3:])
    np.testing.assert_allclose(
        dynamics.P(MODEL, R_o, v_o[3:], r) @ (G.T @ v_o), G.T @ np.linalg.inv(B_o) @ C_o @ v_o, atol=1e-10
    )
