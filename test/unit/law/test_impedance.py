"""Gains that fade, slip activation, bounded spin, slip axes, Lyapunov functions."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slip_core.records import new, record
from slip_vic_controller.law.gains import GAINS
from slip_vic_controller.law.impedance import V_e, V_s, faded, limit_spin, slip_activation
from test.referees.law_referee import V_e_dot, V_s_dot
from test.support.call import call, flat
from test.support.law_cases import random_case

ROUNDING = 1e-12
FIRST_DIFFERENCE = 1e-6  # central differences with step 1e-6


def gains(**values: object) -> np.ndarray:
    buffer = new(GAINS)
    for name, value in {"characteristic_length": 1.0, **values}.items():
        if np.ndim(value):
            record(buffer, GAINS)[name][:] = value
        else:
            setattr(record(buffer, GAINS), name, value)
    return buffer


def test_gains_are_full_without_slip_and_fade_per_axis() -> None:
    full, gamma = np.array([5.0, 5.0, 5.0, 4.5, 4.5, 4.5]), np.array([100.0] * 3 + [50.0] * 3)
    assert (flat(call(faded, full, gamma, np.zeros(6))) == full).all()
    v_s = np.array([0.01, -0.01, 0.0, 0.0, 0.02, 0.0])
    expected = full * [math.exp(-1), math.exp(-1), 1.0, 1.0, math.exp(-1), 1.0]
    np.testing.assert_allclose(flat(call(faded, full, gamma, v_s)), expected, rtol=ROUNDING)


def test_slip_activation_is_zero_without_slip_and_takes_the_norm_of_all_six() -> None:
    steep = gains(alpha=100.0)
    assert call(slip_activation, steep, np.zeros(6)) == 0.0
    v_s = np.array([0.003, 0.0, 0.0, 0.0, 0.0, 0.004])
    assert call(slip_activation, steep, v_s) == pytest.approx(math.tanh(0.5), abs=ROUNDING)
    assert call(slip_activation, steep, np.full(6, 1e3)) == 1.0
    assert call(slip_activation, gains(alpha=0.0), np.ones(6)) == 0.0
    short = gains(alpha=100.0, characteristic_length=0.5)
    assert call(slip_activation, short, v_s) == pytest.approx(math.tanh(100.0 * math.hypot(3e-3, 2e-3)), abs=ROUNDING)


def test_spin_is_shortened_to_its_limit_and_no_more() -> None:
    motion = np.array([1.0, -2.0, 3.0, 0.0, 3.0, -4.0])
    assert (flat(call(limit_spin, 5.0, motion)) == motion).all()
    np.testing.assert_allclose(flat(call(limit_spin, 0.5, motion)), [1.0, -2.0, 3.0, 0.0, 0.3, -0.4], rtol=ROUNDING)
    assert (flat(call(limit_spin, 0.0, motion))[3:] == 0.0).all()


def test_compensation_acts_on_slip_axes_of_the_pad_only() -> None:
    axes = np.array([1, 1, 0, 0, 0, 1])
    for seed in range(3):
        every, some = (random_case(seed, slip_axes=one).evaluate() for one in (np.ones(6), axes))
        assert (some.comp[axes == 0] == 0.0).all()
        assert (every.comp != 0.0).all()
        assert (some.v_s == axes * every.v_s).all()


def test_V_e_changes_as_stated_along_the_loop() -> None:
    """M eddot = -D edot - K e + Lambda makes dV_e/dt = -edot' D edot + edot' Lambda."""
    for seed in range(3):
        rng, h = np.random.default_rng(seed), 1e-6
        e, e_dot, Lambda = rng.normal(size=(3, 6))
        M, D, K = rng.uniform(0.5, 3.0, (3, 6))
        e_ddot = (-D * e_dot - K * e + Lambda) / M
        given = gains(M_D=M, K_D=K)
        assert call(V_e, given, e, e_dot) == pytest.approx(0.5 * (e_dot @ (M * e_dot) + e @ (K * e)), rel=ROUNDING)
        ahead, behind = (call(V_e, given, e + s * h * e_dot, e_dot + s * h * e_ddot) for s in (1, -1))
        assert V_e_dot(D, e_dot, Lambda) == pytest.approx((ahead - behind) / (2 * h), abs=FIRST_DIFFERENCE)


def test_V_s_changes_as_stated_along_the_loop() -> None:
    """vdot_s = -k_s v_s - Phi1' v_s + Z makes dV_s/dt = -k_s v_s' v_s + v_s' Z."""
    for seed in range(3):
        rng, h = np.random.default_rng(seed), 1e-6
        v_s, Z = rng.normal(size=(2, 6))
        turn = rng.normal(size=(3, 3))
        Phi1 = np.kron(np.diag([2.0, 1.0]), turn - turn.T)
        rate = -3.0 * v_s - Phi1 @ v_s + Z
        numeric = (call(V_s, v_s + h * rate) - call(V_s, v_s - h * rate)) / (2 * h)
        assert V_s_dot(3.0, v_s, Z) == pytest.approx(numeric, abs=FIRST_DIFFERENCE)


def test_turning_alone_opens_the_gate_for_the_linear_compensation() -> None:
    """Prop. 1 asks for a Lambda_l that vanishes with v_sl, and a bounded one: the norm of all six gives neither."""
    case = random_case(2, slip=0.0, slip_axes=(1, 1, 1, 1, 1, 1))
    assert (case.evaluate().gated == 0.0).all()
    case.samples[0].slip_twist[5] = 1.0
    one = np.linalg.norm(case.evaluate().gated)
    assert np.linalg.norm(case.evaluate().gated[:3]) > 0.1
    case.samples[0].slip_twist[5] = 1e4  # and it is not bounded either
    assert np.linalg.norm(case.evaluate().gated) > 1e3 * one
