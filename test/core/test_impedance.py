"""Gains that fade, gate, projection on slip axes, Lyapunov functions."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slip_vic_controller.core import impedance, lyapunov

from .law_referee import exponential

ROUNDING = 1e-12
FIRST_DIFFERENCE = 1e-6  # central differences with step 1e-6


def test_gains_are_full_without_slip_and_fade_per_axis() -> None:
    full, gamma = np.array([5.0, 5.0, 5.0, 4.5, 4.5, 4.5]), np.array([100.0] * 3 + [50.0] * 3)
    assert (impedance.fading_gain(full, gamma, np.zeros(6)) == full).all()
    v_s = np.array([0.01, -0.01, 0.0, 0.0, 0.02, 0.0])
    expected = full * [math.exp(-1), math.exp(-1), 1.0, 1.0, math.exp(-1), 1.0]
    np.testing.assert_allclose(impedance.fading_gain(full, gamma, v_s), expected, rtol=ROUNDING)


def test_gate_is_closed_without_slip_and_takes_the_norm_of_all_six() -> None:
    assert impedance.gate(100.0, np.zeros(6)) == 0.0
    v_s = np.array([0.003, 0.0, 0.0, 0.0, 0.0, 0.004])
    assert impedance.gate(100.0, v_s) == pytest.approx(math.tanh(0.5), abs=ROUNDING)
    assert impedance.gate(100.0, np.full(6, 1e3)) == 1.0
    assert impedance.gate(0.0, np.ones(6)) == 0.0


@pytest.mark.parametrize("seed", [1, 2])
def test_projection_keeps_slip_axes_of_the_pad_only(seed: int) -> None:
    rng = np.random.default_rng(seed)
    R, x = exponential(rng.normal(size=3)), rng.normal(size=6)
    np.testing.assert_allclose(impedance.project(R, np.ones(6), x), x, atol=ROUNDING)
    axes = np.array([1.0, 1.0, 0.0, 0.0, 0.0, 1.0])
    once = impedance.project(R, axes, x)
    np.testing.assert_allclose(impedance.project(R, axes, once), once, atol=ROUNDING)
    on_pad = np.concatenate((R.T @ once[:3], R.T @ once[3:]))
    np.testing.assert_allclose(on_pad, axes * np.concatenate((R.T @ x[:3], R.T @ x[3:])), atol=ROUNDING)


@pytest.mark.parametrize("seed", [1, 2])
def test_V_e_changes_as_stated_along_the_loop(seed: int) -> None:
    """M eddot = -D edot - K e + Lambda makes dV_e/dt = -edot' D edot + edot' Lambda."""
    rng, h = np.random.default_rng(seed), 1e-6
    e, e_dot, Lambda = rng.normal(size=(3, 6))
    M, D, K = rng.uniform(0.5, 3.0, (3, 6))
    e_ddot = (-D * e_dot - K * e + Lambda) / M
    ahead, behind = (lyapunov.V_e(M, K, e + s * h * e_dot, e_dot + s * h * e_ddot) for s in (1, -1))
    assert lyapunov.V_e_dot(D, e_dot, Lambda) == pytest.approx((ahead - behind) / (2 * h), abs=FIRST_DIFFERENCE)


@pytest.mark.parametrize("seed", [1, 2])
def test_V_s_changes_as_stated_along_the_loop(seed: int) -> None:
    """vdot_s = -k_s v_s - Phi1' v_s + Z makes dV_s/dt = -k_s v_s' v_s + v_s' Z."""
    rng, h = np.random.default_rng(seed), 1e-6
    v_s, Z = rng.normal(size=(2, 6))
    turn = rng.normal(size=(3, 3))
    Phi1 = np.kron(np.diag([2.0, 1.0]), turn - turn.T)
    rate = -3.0 * v_s - Phi1 @ v_s + Z
    numeric = (lyapunov.V_s(v_s + h * rate) - lyapunov.V_s(v_s - h * rate)) / (2 * h)
    assert lyapunov.V_s_dot(3.0, v_s, Z) == pytest.approx(numeric, abs=FIRST_DIFFERENCE)
