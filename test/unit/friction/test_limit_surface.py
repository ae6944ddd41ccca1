"""The friction solver against identities that hold for every input, and against a slow referee."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from slip_core.errors import InputError
from slip_core.params import build
from slip_sim_bridge.friction.limit_surface import MOST_SUBSTEPS
from slip_sim_bridge.friction.params import FrictionParams
from test.unit.bridge.contact import coulomb, stribeck

ROUNDING = 1e-9  # relative; conditioning of the drawn A up to 1e4 times double rounding, with room
EXAMPLES = settings(max_examples=150, deadline=None, derandomize=True)


def finite(low, high):
    return st.floats(low, high, allow_nan=False, allow_infinity=False)


@st.composite
def compliances(draw):
    """dt J M^-1 J^T of a free body seen at a point off its centre, plus compliance of whatever holds it."""
    mass, inertia, dt = draw(finite(0.05, 5.0)), draw(finite(1e-4, 1e-2)), draw(finite(1e-4, 2e-3))
    x, y = draw(finite(-0.1, 0.1)), draw(finite(-0.1, 0.1))
    G = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-y, x, 1.0]])
    return dt * G.T @ np.diag([1 / mass, 1 / mass, 1 / inertia]) @ G


@st.composite
def laws(draw):
    mu_k = draw(finite(0.05, 1.0))
    if draw(st.booleans()):
        return coulomb(mu_k)
    return stribeck(mu_k + draw(finite(0.0, 0.5)), mu_k, draw(finite(5e-3, 0.2)), draw(finite(0.0, 1.0)))


velocities = st.tuples(finite(-0.5, 0.5), finite(-0.5, 0.5), finite(-5.0, 5.0)).map(np.array)
loads = finite(0.01, 50.0)
radii = finite(3e-3, 0.1)


def scaled(vector, rho):
    return vector * np.array([1.0, 1.0, rho])


def solved(law, v_free, A, normal_force, rho):
    return law.contact(v_free, A, normal_force, rho=rho)


@EXAMPLES
@given(laws(), velocities, compliances(), loads, radii)
def test_the_force_explains_the_velocity_and_is_the_largest_against_it(law, v_free, A, normal_force, rho):
    """In stick inside the limit surface; in slip on it, where no force takes more power: f_hat = -F u / |u|."""
    out = solved(law, v_free, A, normal_force, rho)
    gap = scaled(out.velocity - (v_free + A @ out.force), rho)
    assert np.abs(gap).max() <= ROUNDING * max(np.linalg.norm(scaled(v_free, rho)), 1e-12)
    u, f_hat = scaled(out.velocity, rho), out.force / np.array([1.0, 1.0, rho])
    limit, _ = law.limit(float(np.linalg.norm(u)), normal_force)
    if out.stick:
        assert np.linalg.norm(f_hat) <= limit * (1.0 + ROUNDING)
        assert (out.velocity == 0.0).all(), "stick is exact"
    else:
        np.testing.assert_allclose(f_hat, -limit * u / np.linalg.norm(u), rtol=0.0, atol=ROUNDING * limit)


@EXAMPLES
@given(laws(), velocities, compliances(), loads, radii)
def test_stick_exactly_where_the_static_limit_holds_the_load(law, v_free, A, normal_force, rho):
    holding = np.linalg.norm(np.linalg.solve(A, v_free) / np.array([1.0, 1.0, rho]))
    ratio = holding / law.limit(0.0, normal_force)[0]
    if abs(ratio - 1.0) > ROUNDING:
        assert solved(law, v_free, A, normal_force, rho).stick == (ratio < 1.0)


def slow_roots(law, v_free, A, normal_force, rho, count=4000):
    """All speeds that solve the slip equation, by scanning and explicit inverses."""
    S = np.diag([1.0, 1.0, rho])
    u_free, A_hat = S @ v_free, S @ A @ S

    def residual(s):
        F, _ = law.limit(s, normal_force)
        return np.linalg.norm(np.linalg.inv(s * np.eye(3) + F * A_hat) @ u_free) - 1.0

    top = float(np.linalg.norm(u_free))
    grid = np.concatenate([np.geomspace(top * 1e-9, top * 1e-3, 60), np.linspace(top * 1e-3, top, count)])
    values = [residual(s) for s in grid]
    pairs = zip(itertools.pairwise(grid), itertools.pairwise(values), strict=True)
    return [brentq(residual, a, b, xtol=1e-16, rtol=1e-14) for (a, b), (ra, rb) in pairs if ra > 0.0 >= rb]


def test_sub_steps_restore_a_unique_root_where_a_whole_step_has_several():
    law = stribeck(0.6, 0.3, 0.005)
    A, normal_force, rho = 1e-3 * np.diag([20.0, 20.0, 2e4]), 10.0, 0.03  # a 50 g object in a firm, slippery grip
    v_free = np.array([0.04, 0.0, 0.0])
    pieces = law.substeps(A, normal_force, rho)
    assert pieces > 1
    fall, stiffness = law.steepest_fall(normal_force), max(20e-3, 20.0 * rho**2)
    assert fall * stiffness > 1.0, "the whole step breaks the uniqueness condition"
    assert fall * stiffness / pieces <= 0.5

    def solutions(v_free, A):
        holding = np.linalg.norm(np.linalg.solve(A, v_free) / np.array([1.0, 1.0, rho]))
        sticks = holding <= law.limit(0.0, normal_force)[0]
        return int(sticks) + len(slow_roots(law, v_free, A, normal_force, rho, count=400))

    scales = np.linspace(0.2, 4.0, 20)
    assert max(solutions(scale * v_free, A) for scale in scales) > 1
    assert {solutions(scale * v_free, A / pieces) for scale in scales} == {1}


def test_sub_steps_are_not_spent_where_the_curve_does_not_fall():
    A = 1e-3 * np.diag([20.0, 20.0, 2e4])
    assert coulomb(0.5).substeps(A, 100.0) == 1
    assert stribeck(0.4, 0.4, 0.01).substeps(A, 100.0) == 1
    assert stribeck(0.6, 0.3, 0.005).substeps(A, 0.0) == 1
    assert stribeck(0.6, 0.3, 0.005).substeps(A, 1e6) == MOST_SUBSTEPS
    assert stribeck(0.6, 0.3, 0.005).substeps(math.nan * A, 1.0) == MOST_SUBSTEPS


def test_stribeck_slope_against_differences():
    law, h, tolerance = stribeck(0.5, 0.4, 0.05, 0.05), 1e-6, 1e-6  # central difference error h^2 F''' / 6
    for speed in (0.001, 0.02, 0.0353, 0.05, 0.2):
        slope = (law.limit(speed + h, 2.0)[0] - law.limit(speed - h, 2.0)[0]) / (2 * h)
        assert law.limit(speed, 2.0)[1] == pytest.approx(slope, abs=tolerance)


def test_the_steepest_fall_is_the_minimum_of_the_slope():
    law = stribeck(0.5, 0.4, 0.05, 0.05)
    slopes = [law.limit(s, 2.0)[1] for s in np.linspace(0.0, 0.3, 30_001)]
    assert law.steepest_fall(2.0) == pytest.approx(-min(slopes), rel=1e-7)  # the grid misses the extremum by 5e-6 m/s


def test_nothing_moves_nothing_pushes():
    out = stribeck().contact(np.zeros(3), 1e-3 * np.eye(3), 1.0)
    assert out.stick
    assert (out.force == 0.0).all()


@pytest.mark.parametrize(
    ("values", "word"),
    [
        ({"mu_s": 0.3, "mu_k": 0.4}, "mu_s"),
        ({"stribeck_velocity": 0.0}, "stribeck_velocity"),
        ({"torsional_radius": 0.0}, "torsional_radius"),
        ({"lugre.stiffness": 0.0}, "lugre.stiffness"),
        ({"lugre.damping": -1.0}, "lugre.damping"),
        ({"lugre.breakaway_fraction": 1.0}, "lugre.breakaway_fraction"),
        ({"model": "glue"}, "stribeck"),
        *(({name: bad}, name) for name in ("mu_s", "mu_k", "viscous") for bad in (-0.1, math.nan, math.inf)),
    ],
)
def test_impossible_laws_are_refused(values, word):
    with pytest.raises(InputError, match=word):
        build(FrictionParams, values, "test")
