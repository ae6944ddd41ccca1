"""Robot terms by finite differences and energy; what a URDF must provide."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from slip_core.errors import InputError
from slip_core.records import new, record
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.robot import Robot
from slip_vic_controller.sizes import MAX_JOINTS
from test.referees.law_referee import S
from test.support.small_arm import HOME, JOINT_NAMES, small_arm_urdf

FIRST_DIFFERENCE = 1e-7  # central differences with step 1e-5
SECOND_DIFFERENCE = 1e-5  # second derivatives up to 1e3 and rounding 1e-16 / h
STEP = 1e-5
ROBOT = Robot(small_arm_urdf(), "ee", JOINT_NAMES, (0.5, -0.3, -9.7))


def terms(q: np.ndarray, qd: np.ndarray) -> Any:
    """Return the ARM record."""
    buffer = new(ARM)
    ROBOT.terms(q, qd, buffer)
    return record(buffer, ARM)


def states() -> list[tuple[np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(0)
    return [(np.array(HOME) + rng.normal(scale=0.5, size=7), rng.normal(size=7)) for _ in range(4)]


def test_jacobian_is_pose_derivative() -> None:
    for q, qd in states():
        now, before, after = (terms(q + s * STEP * qd, qd) for s in (0, -1, 1))
        v = (after.position - before.position) / (2 * STEP)
        np.testing.assert_allclose(now.J[:, :7] @ qd, now.twist, atol=FIRST_DIFFERENCE)
        np.testing.assert_allclose(now.twist[:3], v, atol=FIRST_DIFFERENCE)
        spin = (after.rotation - before.rotation) / (2 * STEP) @ now.rotation.T
        np.testing.assert_allclose(spin, S(now.twist[3:]), atol=FIRST_DIFFERENCE)


def test_jdot_is_jacobian_derivative() -> None:
    for q, qd in states():
        J_dot = (terms(q + STEP * qd, qd).J - terms(q - STEP * qd, qd).J) / (2 * STEP)
        np.testing.assert_allclose(terms(q, qd).jdot_qd, J_dot[:, :7] @ qd, atol=FIRST_DIFFERENCE)


def test_bias_and_mass_matrix_conserve_power() -> None:
    """d/dt (1/2 qd' M qd) = qd' (tau - g): with qdd = 0 that is 1/2 qd' Mdot qd = qd' (bias - g)."""
    for q, qd in states():
        now, M = terms(q, qd), terms(q, qd).M[:7, :7]
        M_dot = (terms(q + STEP * qd, qd).M - terms(q - STEP * qd, qd).M)[:7, :7] / (2 * STEP)
        power = qd @ (now.bias - now.gravity)[:7]
        assert 0.5 * qd @ M_dot @ qd == pytest.approx(power, abs=SECOND_DIFFERENCE)
        np.testing.assert_allclose(M, M.T, atol=1e-12)
        assert np.linalg.eigvalsh(M)[0] > 0.0
        np.testing.assert_allclose(terms(q, np.zeros(7)).bias[:7], ROBOT.gravity(q), atol=1e-12)
        assert (now.gravity[:7] == ROBOT.gravity(q)).all()


def test_gripper_joints_are_locked() -> None:
    robot = Robot(small_arm_urdf(extra_joint=True), "ee", JOINT_NAMES)
    assert robot.joint_names == JOINT_NAMES
    assert robot.gravity(np.array(HOME)).shape == (7,)


def test_limits_come_from_the_urdf() -> None:
    robot = Robot(small_arm_urdf(), "ee", JOINT_NAMES)
    assert robot.effort_limit.tolist() == [90.0] * 4 + [30.0] * 3
    assert (robot.velocity_limit == 2.5).all()
    assert (robot.position_upper == 2.9).all()
    assert (robot.position_lower == -2.9).all()


def long_urdf(joints: int) -> str:
    """Return a chain of that many joints."""
    links = [f'<link name="l{i}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
             "</inertial></link>" for i in range(joints + 1)]  # fmt: skip
    moving = [f'<joint name="j{i}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/>'
              '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>' for i in range(joints)]  # fmt: skip
    return f'<robot name="long">{"".join(links + moving)}</robot>'


def test_more_joints_than_fit_are_refused() -> None:
    names = [f"j{i:d}" for i in range(MAX_JOINTS)]
    assert Robot(long_urdf(MAX_JOINTS), f"l{MAX_JOINTS}", names).effort_limit.shape == (MAX_JOINTS,)
    with pytest.raises(InputError, match=f"at most {MAX_JOINTS}"):
        Robot(long_urdf(MAX_JOINTS + 1), f"l{MAX_JOINTS + 1}", [*names, f"j{MAX_JOINTS}"])


BAD: list[tuple[str, str, tuple[str, ...], list[str]]] = [
    (small_arm_urdf(), "ee", JOINT_NAMES[::-1], ["order", "arm_joint1"]),
    (small_arm_urdf(), "ee", JOINT_NAMES[:6], ["arm_joint7", "the URDF's chain"]),
    (small_arm_urdf(), "ee", (*JOINT_NAMES[:6], "arm_joint6"), ["arm_joint7"]),
    (small_arm_urdf(), "ee", (), ["joint_names"]),
    (small_arm_urdf(effort=0.0), "ee", JOINT_NAMES, ["arm_joint1", "effort"]),
]


def test_bad_urdf_gives_one_line() -> None:
    for urdf, frame, names, words in BAD:
        with pytest.raises(InputError) as caught:
            Robot(urdf, frame, names)
        line = str(caught.value)
        assert "\n" not in line
        for word in words:
            assert word in line


def test_gravity_follows_the_parameter() -> None:
    q = np.array(HOME)
    down, up = (Robot(small_arm_urdf(), "ee", JOINT_NAMES, (0, 0, g)).gravity(q) for g in (-9.81, 9.81))
    np.testing.assert_allclose(down, -up, atol=1e-12)
    assert np.abs(down).max() > 1.0
