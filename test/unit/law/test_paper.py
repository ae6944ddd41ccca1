"""The printed equations: fading gains, slip activation, torque, Lyapunov functions."""

from __future__ import annotations

import math

import numpy as np
import pytest

import slip_vic
from slip_core.records import dtype_of, new, record
from slip_vic.scenarios.scenario import load
from slip_vic_controller.law.gains import Gains
from slip_vic_controller.law.paper import V_e, V_s, faded, slip_activation
from test.referees.law_referee import V_e_dot, V_s_dot
from test.support.call import call, flat
from test.support.law_cases import random_case

GAINS = dtype_of(Gains)

ROUNDING = 1e-12
FIRST_DIFFERENCE = 1e-6  # central differences with step 1e-6


def test_gains_fade_per_axis() -> None:
    full, gamma = np.array([5.0, 5.0, 5.0, 4.5, 4.5, 4.5]), np.array([100.0] * 3 + [50.0] * 3)
    assert (flat(call(faded, full, gamma, np.zeros(6))) == full).all()
    v_s = np.array([0.01, -0.01, 0.0, 0.0, 0.02, 0.0])
    expected = full * [math.exp(-1), math.exp(-1), 1.0, 1.0, math.exp(-1), 1.0]
    np.testing.assert_allclose(flat(call(faded, full, gamma, v_s)), expected, rtol=ROUNDING)


def test_slip_activation_saturates() -> None:
    assert call(slip_activation, 100.0, 0.0) == call(slip_activation, 0.0, 1.0) == 0.0
    assert call(slip_activation, 100.0, 0.005) == pytest.approx(math.tanh(0.5), abs=ROUNDING)
    assert call(slip_activation, 100.0, 1e3) == 1.0


def test_compensation_acts_on_slip_axes_only() -> None:
    axes = np.array([1, 1, 0, 0, 0, 1])
    every, some = (random_case(0, slip_axes=one).evaluate() for one in (np.ones(6), axes))
    assert (some.comp[axes == 0] == 0.0).all()
    assert (every.comp != 0.0).all()
    assert (some.v_s == axes * every.v_s).all()


@pytest.mark.parametrize("seed", range(3))
def test_V_e_changes_as_in_eq_26(seed: int) -> None:
    """M eddot = -D edot - K e + Lambda makes dV_e/dt = -edot' D edot + edot' Lambda."""
    rng, h, buffer = np.random.default_rng(seed), 1e-6, new(GAINS)
    e, e_dot, Lambda = rng.normal(size=(3, 6))
    M, D, K = rng.uniform(0.5, 3.0, (3, 6))
    e_ddot = (-D * e_dot - K * e + Lambda) / M
    record(buffer, GAINS).M_D[:], record(buffer, GAINS).K_D[:] = M, K
    assert call(V_e, buffer, e, e_dot) == pytest.approx(0.5 * (e_dot @ (M * e_dot) + e @ (K * e)), rel=ROUNDING)
    ahead, behind = (call(V_e, buffer, e + s * h * e_dot, e_dot + s * h * e_ddot) for s in (1, -1))
    assert V_e_dot(D, e_dot, Lambda) == pytest.approx((ahead - behind) / (2 * h), abs=FIRST_DIFFERENCE)


@pytest.mark.parametrize("seed", range(3))
def test_V_s_changes_as_in_eq_34(seed: int) -> None:
    """vdot_s = -k_s v_s - Phi1' v_s + Z makes dV_s/dt = -k_s v_s' v_s + v_s' Z."""
    rng, h = np.random.default_rng(seed), 1e-6
    v_s, Z = rng.normal(size=(2, 6))
    turn = rng.normal(size=(3, 3))
    rate = -3.0 * v_s - np.kron(np.diag([2.0, 1.0]), turn - turn.T) @ v_s + Z
    numeric = (call(V_s, v_s + h * rate) - call(V_s, v_s - h * rate)) / (2 * h)
    assert V_s_dot(3.0, v_s, Z) == pytest.approx(numeric, abs=FIRST_DIFFERENCE)


def test_turning_alone_opens_the_linear_gate() -> None:
    """Prop. 1 requires a bounded Lambda_l that vanishes with v_sl: the norm of all six gives neither."""
    case = random_case(2, slip=0.0, slip_axes=(1, 1, 1, 1, 1, 1))
    assert (case.evaluate().gated == 0.0).all()
    case.samples[0].slip_twist[5] = 1.0
    one = np.linalg.norm(case.evaluate().gated)
    assert np.linalg.norm(case.evaluate().gated[:3]) > 0.1
    case.samples[0].slip_twist[5] = 1e4
    assert np.linalg.norm(case.evaluate().gated) > 1e3 * one


@pytest.mark.parametrize(("sensor", "drive"), [("", ""), ("event_1000", "torque_joint")])
def test_the_printed_law_has_no_extensions(sensor: str, drive: str) -> None:
    params = load("glass_transport", law="printed", sensor=sensor, drive=drive, mode="realtime").controller
    assert (params.slip_estimator, params.gains.spin, params.controller) == ("measured", "follow", "printed")
    assert not params.bounded_authority
    assert params.governor.mode == "off"


def test_vic_is_the_printed_law_on_an_ideal_arm() -> None:
    short = ["bridge.duration_s=0.5"]
    printed, vic = (slip_vic.load("paper_planar", law=law, set=short).run() for law in ("printed", "vic"))
    assert printed.outcome == "ok"
    assert printed.slip_mm == vic.slip_mm > 0.1
