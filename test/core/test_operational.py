"""Torque map: against explicit inverses, null space, singularities."""

from __future__ import annotations

import numpy as np
import pytest

from slip_vic_controller.core import operational
from slip_vic_controller.core.arm import ArmModel
from slip_vic_controller.core.operational import SingularityPolicy, joint_torque

from .small_arm import HOME, JOINT_NAMES, small_arm_urdf

REFEREE = 1e-9  # against explicit inverses, relative to torques of order 10
NULL_ACCELERATION = 1e-10  # J B^-1 N^T tau_0 relative to accelerations of order 10
OFF = SingularityPolicy(1e-9, 0.1)


def at_state(rng: np.random.Generator):
    arm = ArmModel(small_arm_urdf(), "ee", JOINT_NAMES)
    return arm.terms(np.array(HOME) + rng.normal(scale=0.2, size=7), rng.normal(size=7))


@pytest.mark.parametrize("seed", range(5))
def test_torque_gives_the_commanded_acceleration(seed: int) -> None:
    """Forward dynamics of the arm with the torque and the contact wrench: J qdd + Jdot qd = a_C."""
    rng = np.random.default_rng(seed)
    arm = at_state(rng)
    a_C, h_ee, tau_0 = rng.normal(size=6), rng.normal(size=6), rng.normal(size=7)
    out = joint_torque(arm.M, arm.bias, arm.J, arm.jdot_qd, a_C, h_ee, tau_0, OFF)
    assert out.solved
    assert out.damping_squared == 0.0
    qdd = np.linalg.inv(arm.M) @ (out.torque + arm.J.T @ h_ee - arm.bias)
    np.testing.assert_allclose(arm.J @ qdd + arm.jdot_qd, a_C, atol=REFEREE)
    np.testing.assert_allclose(out.task + out.null + arm.bias, out.torque, atol=REFEREE)


@pytest.mark.parametrize("seed", range(5))
def test_null_space_torque_does_not_move_the_pad(seed: int) -> None:
    rng = np.random.default_rng(seed)
    arm = at_state(rng)
    tau_0 = rng.normal(size=7)
    null = joint_torque(arm.M, arm.bias, arm.J, arm.jdot_qd, np.zeros(6), np.zeros(6), tau_0, OFF).null
    assert np.abs(null).max() > 0.01
    acceleration = arm.J @ np.linalg.inv(arm.M) @ null
    assert np.abs(acceleration).max() < NULL_ACCELERATION * np.abs(np.linalg.inv(arm.M)).max()


@pytest.mark.parametrize("seed", range(3))
def test_smallest_singular_value_equals_svd(seed: int) -> None:
    J = np.random.default_rng(seed).normal(size=(6, 7))
    assert operational.smallest_singular_value(J) == pytest.approx(np.linalg.svd(J)[1][-1], rel=1e-9)


def test_damping_is_zero_above_and_grows_smoothly_below() -> None:
    policy = SingularityPolicy(0.04, 0.1)
    assert operational.singularity_damping(0.04, policy) == 0.0
    assert operational.singularity_damping(0.0399999, policy) < 1e-12
    assert operational.singularity_damping(0.0, policy) == pytest.approx(0.01)
    values = [operational.singularity_damping(s, policy) for s in np.linspace(0.05, 0.0, 100)]
    assert (np.diff(values) >= 0.0).all()


def test_singular_posture_gives_bounded_torque_and_says_so() -> None:
    """A stretched arm cannot move along itself; the torque stays of the order of what was asked for."""
    arm = ArmModel(small_arm_urdf(), "ee", JOINT_NAMES).terms(np.zeros(7), np.zeros(7))
    out = joint_torque(
        arm.M, arm.bias, arm.J, arm.jdot_qd, np.ones(6), np.zeros(6), np.ones(7), SingularityPolicy(0.04, 0.1)
    )
    assert out.solved
    assert out.sigma_min < 0.04
    assert out.damping_squared > 0.0
    assert np.abs(out.torque - arm.bias).max() < 500.0


def test_mass_matrix_that_is_not_positive_is_reported() -> None:
    out = joint_torque(-np.eye(7), np.zeros(7), np.eye(6, 7), np.zeros(6), np.ones(6), np.zeros(6), np.zeros(7), OFF)
    assert not out.solved
