"""Torque map: forward dynamics, null space, singularities."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from slip_vic_controller.law.torque import given_axes, singularity_damping, smallest_singular_value
from slip_vic_controller.robot import Robot
from test.support.call import call
from test.support.law_cases import Case, random_case
from test.support.small_arm import HOME, JOINT_NAMES, small_arm_urdf

ROUNDING = 1e-9  # against explicit inverses, relative to torques of order 10
ALL = np.ones(6, np.int64)
NULL_ACCELERATION = 1e-10  # J B^-1 N^T tau_0 relative to accelerations of order 10


def at_state(seed: int, q: np.ndarray | None = None) -> Case:
    """Return a random case whose arm is the small arm, near home or at q and at rest."""
    case, rng = random_case(seed), np.random.default_rng(seed)
    case.q = np.array(HOME) + rng.normal(scale=0.2, size=7) if q is None else q
    case.qd = rng.normal(size=7) if q is None else np.zeros(7)
    Robot(small_arm_urdf(), "ee", JOINT_NAMES).terms(case.q, case.qd, case.buffers[2])
    return case


def parts_of(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Return task and null-space torque as published."""
    numbers = case.symbols()
    return tuple(np.array([numbers[f"tau_{name}_{j + 1}"] for j in range(7)]) for name in ("task", "null"))


def test_torque_gives_the_commanded_acceleration() -> None:
    """Forward dynamics of the arm with the torque and the contact wrench: J qdd + Jdot qd = a_C."""
    for seed in range(5):
        case = at_state(seed)
        found, arm = case.evaluate(), case.arm
        assert found.ok
        assert found.damping_squared == 0.0
        M, J, bias, tau = arm.M[:7, :7], arm.J[:, :7], arm.bias[:7], found.tau[:7]
        qdd = np.linalg.inv(M) @ (tau + J.T @ found.h_ee - bias)
        scale = np.abs(found.a_C).max()
        np.testing.assert_allclose(J @ qdd + arm.jdot_qd, found.a_C, atol=ROUNDING * scale)
        task, null = parts_of(case)
        np.testing.assert_allclose(task + null + bias, tau, atol=ROUNDING * np.abs(tau).max())


@pytest.mark.parametrize("seed", range(3))
def test_six_joints_give_the_printed_form(seed: int) -> None:
    """J^+ for J^-1: u = C_x v + g_x - h + B_x a_C with B_x = J^+T B J^+; seven joints leave the null space out."""
    for joints in (6, 7):
        case = random_case(seed, joints=joints)
        case.config.nullspace_stiffness = case.config.nullspace_damping = 0.0
        found, arm, n = case.evaluate(), case.arm, joints
        J, inverse = arm.J[:, :n], np.linalg.pinv(arm.J[:, :n])
        B_x = inverse.T @ arm.M[:n, :n] @ inverse
        u = inverse.T @ arm.bias[:n] - found.h_ee + B_x @ (found.a_C - arm.jdot_qd)
        difference = np.abs(J.T @ u - found.tau[:n]).max() / np.abs(found.tau[:n]).max()
        assert difference < 1e-8 if joints == 6 else difference > 0.01


def test_posture_rate_acts_along_the_null_space() -> None:
    """M^-1 N^T tau_0 = -(r/2)^2 Z Z^T (q - q_0) of an arm at rest, Z the null space of J by its SVD."""
    for seed in range(5):
        case, rate = at_state(seed), 10.0
        case.qd = np.zeros(7)
        case.config.nullspace_rate = rate
        found, arm = case.evaluate(), case.arm
        M, J = np.array(arm.M[:7, :7]), np.array(arm.J[:, :7])
        _, null = parts_of(case)
        Z = np.linalg.svd(J)[2][6:].T
        wanted = -0.25 * rate * rate * Z @ Z.T @ (case.q - case.posture)
        np.testing.assert_allclose(np.linalg.solve(M, null), wanted, atol=1e-5 * np.abs(wanted).max())
        assert found.ok


