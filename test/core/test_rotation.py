"""Rotation maths against matrix exponential, logarithm and power series."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slip_vic_controller.core import rotation

from .law_referee import S, exponential, jacobian_series, logarithm

ROUNDING = 1e-12  # closed forms of order one against a converged series: a few hundred rounding steps
SMALL_ANGLE = 1e-11  # just above the series' border the closed form loses 1e-16 / theta^2 / 60 by cancellation
FINITE_DIFFERENCE = 1e-7  # central differences with step 1e-5: h^2 and rounding / h

angles = st.floats(0.0, 4.5)
axes = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1)
rates = st.tuples(*[st.floats(-2.0, 2.0)] * 3)


def vector(angle: float, axis: tuple[float, ...]) -> np.ndarray:
    return angle * np.array(axis) / np.linalg.norm(axis)


@given(angles, axes)
@settings(max_examples=40, deadline=None)
def test_exponential_equals_matrix_exponential(angle: float, axis: tuple[float, ...]) -> None:
    phi = vector(angle, axis)
    np.testing.assert_allclose(rotation.exp_so3(phi), exponential(phi), atol=ROUNDING)


@given(angles, axes, rates)
@settings(max_examples=40, deadline=None)
def test_jacobian_and_its_rate_equal_their_series(angle: float, axis: tuple[float, ...], rate) -> None:
    phi, phi_dot = vector(angle, axis), np.array(rate)
    J, J_dot = jacobian_series(phi, phi_dot)
    np.testing.assert_allclose(rotation.left_jacobian(phi), J, atol=SMALL_ANGLE)
    np.testing.assert_allclose(rotation.left_jacobian_product(phi, phi_dot), J @ phi_dot, atol=SMALL_ANGLE)
    np.testing.assert_allclose(rotation.left_jacobian_inverse(phi) @ J, np.eye(3), atol=SMALL_ANGLE)
    np.testing.assert_allclose(rotation.left_jacobian_rate(phi, phi_dot), J_dot @ phi_dot, atol=SMALL_ANGLE)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-8, 1e-4, 0.0999999, 0.1000001, 1.0, 3.0, np.pi - 1e-3, np.pi - 1e-8])
def test_logarithm_undoes_exponential_at_all_sizes(angle: float) -> None:
    phi = angle * np.array([0.6, -0.64, 0.48])
    np.testing.assert_allclose(rotation.log_so3(rotation.exp_so3(phi)), phi, atol=1e-8 * angle * 1e-4 + ROUNDING)


@given(st.floats(0.0, 3.1), axes)
@settings(max_examples=40, deadline=None)
def test_logarithm_equals_matrix_logarithm(angle: float, axis: tuple[float, ...]) -> None:
    R = exponential(vector(angle, axis))
    np.testing.assert_allclose(rotation.log_so3(R), logarithm(R), atol=1e-9)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, -2, 3)])
def test_logarithm_of_a_half_turn_is_a_half_turn_about_the_axis(axis: tuple[float, ...]) -> None:
    phi = vector(np.pi, axis)
    R = 2.0 * np.outer(phi, phi) / np.pi**2 - np.eye(3)
    got = rotation.log_so3(R)
    assert np.linalg.norm(got) == pytest.approx(np.pi, abs=ROUNDING)
    assert abs(got @ phi) == pytest.approx(np.pi**2, abs=1e-7)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_jacobian_maps_rate_to_angular_velocity_by_finite_differences(seed: int) -> None:
    rng, h = np.random.default_rng(seed), 1e-5
    a, b, c = rng.normal(size=(3, 3))

    def phi(t: float) -> np.ndarray:
        return a + b * t + c * t * t

    R_dot = (exponential(phi(h)) - exponential(phi(-h))) / (2.0 * h)
    np.testing.assert_allclose(S(rotation.left_jacobian(a) @ b), R_dot @ exponential(a).T, atol=FINITE_DIFFERENCE)
    J_dot = (rotation.left_jacobian(phi(h)) - rotation.left_jacobian(phi(-h))) / (2.0 * h)
    np.testing.assert_allclose(rotation.left_jacobian_rate(a, b), J_dot @ b, atol=FINITE_DIFFERENCE)


def test_cross_equals_numpy() -> None:
    a, b = np.random.default_rng(4).normal(size=(2, 3))
    np.testing.assert_allclose(rotation.cross(a, b), np.cross(a, b), atol=ROUNDING)
