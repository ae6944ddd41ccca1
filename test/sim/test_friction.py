"""The friction solver against identities that hold for every input, and against a slow referee."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from slip_core import sym3_kernel as sym3
from slip_core.errors import InputError
from slip_sim_bridge.sim.friction import NO_STATE, Coulomb, Stribeck, solve_contact, substeps_needed

ROUNDING = 1e-9  # relative; conditioning of the drawn A up to 1e4 times double rounding, with room
REFEREE = 1e-9  # relative; the referee's root is bracketed to 1e-14
UNDERFLOW = 1e-150
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
        return Coulomb(mu_k)
    return Stribeck(mu_k + draw(finite(0.0, 0.5)), mu_k, draw(finite(5e-3, 0.2)), draw(finite(0.0, 1.0)))


velocities = st.tuples(finite(-0.5, 0.5), finite(-0.5, 0.5), finite(-5.0, 5.0)).map(np.array)
loads = finite(0.01, 50.0)
radii = finite(3e-3, 0.1)


def scaled(vector, rho):
    return vector * np.array([1.0, 1.0, rho])


def solved(law, v_free, A, normal_force, rho):
    return solve_contact(v_free, A, normal_force, 1e-3, law, NO_STATE, rho)


@EXAMPLES
@given(laws(), velocities, compliances(), loads, radii)
def test_the_force_explains_the_velocity(law, v_free, A, normal_force, rho):
    out = solved(law, v_free, A, normal_force, rho)
    gap = scaled(out.velocity - (v_free + A @ out.force), rho)
    assert np.abs(gap).max() <= ROUNDING * max(np.linalg.norm(scaled(v_free, rho)), 1e-12)


@EXAMPLES
@given(laws(), velocities, compliances(), loads, radii)
def test_the_force_is_on_the_limit_surface_in_slip_and_inside_in_stick(law, v_free, A, normal_force, rho):
    out = solved(law, v_free, A, normal_force, rho)
    size = np.linalg.norm(out.force / np.array([1.0, 1.0, rho]))
    limit, _ = law.limit(float(np.linalg.norm(scaled(out.velocity, rho))), normal_force)
    if out.stick:
        assert size <= limit * (1.0 + ROUNDING)
        assert (out.velocity == 0.0).all(), "stick is exact"
    else:
        assert size == pytest.approx(limit, rel=ROUNDING)


@EXAMPLES
@given(laws(), velocities, compliances(), loads, radii)
def test_stick_exactly_where_the_static_limit_holds_the_load(law, v_free, A, normal_force, rho):
    holding = np.linalg.norm(np.linalg.solve(A, v_free) / np.array([1.0, 1.0, rho]))
    ratio = holding / law.limit(0.0, normal_force)[0]
    if abs(ratio - 1.0) > ROUNDING:
        assert solved(law, v_free, A, normal_force, rho).stick == (ratio < 1.0)


@EXAMPLES
@given(laws(), velocities, compliances(), loads, radii, st.integers(0, 2**32 - 1))
def test_no_admissible_force_dissipates_more(law, v_free, A, normal_force, rho, seed):
    out = solved(law, v_free, A, normal_force, rho)
    speed = float(np.linalg.norm(scaled(out.velocity, rho)))
    limit, _ = law.limit(speed, normal_force)
    power = float(out.force @ out.velocity)
    assert power == pytest.approx(-limit * speed, rel=ROUNDING, abs=1e-15)
    directions = np.random.default_rng(seed).normal(size=(200, 3))
    others = limit * directions / np.linalg.norm(directions, axis=1)[:, None] * np.array([1.0, 1.0, rho])
    assert (others @ out.velocity).min() >= power - ROUNDING * (1.0 + abs(power))


@EXAMPLES
@given(laws(), velocities, compliances(), loads, radii)
def test_friction_never_adds_kinetic_energy(law, v_free, A, normal_force, rho):
    out = solved(law, v_free, A, normal_force, rho)
    before, after = (float(v @ np.linalg.solve(A, v)) for v in (v_free, out.velocity))
    assert after <= before * (1.0 + ROUNDING)


@EXAMPLES
@given(laws(), velocities, compliances(), loads, radii, finite(-np.pi, np.pi))
def test_the_choice_of_pad_axes_does_not_matter(law, v_free, A, normal_force, rho, angle):
    R = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    rotated = solved(law, R @ v_free, R @ A @ R.T, normal_force, rho)
    straight = solved(law, v_free, A, normal_force, rho)
    if substeps_needed(A, normal_force, law, rho, margin=0.9) > 1 or rotated.stick != straight.stick:
        return  # several roots, or a load within rounding of the limit
    size = np.linalg.norm(straight.force / np.array([1.0, 1.0, rho]))
    # Squares of forces below UNDERFLOW are zero, and so is their norm.
    assert np.abs((rotated.force - R @ straight.force) / np.array([1.0, 1.0, rho])).max() <= 1e-7 * size + UNDERFLOW


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


@pytest.mark.parametrize("seed", range(12))
def test_against_a_slow_referee_that_finds_every_root(seed):
    rng = np.random.default_rng(seed)
    law = Stribeck(0.5, 0.4, 0.05, 0.05)
    x, y = rng.uniform(-0.05, 0.05, 2)
    G = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-y, x, 1.0]])
    A = 1e-3 * G.T @ np.diag([2.0, 2.0, 500.0]) @ G
    normal_force, rho = 10.0 ** rng.uniform(-1, 1), 0.03
    v_free = rng.normal(size=3) * np.array([0.3, 0.3, 3.0])
    out = solved(law, v_free, A, normal_force, rho)
    roots = slow_roots(law, v_free, A, normal_force, rho, count=800)
    assert not out.stick
    assert len(roots) == 1
    assert np.linalg.norm(scaled(out.velocity, rho)) == pytest.approx(roots[0], rel=REFEREE)


def test_sub_steps_restore_a_unique_root_where_a_whole_step_has_several():
    law = Stribeck(0.6, 0.3, 0.005)
    A, normal_force, rho = 1e-3 * np.diag([20.0, 20.0, 2e4]), 10.0, 0.03  # a 50 g object in a firm, slippery grip
    v_free = np.array([0.04, 0.0, 0.0])
    pieces = substeps_needed(A, normal_force, law, rho)
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
    assert substeps_needed(A, 100.0, Coulomb(0.5), 0.03) == 1
    assert substeps_needed(A, 100.0, Stribeck(0.4, 0.4, 0.01), 0.03) == 1
    assert substeps_needed(A, 0.0, Stribeck(0.6, 0.3, 0.005), 0.03) == 1
    assert substeps_needed(A, 1e6, Stribeck(0.6, 0.3, 0.005), 0.03, most=32) == 32


@pytest.mark.parametrize("speed", [0.001, 0.02, 0.0353, 0.05, 0.2])
def test_stribeck_slope_against_differences(speed):
    law, h, tolerance = Stribeck(0.5, 0.4, 0.05, 0.05), 1e-6, 1e-6  # central difference error h^2 F''' / 6
    slope = (law.limit(speed + h, 2.0)[0] - law.limit(speed - h, 2.0)[0]) / (2 * h)
    assert law.limit(speed, 2.0)[1] == pytest.approx(slope, abs=tolerance)


def test_the_steepest_fall_is_the_minimum_of_the_slope():
    law = Stribeck(0.5, 0.4, 0.05, 0.05)
    slopes = [law.limit(s, 2.0)[1] for s in np.linspace(0.0, 0.3, 30_001)]
    assert law.steepest_fall(2.0) == pytest.approx(-min(slopes), rel=1e-7)  # the grid misses the extremum by 5e-6 m/s


@pytest.mark.parametrize("normal_force", [0.0, -1.0])
def test_no_pressure_no_friction(normal_force):
    v = np.array([0.1, -0.2, 3.0])
    out = solved(Stribeck(0.5, 0.4, 0.05, 0.05), v, 1e-3 * np.eye(3), normal_force, 0.03)
    assert (out.force == 0.0).all()
    assert (out.velocity == v).all()
    assert not out.stick


def test_nothing_moves_nothing_pushes():
    out = solved(Stribeck(0.5, 0.4, 0.05), np.zeros(3), 1e-3 * np.eye(3), 1.0, 0.03)
    assert out.stick
    assert (out.force == 0.0).all()
    assert not out.force.flags.writeable
    assert not out.velocity.flags.writeable


@pytest.mark.parametrize(
    "make",
    [
        lambda: Coulomb(-0.1),
        lambda: Coulomb(float("nan")),
        lambda: Stribeck(0.3, 0.4, 0.05),
        lambda: Stribeck(0.5, 0.4, 0.0),
        lambda: Stribeck(0.5, 0.4, 0.05, -1.0),
    ],
)
def test_impossible_laws_are_refused(make):
    with pytest.raises(InputError, match="friction"):
        make()


@pytest.mark.parametrize("seed", range(5))
def test_closed_forms_against_numpy(seed):
    rng = np.random.default_rng(seed)
    for _ in range(200):
        B = rng.normal(size=(3, 3)) * 10.0 ** rng.uniform(-2, 2, size=3)[:, None]
        A = B @ B.T + 1e-3 * np.eye(3)
        b = rng.normal(size=3)
        upper = sym3.scaled_upper(A, 1.0)
        largest = np.linalg.eigvalsh(A)[-1]
        assert sym3.largest_eigenvalue(upper) == pytest.approx(largest, rel=1e-12)
        np.testing.assert_allclose(sym3.multiply(upper, tuple(b)), A @ b, rtol=1e-12, atol=1e-12 * largest)
        residual = A @ np.array(sym3.solve(upper, tuple(b))) - b
        assert np.abs(residual).max() <= 100 * np.finfo(float).eps * np.linalg.cond(A)
    assert sym3.largest_eigenvalue((2.0, 0.0, 0.0, 2.0, 0.0, 2.0)) == 2.0