def test_null_space_torque_does_not_move_the_pad() -> None:
    for seed in range(5):
        case = at_state(seed)
        case.evaluate()
        _, null = parts_of(case)
        assert np.abs(null).max() > 0.01
        M_inverse = np.linalg.inv(case.arm.M[:7, :7])
        acceleration = case.arm.J[:, :7] @ M_inverse @ null
        assert np.abs(acceleration).max() < NULL_ACCELERATION * np.abs(M_inverse).max() * np.abs(null).max()


def test_few_joints_give_the_axes_that_they_have() -> None:
    """On the given axes the pad accelerates as commanded; the rank is that of J, and the others follow."""
    for joints, seed in itertools.product((4, 5), range(3)):
        case = random_case(seed, joints=joints)
        case.config.nullspace_stiffness = case.config.nullspace_damping = case.config.sigma_min = 0.0
        n, J = joints, np.array(case.arm.J[:, :joints])
        given = ALL.copy()
        call(given_axes, J, 1e-6, given)
        assert given.tolist() == [1] * n + [0] * (6 - n)
        case.config.sigma_min = 1e-6
        found, arm = case.evaluate(), case.arm
        qdd = np.linalg.solve(arm.M[:n, :n], found.tau[:n] + J.T @ found.h_ee - arm.bias[:n])
        np.testing.assert_allclose((J @ qdd + arm.jdot_qd)[:n], found.a_C[:n], rtol=1e-6, atol=1e-6)
        sigma = np.linalg.svd(J[:n])[1][-1]
        assert call(smallest_singular_value, J, given, np.inf) == pytest.approx(sigma, rel=1e-6)
        assert found.ok


def test_an_axis_that_others_determine_is_not_given() -> None:
    """A hand that a first joint turns as it carries it round: about x, then about z, is what nothing else gives."""
    J = np.random.default_rng(2).normal(size=(6, 5))
    J[3] = J[0] - 2.0 * J[1] + 1e-3 * J[5]
    given = ALL.copy()
    call(given_axes, J, 0.04, given)
    assert given.tolist() == [1, 1, 1, 0, 1, 1]


def test_smallest_singular_value_equals_svd() -> None:
    for seed in range(5):
        J = np.random.default_rng(seed).normal(size=(6, 7))
        sigma = np.linalg.svd(J)[1][-1]
        assert call(smallest_singular_value, J, ALL, np.inf) == pytest.approx(sigma, rel=1e-9)
        assert call(smallest_singular_value, J, ALL, 1.1 * sigma) == pytest.approx(sigma, rel=1e-9)
        assert call(smallest_singular_value, J, ALL, 0.5 * sigma) == 0.5 * sigma
        u, values, v = np.linalg.svd(J, full_matrices=False)
        values[-1] = 1e-6
        # the root of a difference near zero: 1e-16 of J J^T is 1e-8 of sigma
        assert call(smallest_singular_value, (u * values) @ v, ALL, 0.1) == pytest.approx(1e-6, abs=1e-7)


def test_damping_is_zero_above_and_grows_smoothly_below() -> None:
    def damping(sigma: float) -> float:
        return call(singularity_damping, sigma, 0.04, 0.1)

    assert damping(0.04) == 0.0
    assert damping(0.0399999) < 1e-12
    assert damping(0.0) == pytest.approx(0.01)
    assert (np.diff([damping(s) for s in np.linspace(0.05, 0.0, 100)]) >= 0.0).all()


def test_singular_posture_gives_bounded_torque() -> None:
    """A stretched arm cannot move along itself; the torque stays of the order of what was asked for."""
    case = at_state(1, np.zeros(7))
    case.config.sigma_min, case.config.most_damping = 0.04, 0.1
    found = case.evaluate()
    assert found.ok
    assert case.symbols()["sigma_min"] < 0.04
    assert found.damping_squared > 0.0
    assert found.near_singular_arm
    asked = np.abs(found.a_C - case.arm.jdot_qd).max() + np.abs(found.h_ee).max() + 10.0
    assert np.abs(found.tau[:7] - case.arm.bias[:7]).max() < 500.0 * asked
