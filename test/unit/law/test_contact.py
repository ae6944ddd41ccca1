"""Grasp kinematics with slip: against finite differences of a moving object and pad, power identity, rank."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slip_core.records import POSE, dtype_of, new, record
from slip_vic_controller.law import contact as law
from slip_vic_controller.law.contact import Contact
from test.referees.law_referee import Phi1, S, exponential, grasp_matrix_parts, jacobian_series, slip_acceleration, two
from test.support.call import call, flat
from test.support.law_cases import random_case

CONTACT = dtype_of(Contact)
ROUNDING = 1e-12
POWER = 1e-10  # a difference of two sums of products up to 1e3, so 1e3 rounding steps
FIRST_DIFFERENCE = 1e-7  # central differences with step 1e-5
SECOND_DIFFERENCE = 1e-6  # the same of velocities with derivatives up to 30
INTEGRATION = 1e-4  # first-order reference integration with 2e4 steps of a unit path

threes = st.tuples(*[st.floats(-10.0, 10.0)] * 3).map(np.array)
sixes = st.tuples(*[st.floats(-10.0, 10.0)] * 6).map(np.array)


def slip_of(position: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    buffer = new(POSE)
    record(buffer, POSE).position[:], record(buffer, POSE).rotation[:] = position, rotation
    return buffer


def contact_of(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the buffer of a random contact, o_x_p and o_R_p."""
    buffer = new(CONTACT)
    contact = record(buffer, CONTACT)
    contact.position[:], contact.rotation[:] = rng.normal(size=3), exponential(rng.normal(size=3))
    return buffer, np.array(contact.position), np.array(contact.rotation)


def arm_in_world(
    R_o: np.ndarray, o_R_p: np.ndarray, contact: np.ndarray, s_l: np.ndarray, R_s: np.ndarray
) -> np.ndarray:
    """Return r {w}, by way of the axes of the pad as the law does."""
    o_R_c = o_R_p @ R_s
    return (
        R_o @ o_R_c @ flat(call(law.contact_arm, o_R_c, record(contact, CONTACT).position, contact, slip_of(s_l, R_s)))
    )


def grasp(r: np.ndarray, x: np.ndarray, w_o: np.ndarray) -> list[np.ndarray]:
    """Return G x, G^T x, G^-T x, Phi2(w_o, r)."""
    products = [flat(call(product, r, x)) for product in (law.G, law.G_T, law.G_T_inverse)]
    return [*products, flat(call(law.Phi2, w_o, r))]


def integrate_slip(slip: np.ndarray, v_s: np.ndarray, dt: float) -> np.ndarray:
    out = new(POSE)
    call(law.integrate_slip, slip, v_s, dt, out)
    return out


def grasp_matrix(r: np.ndarray) -> np.ndarray:
    return np.block([[np.eye(3), np.zeros((3, 3))], [S(r), np.eye(3)]])


@given(threes, sixes, sixes)
@settings(max_examples=50)
def test_power_at_the_contact_equals_power_at_the_object(r, v_o, h) -> None:
    """(G h) . v_o = h . (G^T v_o): the grasp matrix neither makes nor loses energy."""
    at_object = grasp(r, h, r)[0] @ v_o
    assert at_object == pytest.approx(h @ grasp(r, v_o, r)[1], rel=POWER, abs=POWER)


@given(threes, sixes)
@settings(max_examples=50)
def test_products_equal_the_matrices(r, x) -> None:
    G, (forward, transposed, _, _) = grasp_matrix(r), grasp(r, x, r)
    np.testing.assert_allclose(forward, G @ x, atol=ROUNDING * 100)
    np.testing.assert_allclose(transposed, G.T @ x, atol=ROUNDING * 100)
    np.testing.assert_allclose(grasp(r, transposed, r)[2], x, atol=ROUNDING * 100)


def test_two_point_contacts_have_rank_five() -> None:
    """Forces at two points cannot turn the object about the line through them."""
    r1, r2 = np.random.default_rng(5).normal(size=(2, 3))
    forces = np.hstack([np.array([grasp(r, unit, r)[0] for unit in np.eye(6)[:3]]).T for r in (r1, r2)])
    assert np.linalg.matrix_rank(forces) == 5
    line = r1 - r2
    np.testing.assert_allclose(np.concatenate((np.cross(r1, line), line)) @ forces, 0.0, atol=ROUNDING)


def test_constant_and_slip_part_of_the_grasp_matrix_add_up() -> None:
    for seed in range(3):
        rng = np.random.default_rng(seed)
        contact, x_p, R_p = contact_of(rng)
        R_o, s_l, R_s = exponential(rng.normal(size=3)), rng.normal(size=3), exponential(rng.normal(size=3))
        r = arm_in_world(R_o, R_p, contact, s_l, R_s)
        constant, variant = grasp_matrix_parts(R_o, x_p, R_p, s_l)
        np.testing.assert_allclose(constant + variant, grasp_matrix(r), atol=ROUNDING)
        assert (grasp_matrix_parts(R_o, x_p, R_p, np.zeros(3))[1] == 0.0).all()


