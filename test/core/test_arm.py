"""Arm terms by finite differences and energy; what a URDF must provide."""

from __future__ import annotations

import numpy as np
import pytest

from slip_core.errors import InputError
from slip_vic_controller.core.arm import ArmModel

from .law_referee import S
from .small_arm import HOME, JOINT_NAMES, small_arm_urdf

FIRST_DIFFERENCE = 1e-7  # central differences with step 1e-5
SECOND_DIFFERENCE = 1e-5  # second derivatives up to 1e3 and rounding 1e-16 / h
STEP = 1e-5


def state(seed: int) -> tuple[ArmModel, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    arm = ArmModel(small_arm_urdf(), "ee", JOINT_NAMES, (0.5, -0.3, -9.7))
    return arm, np.array(HOME) + rng.normal(scale=0.5, size=7), rng.normal(size=7)


@pytest.mark.parametrize("seed", range(4))
def test_jacobian_is_the_derivative_of_the_pose(seed: int) -> None:
    arm, q, qd = state(seed)
    now, before, after = (arm.terms(q + s * STEP * qd, qd) for s in (0, -1, 1))
    np.testing.assert_allclose(now.J @ qd, now.twist, atol=FIRST_DIFFERENCE)
    np.testing.assert_allclose(now.twist[:3], (after.position - before.position) / (2 * STEP), atol=FIRST_DIFFERENCE)
    spin = (after.rotation - before.rotation) / (2 * STEP) @ now.rotation.T
    np.testing.assert_allclose(spin, S(now.twist[3:]), atol=FIRST_DIFFERENCE)


@pytest.mark.parametrize("seed", range(4))
def test_jdot_qd_is_the_derivative_of_the_jacobian(seed: int) -> None:
    arm, q, qd = state(seed)
    J_dot = (arm.terms(q + STEP * qd, qd).J - arm.terms(q - STEP * qd, qd).J) / (2 * STEP)
    np.testing.assert_allclose(arm.terms(q, qd).jdot_qd, J_dot @ qd, atol=FIRST_DIFFERENCE)


@pytest.mark.parametrize("seed", range(4))
def test_bias_and_mass_matrix_conserve_power(seed: int) -> None:
    """d/dt (1/2 qd' M qd) = qd' (tau - g): with qdd = 0 that is 1/2 qd' Mdot qd = qd' (bias - g)."""
    arm, q, qd = state(seed)
    terms = arm.terms(q, qd)
    M_dot = (arm.terms(q + STEP * qd, qd).M - arm.terms(q - STEP * qd, qd).M) / (2 * STEP)
    assert 0.5 * qd @ M_dot @ qd == pytest.approx(qd @ (terms.bias - arm.gravity(q)), abs=SECOND_DIFFERENCE)
    np.testing.assert_allclose(terms.M, terms.M.T, atol=1e-12)
    assert np.linalg.eigvalsh(terms.M)[0] > 0.0
    np.testing.assert_allclose(arm.terms(q, np.zeros(7)).bias, arm.gravity(q), atol=1e-12)


def test_gravity_follows_the_parameter() -> None:
    q = np.array(HOME)
    down, up = (ArmModel(small_arm_urdf(), "ee", JOINT_NAMES, (0, 0, g)).gravity(q) for g in (-9.81, 9.81))
    np.testing.assert_allclose(down, -up, atol=1e-12)
    assert np.abs(down).max() > 1.0


def test_results_are_not_overwritten_by_the_next_call() -> None:
    arm, q, qd = state(1)
    first = arm.terms(q, qd)
    copy = first.record.copy()
    arm.terms(q + 0.5, -qd)
    assert (first.record == copy).all()


def test_gripper_joints_that_do_not_move_the_pad_are_locked() -> None:
    arm = ArmModel(small_arm_urdf(extra_joint=True), "ee", JOINT_NAMES)
    assert arm.joint_names == JOINT_NAMES
    assert arm.terms(np.array(HOME), np.zeros(7)).M.shape == (7, 7)


def test_limits_come_from_the_urdf() -> None:
    arm = ArmModel(small_arm_urdf(), "ee", JOINT_NAMES)
    assert arm.effort_limit.tolist() == [90.0] * 4 + [30.0] * 3
    assert (arm.velocity_limit == 2.5).all()
    assert (arm.position_upper == 2.9).all()
    assert (arm.position_lower == -2.9).all()


@pytest.mark.parametrize(
    ("urdf", "frame", "names", "words"),
    [
        ("<robot", "ee", JOINT_NAMES, ["robot_description"]),
        ("", "ee", JOINT_NAMES, ["robot_description"]),
        (small_arm_urdf(), "eee", JOINT_NAMES, ["ee_frame", "did you mean ee"]),
        (small_arm_urdf(), "ee", (*JOINT_NAMES[:6], "arm_joint9"), ["arm_joint9", "did you mean"]),
        (small_arm_urdf(), "ee", JOINT_NAMES[::-1], ["order", "arm_joint1"]),
        (small_arm_urdf(), "ee", JOINT_NAMES[:6], ["arm_joint7", "moves ee"]),
        (small_arm_urdf(), "ee", (*JOINT_NAMES[:6], "arm_joint6"), ["twice"]),
        (small_arm_urdf(), "ee", (), ["joint_names"]),
        (small_arm_urdf(continuous=True), "ee", JOINT_NAMES, ["revolute"]),
        (small_arm_urdf(effort=0.0), "ee", JOINT_NAMES, ["effort"]),
    ],
)
def test_bad_urdf_or_names_give_one_clear_line(urdf: str, frame: str, names: tuple[str, ...], words: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        ArmModel(urdf, frame, names)
    line = str(caught.value)
    assert "\n" not in line
    for word in words:
        assert word in line
