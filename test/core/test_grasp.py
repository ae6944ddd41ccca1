"""Grasp kinematics with slip: against finite differences of a moving object and pad, power identity, rank."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slip_vic_controller.core import grasp
from slip_vic_controller.core.grasp import Contact, SlipDisplacement
from slip_vic_controller.core.object_dynamics import slip_acceleration

from .law_referee import S, exponential, jacobian_series, two

ROUNDING = 1e-12
POWER = 1e-10  # a difference of two sums of products up to 1e3, so 1e3 rounding steps
FIRST_DIFFERENCE = 1e-7  # central differences with step 1e-5
SECOND_DIFFERENCE = 1e-6  # the same of velocities with derivatives up to 30
INTEGRATION = 1e-4  # first-order reference integration with 2e4 steps of a unit path

numbers = st.floats(-10.0, 10.0)
threes = st.tuples(*[numbers] * 3).map(np.array)
sixes = st.tuples(*[numbers] * 6).map(np.array)


def make_contact(rng: np.random.Generator) -> tuple[Contact, SlipDisplacement]:
    contact = Contact(rng.normal(size=3), exponential(rng.normal(size=3)), np.ones(6))
    return contact, SlipDisplacement(rng.normal(size=3), exponential(rng.normal(size=3)))


@given(threes, sixes, sixes)
@settings(max_examples=50, deadline=None)
def test_power_at_the_contact_equals_power_at_the_object(r, v_o, h) -> None:
    """(G h) . v_o = h . (G^T v_o): the grasp matrix neither makes nor loses energy."""
    at_object = grasp.wrench_to_object(r, h) @ v_o
    assert at_object == pytest.approx(h @ grasp.to_contact(r, v_o), rel=POWER, abs=POWER)


@given(threes, sixes)
@settings(max_examples=50, deadline=None)
def test_products_equal_the_matrices(r, x) -> None:
    G = grasp.grasp_matrix(r)
    np.testing.assert_allclose(grasp.to_contact(r, x), G.T @ x, atol=ROUNDING * 100)
    np.testing.assert_allclose(grasp.wrench_to_object(r, x), G @ x, atol=ROUNDING * 100)
    np.testing.assert_allclose(grasp.to_object(r, grasp.to_contact(r, x)), x, atol=ROUNDING * 100)


def test_two_point_contacts_have_rank_five() -> None:
    """Forces at two points cannot turn the object about the line through them."""
    r1, r2 = np.random.default_rng(5).normal(size=(2, 3))
    forces = np.hstack([grasp.grasp_matrix(r)[:, :3] for r in (r1, r2)])
    assert np.linalg.matrix_rank(forces) == 5
    line = r1 - r2
    np.testing.assert_allclose(np.concatenate((np.cross(r1, line), line)) @ forces, 0.0, atol=ROUNDING)


@pytest.mark.parametrize("seed", [1, 2])
def test_constant_and_slip_part_add_up(seed: int) -> None:
    rng = np.random.default_rng(seed)
    contact, s = make_contact(rng)
    R_o = exponential(rng.normal(size=3))
    constant, variant = grasp.grasp_matrix_parts(R_o, contact, s)
    np.testing.assert_allclose(
        constant + variant, grasp.grasp_matrix(grasp.contact_arm(R_o, contact, s)), atol=ROUNDING
    )
    unmoved = SlipDisplacement(np.zeros(3), s.rotation)
    assert (grasp.grasp_matrix_parts(R_o, contact, unmoved)[1] == 0.0).all()


@pytest.mark.parametrize("seed", [1, 2])
def test_attitudes_go_round(seed: int) -> None:
    rng = np.random.default_rng(seed)
    contact, s = make_contact(rng)
    R_ee = exponential(rng.normal(size=3))
    R_o = grasp.object_rotation(R_ee, contact, s)
    np.testing.assert_allclose(grasp.pad_rotation(R_o, contact, s), R_ee, atol=ROUNDING)


@pytest.mark.parametrize("seed", range(4))
def test_slip_kinematics_by_finite_differences(seed: int) -> None:
    """Velocity and acceleration of the pad on a moving object, with G^T, Phi1', Phi2 as in Eq. (14), (17), (19)."""
    rng, h = np.random.default_rng(seed), 1e-5
    contact, _ = make_contact(rng)
    x0, x1, x2, p0, p1, p2, s0, s1, s2, a0, a1, a2 = rng.normal(scale=0.7, size=(12, 3))

    def angular(phi0: np.ndarray, phi1: np.ndarray, phi2: np.ndarray, t: float) -> tuple[np.ndarray, ...]:
        phi, phi_dot = phi0 + phi1 * t + phi2 * t * t, phi1 + 2 * phi2 * t
        J, J_dot = jacobian_series(phi, phi_dot)
        return exponential(phi), J @ phi_dot, J @ (2 * phi2) + J_dot @ phi_dot

    def pose(t: float) -> tuple[np.ndarray, np.ndarray]:
        """Return position and attitude of the pad from Eq. (11), by composition of poses alone."""
        R_o = angular(p0, p1, p2, t)[0]
        R_p = R_o @ contact.rotation
        x_c = x0 + x1 * t + x2 * t * t + R_o @ contact.position + R_p @ (s0 + s1 * t + s2 * t * t)
        return x_c, R_p @ angular(a0, a1, a2, t)[0]

    def velocity(t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return v_c from the package, and R_p, r, w_o, v_s (all {w})."""
        R_o, w_o, _ = angular(p0, p1, p2, t)
        R_p = R_o @ contact.rotation
        s = SlipDisplacement(s0 + s1 * t + s2 * t * t, angular(a0, a1, a2, t)[0])
        r = grasp.contact_arm(R_o, contact, s)
        v_s = two(R_p) @ np.concatenate((s1 + 2 * s2 * t, angular(a0, a1, a2, t)[1]))
        v_o = np.concatenate((x1 + 2 * x2 * t, w_o))
        return grasp.to_contact(r, v_o) + v_s, R_p, r, w_o, v_s

    v_c, R_p, r, w_o, v_s = velocity(0.0)
    (x_m, R_m), (x_p, R_plus) = pose(-h), pose(h)
    np.testing.assert_allclose(v_c[:3], (x_p - x_m) / (2 * h), atol=FIRST_DIFFERENCE)
    np.testing.assert_allclose(S(v_c[3:]), (R_plus - R_m) / (2 * h) @ pose(0.0)[1].T, atol=FIRST_DIFFERENCE)

    a_c = (velocity(h)[0] - velocity(-h)[0]) / (2 * h)
    a_o = np.concatenate((2 * x2, angular(p0, p1, p2, 0.0)[2]))
    a_s_pad = np.concatenate((2 * s2, angular(a0, a1, a2, 0.0)[2]))
    a_s = slip_acceleration(a_c, grasp.to_contact(r, a_o), w_o, v_s, grasp.Phi2(w_o, r))
    np.testing.assert_allclose(a_s, two(R_p) @ a_s_pad, atol=SECOND_DIFFERENCE)


@given(threes, sixes)
@settings(max_examples=50, deadline=None)
def test_Phi1_does_no_work_on_slip(w_o, x) -> None:
    """The paper's Lemma 1: x' Phi1' x = 0."""
    assert x @ grasp.Phi1(w_o) @ x == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("seed", [1, 2])
def test_slip_displacement_of_a_constant_twist_is_exact(seed: int) -> None:
    """One large step equals many small first-order ones, and two halves equal the whole."""
    rng = np.random.default_rng(seed)
    _, s = make_contact(rng)
    twist = rng.normal(size=6)
    whole = grasp.integrate_slip(s, twist, 1.0)
    half = grasp.integrate_slip(grasp.integrate_slip(s, twist, 0.5), twist, 0.5)
    np.testing.assert_allclose(half.position, whole.position, atol=ROUNDING)
    np.testing.assert_allclose(half.rotation, whole.rotation, atol=ROUNDING)
    position, rotation, steps = s.position.copy(), s.rotation.copy(), 20_000
    small = np.eye(3) + S(twist[3:]) / steps + S(twist[3:]) @ S(twist[3:]) / (2 * steps**2)
    for _ in range(steps):
        position += rotation @ twist[:3] / steps
        rotation = rotation @ small
    np.testing.assert_allclose(whole.position, position, atol=INTEGRATION)
    np.testing.assert_allclose(whole.rotation, rotation, atol=INTEGRATION)


def test_slip_rotation_stays_a_rotation() -> None:
    """After 5,000 ticks of spin the matrix is orthonormal to rounding."""
    s = SlipDisplacement(np.zeros(3), np.eye(3))
    for _ in range(5_000):
        s = grasp.integrate_slip(s, np.array([0.0, 0.0, 0.0, 0.3, -0.7, 2.0]), 0.001)
    np.testing.assert_allclose(s.rotation @ s.rotation.T, np.eye(3), atol=1e-11)