def test_slip_kinematics_by_finite_differences() -> None:
    """Velocity and acceleration of the pad on a moving object, with G^T, Phi1', Phi2 as in Eq. (14), (17), (19)."""
    for seed in range(4):
        check_slip_kinematics(np.random.default_rng(seed), 1e-5)


def check_slip_kinematics(rng: np.random.Generator, h: float) -> None:
    contact, x_p, o_R_p = contact_of(rng)
    x0, x1, x2, p0, p1, p2, s0, s1, s2, a0, a1, a2 = rng.normal(scale=0.7, size=(12, 3))

    def angular(phi0: np.ndarray, phi1: np.ndarray, phi2: np.ndarray, t: float) -> tuple[np.ndarray, ...]:
        phi, phi_dot = phi0 + phi1 * t + phi2 * t * t, phi1 + 2 * phi2 * t
        J, J_dot = jacobian_series(phi, phi_dot)
        return exponential(phi), J @ phi_dot, J @ (2 * phi2) + J_dot @ phi_dot

    def pose(t: float) -> tuple[np.ndarray, np.ndarray]:
        """Return position and attitude of the pad from Eq. (11), by composition of poses alone."""
        R_o = angular(p0, p1, p2, t)[0]
        R_p = R_o @ o_R_p
        x_c = x0 + x1 * t + x2 * t * t + R_o @ x_p + R_p @ (s0 + s1 * t + s2 * t * t)
        return x_c, R_p @ angular(a0, a1, a2, t)[0]

    def velocity(t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return v_c from the package, and R_p, r, w_o, v_s (all {w})."""
        R_o, w_o, _ = angular(p0, p1, p2, t)
        R_p = R_o @ o_R_p
        r = arm_in_world(R_o, o_R_p, contact, s0 + s1 * t + s2 * t * t, angular(a0, a1, a2, t)[0])
        v_s = two(R_p) @ np.concatenate((s1 + 2 * s2 * t, angular(a0, a1, a2, t)[1]))
        v_o = np.concatenate((x1 + 2 * x2 * t, w_o))
        return grasp(r, v_o, w_o)[1] + v_s, R_p, r, w_o, v_s

    v_c, R_p, r, w_o, v_s = velocity(0.0)
    (x_m, R_m), (x_p_, R_plus) = pose(-h), pose(h)
    np.testing.assert_allclose(v_c[:3], (x_p_ - x_m) / (2 * h), atol=FIRST_DIFFERENCE)
    np.testing.assert_allclose(S(v_c[3:]), (R_plus - R_m) / (2 * h) @ pose(0.0)[1].T, atol=FIRST_DIFFERENCE)

    a_c = (velocity(h)[0] - velocity(-h)[0]) / (2 * h)
    a_o = np.concatenate((2 * x2, angular(p0, p1, p2, 0.0)[2]))
    a_s_pad = np.concatenate((2 * s2, angular(a0, a1, a2, 0.0)[2]))
    _, follow, _, Phi2 = grasp(r, a_o, w_o)
    np.testing.assert_allclose(
        slip_acceleration(a_c, follow, w_o, v_s, Phi2), two(R_p) @ a_s_pad, atol=SECOND_DIFFERENCE
    )


@given(threes, sixes)
@settings(max_examples=50)
def test_Phi1_does_no_work_on_slip(w_o, x) -> None:
    """The paper's Lemma 1: x' Phi1' x = 0."""
    assert x @ Phi1(w_o) @ x == pytest.approx(0.0, abs=1e-9)


def test_slip_displacement_of_a_constant_twist_is_exact() -> None:
    """One large step equals many small first-order ones, and two halves equal the whole."""
    for seed in range(2):
        rng = np.random.default_rng(seed)
        start, twist = slip_of(rng.normal(size=3), exponential(rng.normal(size=3))), rng.normal(size=6)
        whole = record(integrate_slip(start, twist, 1.0), POSE)
        half = record(integrate_slip(integrate_slip(start, twist, 0.5), twist, 0.5), POSE)
        np.testing.assert_allclose(half.position, whole.position, atol=ROUNDING)
        np.testing.assert_allclose(half.rotation, whole.rotation, atol=ROUNDING)
        position, rotation = record(start, POSE).position.copy(), record(start, POSE).rotation.copy()
        steps = 20_000
        small = np.eye(3) + S(twist[3:]) / steps + S(twist[3:]) @ S(twist[3:]) / (2 * steps**2)
        for _ in range(steps):
            position += rotation @ twist[:3] / steps
            rotation = rotation @ small
        np.testing.assert_allclose(whole.position, position, atol=INTEGRATION)
        np.testing.assert_allclose(whole.rotation, rotation, atol=INTEGRATION)


def test_every_contact_slips_along_its_own_axes() -> None:
    case = random_case(5, contacts=3, slip=1.0)
    before = [slip_of(case.slips[i].position, case.slips[i].rotation) for i in range(3)]
    case.move_slips(0.01)
    for i in range(3):
        axes, twist = case.config.contact[i].slip_axes, case.samples[i].slip_twist
        expected = record(integrate_slip(before[i], np.array(axes * twist), 0.01), POSE)
        assert (case.slips[i].position == expected.position).all()
        assert (case.slips[i].rotation == expected.rotation).all()
    assert (case.slips[3].rotation == 0.0).all()
