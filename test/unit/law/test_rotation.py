"""Rotation maths against matrix exponential, logarithm and power series."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slip_vic_controller.law import rotation
from test.referees.law_referee import exponential, jacobian_series
from test.support.call import call, flat

ROUNDING = 1e-12  # closed forms of order one against a converged series: a few hundred rounding steps
LAST_BITS = 2.5e-16  # of numbers below 1/2: rounding, and the first term that is left out
SMALL_ANGLE = 1e-11  # just above the series' border the closed form loses 1e-16 / theta^2 / 60 by cancellation

angles = st.floats(0.0, 4.5)
axes = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1)
rates = st.tuples(*[st.floats(-2.0, 2.0)] * 3)


def left_jacobians(phi: np.ndarray, rate: np.ndarray) -> list[np.ndarray]:
    """Return J_l rate, J_l^-1 rate, Jdot_l rate."""
    parts = (rotation.left_jacobian, rotation.left_jacobian_inverse, rotation.left_jacobian_rate)
    return [flat(call(part, phi, rate)) for part in parts]


def test_series_of_the_coefficients_are_exact() -> None:
    """Against Taylor's series of sine and cosine in fractions, and c = (1 - sin / (2 a theta)) / theta^2."""
    for small in (0.0, 1e-9, 1e-3, 5e-3, 0.99 * rotation.SERIES_BELOW):
        t, powers = Fraction(small), range(12)
        a = sum((-t) ** k / math.factorial(2 * k + 2) for k in powers)
        b = sum((-t) ** k / math.factorial(2 * k + 3) for k in powers)
        a_slope, b_slope = (  # f'(theta) / theta = 2 df/dt
            sum(-2 * k * (-t) ** (k - 1) / math.factorial(2 * k + more) for k in powers[1:]) for more in (2, 3)
        )
        exact = [float(value) for value in (a, b, a_slope, b_slope)]
        np.testing.assert_allclose(call(rotation.coefficients, small), exact, rtol=0.0, atol=LAST_BITS)
        if small > 0.0:
            c = (1 - (1 - t * b) / (2 * a)) / t
            assert call(rotation.inverse_coefficient, small) == pytest.approx(float(c), rel=0.0, abs=LAST_BITS)


def exponential_of(phi: np.ndarray) -> np.ndarray:
    return flat(call(rotation.exponential, phi))


def logarithm_of(R: np.ndarray) -> np.ndarray:
    return flat(call(rotation.logarithm, R))


def vector(angle: float, axis: tuple[float, ...]) -> np.ndarray:
    return angle * np.array(axis) / np.linalg.norm(axis)


@given(angles, axes)
@settings(max_examples=40)
def test_exponential_equals_matrix_exponential(angle: float, axis: tuple[float, ...]) -> None:
    phi = vector(angle, axis)
    np.testing.assert_allclose(exponential_of(phi), exponential(phi), atol=ROUNDING)


@given(angles, axes, rates)
@settings(max_examples=40)
def test_jacobian_and_its_rate_equal_their_series(angle: float, axis: tuple[float, ...], rate) -> None:
    phi, phi_dot = vector(angle, axis), np.array(rate)
    J, J_dot = jacobian_series(phi, phi_dot)
    forward, back, rate_of = left_jacobians(phi, phi_dot)
    np.testing.assert_allclose(forward, J @ phi_dot, atol=SMALL_ANGLE)
    np.testing.assert_allclose(J @ back, phi_dot, atol=SMALL_ANGLE)
    np.testing.assert_allclose(rate_of, J_dot @ phi_dot, atol=SMALL_ANGLE)


def test_logarithm_undoes_exponential_at_all_sizes() -> None:
    for angle in (0.0, 1e-12, 1e-8, 1e-4, 0.0999999, 0.1000001, 1.0, 3.0, np.pi - 1e-3, np.pi - 1e-8):
        phi = angle * np.array([0.6, -0.64, 0.48])
        np.testing.assert_allclose(logarithm_of(exponential_of(phi)), phi, atol=1e-12 * angle + ROUNDING)


def test_logarithm_of_a_half_turn() -> None:
    for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, -2, 3), (0, -1, 1), (-3, 1, 0)):
        phi = vector(np.pi, axis)
        got = logarithm_of(2.0 * np.outer(phi, phi) / np.pi**2 - np.eye(3))
        assert np.linalg.norm(got) == pytest.approx(np.pi, abs=ROUNDING)
        assert abs(got @ phi) == pytest.approx(np.pi**2, abs=1e-7)
