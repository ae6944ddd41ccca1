"""Elasto-plastic LuGre bristles: spring below break-away, Stribeck curve in steady sliding, no drift, no blow-up."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slip_sim_bridge.friction.lugre import flowing_share
from test.support.call import call
from test.unit.bridge.contact import lugre, stribeck
from test.unit.bridge.planar_block import PlanarBlock

CURVE = stribeck(0.5, 0.4, 0.05, 0.05)
# Stiff enough that a 0.5 kg block resonates far above 30 Hz and the bristles feel the load as it is.
STIFFNESS, DAMPING, ELASTIC = 1e6, 1e3, 0.95
LAW = lugre(STIFFNESS, DAMPING, ELASTIC)
NORMAL_FORCE = 3.0
LIMIT = 0.5 * NORMAL_FORCE
FULL_STRETCH = LIMIT / STIFFNESS
DRIFT_M = 1e-9  # 1e-6 mm in 2 s
STRIBECK = 0.01  # required
ROUNDING = 1e-9  # relative

DIRECTIONS = {"x": (1.0, 0.0, 0.0), "diagonal": (1.0, 1.0, 0.0), "x_and_spin": (1.0, 0.0, 1.0)}


def unit(axis, rho=0.03):
    d = np.array(DIRECTIONS[axis])
    return d / np.linalg.norm(d) * np.array([1.0, 1.0, rho])


def test_the_share_that_flows_grows_from_nothing_at_break_away_to_all_at_full_stretch():
    assert call(flowing_share, 0.9, 0.9) == pytest.approx(0.0, abs=1e-15)
    assert call(flowing_share, 0.9, 0.95) == pytest.approx(0.5)
    assert call(flowing_share, 0.9, 1.0 - 1e-9) == pytest.approx(1.0)
    assert call(flowing_share, 0.9, 1.0) == call(flowing_share, 0.9, 1.2) == 1.0


def ramped(t, level, seconds=0.5):
    return level * min(1.0, t / seconds)


@pytest.mark.parametrize("axis", DIRECTIONS)
def test_no_drift_at_90_percent_load_with_vibration(axis):
    """Load up to 70 %, +-20 % at 30 Hz for 2 s: whole periods apart, the pad is where it was."""
    block = PlanarBlock(LAW, normal_force=NORMAL_FORCE)
    rest = 800
    for k in range(rest + 2001):
        shaking = 0.2 * math.sin(2 * math.pi * 30.0 * (k - rest) * block.dt) if k >= rest else 0.0
        assert block.step((ramped(k * block.dt, 0.7) + shaking) * LIMIT * unit(axis)).stick
        if k == rest + 500:  # 15 whole periods: the start of the vibration has died out
            before = block.slip.copy()
    scaled = (block.slip - before) * np.array([1.0, 1.0, block.rho])
    assert np.abs(scaled).max() < DRIFT_M


@pytest.mark.parametrize("speed", [0.002, 0.02, 0.05, 0.1, 0.3])
def test_steady_sliding_follows_the_stribeck_curve(speed):
    block = PlanarBlock(LAW, mass=1e6, inertia=1e6, normal_force=NORMAL_FORCE)
    for _ in range(200):
        out = block.step(pad_velocity=-speed * unit("x_and_spin") / np.array([1.0, 1.0, block.rho**2]))
    force = np.linalg.norm(out.force / np.array([1.0, 1.0, block.rho]))
    exact = NORMAL_FORCE * (0.4 + 0.1 * math.exp(-((speed / 0.05) ** 2))) + 0.05 * speed
    assert force == pytest.approx(exact, rel=STRIBECK)


vectors = st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-5.0, 5.0)).map(np.array)
stretches = st.tuples(*[st.floats(-1.0, 1.0)] * 3)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(vectors, stretches, st.floats(0.01, 20.0), st.floats(1e-5, 1e-1), st.floats(1e3, 1e6), st.floats(0.0, 500.0))
def test_every_step_is_consistent_and_bounded(v_free, stretch, normal_force, dt, stiffness, damping):
    law, rho = lugre(stiffness, damping, 0.9), 0.03
    full = 0.5 * normal_force / stiffness
    z = tuple(full * c for c in stretch)
    A = dt * np.array([[2.0, 0.0, -0.5], [0.0, 2.2, 0.9], [-0.5, 0.9, 500.0]])
    out = law.contact(v_free, A, normal_force, dt, z, rho)
    S = np.array([1.0, 1.0, rho])

    gap = (out.velocity - (v_free + A @ out.force)) * S
    assert np.abs(gap).max() <= ROUNDING * (np.linalg.norm(v_free * S) + np.linalg.norm(A @ out.force * S) + 1e-12)
    turn = dt * out.velocity[2]
    unturned = np.array(out.state) - turn * np.array([-z[1], z[0], 0.0])
    assert np.linalg.norm(unturned) <= full * (1.0 + ROUNDING), "the bristles never stretch beyond the static limit"
    u, z_next = out.velocity * S, unturned
    start = np.array(z) * min(1.0, full / max(np.linalg.norm(z), 1e-300))
    plastic = u - (z_next - start) / dt
    assert plastic @ z_next >= -ROUNDING * (np.linalg.norm(u) + full / dt) * full, "flow only relaxes the bristle"
    if out.stick:
        np.testing.assert_allclose(plastic, 0.0, atol=ROUNDING * (np.linalg.norm(u) + full / dt))


def test_a_loosened_grip_lets_the_bristles_go():
    strained = (0.9 * FULL_STRETCH, 0.0, 0.0)
    out = LAW.contact(np.zeros(3), 1e-9 * np.eye(3), NORMAL_FORCE / 2, 1e-3, strained)
    assert np.linalg.norm(out.state) <= FULL_STRETCH / 2 * (1.0 + ROUNDING)


@pytest.mark.parametrize("law", [CURVE, LAW, stribeck(0.0, 0.0), lugre(1e6, 1e3, mu_s=0.0, mu_k=0.0, viscous=0.1)])
@pytest.mark.parametrize("v", [(0.1, 0.0, 2.0), (1e-200, 0.0, 0.0), (1e30, 0.0, 0.0), (math.nan, 0.0, 0.0)])
def test_no_input_raises_in_the_hot_path(law, v):
    """No friction at all, underflow, overflow, not a number: the answer is a solution, finite for finite input."""
    out = law.contact(np.array(v), 1e-3 * np.diag([2.0, 2.0, 500.0]), 1.0)
    assert np.isfinite(out.force).all() == np.isfinite(v).all()
