"""URDFs as they are distributed: both nodes read the same arm from them, and what is missing is named."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from slip_core.errors import InputError
from slip_core.files.urdf import chain, moving, parse_urdf, usable_urdf
from slip_core.records import new, record
from slip_description import urdf_text
from slip_sim_bridge.params import BridgeParams
from slip_sim_bridge.plant.rigid import build_model
from slip_vic_controller.arm.robot import Robot
from slip_vic_controller.law.arm import ARM
from test.support.odd_arm import JOINTS, odd_arm_urdf, with_joint, with_link

ROUNDING = 1e-12
URDF = odd_arm_urdf()
OWN = tuple(f"arm_joint{i}" for i in range(1, 8))


def test_the_suites_own_arm_is_read_as_it_is() -> None:
    assert usable_urdf(urdf_text(), "ee", OWN) == urdf_text()


def test_both_nodes_read_the_same_arm() -> None:
    """Pinocchio's and MuJoCo's inertia, gravity and pose agree, so both locked the same joints in the same places."""
    robot = Robot(URDF, "tool0", JOINTS)
    model = build_model(BridgeParams(joint_names=JOINTS, ee_frame="tool0", initial_position=(0.1,) * 6), URDF)
    data = mujoco.MjData(model)
    objects = model.body("grasp_object").id
    model.body_mass[objects] = 0.0
    model.body_inertia[objects] = 0.0
    q = np.array([0.3, -0.4, 0.7, 0.2, -1.1, 0.5])
    data.qpos[: len(q)] = q
    mujoco.mj_forward(model, data)
    buffer = new(ARM)
    robot.terms(q, np.zeros(6), buffer)
    arm = record(buffer, ARM)
    np.testing.assert_allclose(data.qfrc_bias[:6], arm.gravity[:6], atol=ROUNDING * 1e3)
    np.testing.assert_allclose(data.body("tool0").xpos, arm.position, atol=ROUNDING)
    np.testing.assert_allclose(data.body("tool0").xmat.reshape(3, 3), arm.rotation, atol=ROUNDING)


def test_only_the_wanted_joints_move_and_no_mesh_is_named() -> None:
    root = parse_urdf(usable_urdf(URDF, "tool0", JOINTS))
    assert moving(list(root.iter("joint"))) == list(JOINTS)
    assert not list(root.iter("mesh"))
    assert not list(root.iter("mimic"))
    assert {child.tag for child in root} == {"link", "joint"}


def test_a_chain_runs_from_base_to_tip() -> None:
    names = [joint.get("name") for joint in chain(parse_urdf(URDF), "left_finger")]
    assert names == ["mount", *JOINTS, "gripper", "left_finger_joint"]


def test_what_was_made_usable_stays_as_it_is() -> None:
    once = usable_urdf(URDF, "tool0", JOINTS)
    assert usable_urdf(once, "tool0", JOINTS) == once


BAD = {
    "no limit": (with_joint(URDF, "joint_2", "<limit[^>]*>", ""), ["joint joint_2", "<limit"]),
    "velocity 0": (with_joint(URDF, "joint_3", 'velocity="3"', 'velocity="0"'), ["joint_3", "velocity"]),
    "no effort": (with_joint(URDF, "joint_3", 'effort="150"', ""), ["joint_3", "effort"]),
    "no range": (with_joint(URDF, "joint_4", 'lower="-2.9" upper="2.9"', 'lower="0" upper="0"'), ["joint_4", "0..0"]),
    "not a number": (with_joint(URDF, "joint_4", 'lower="-2.9"', 'lower="low"'), ["joint_4", "low"]),
    "floating": (with_joint(URDF, "joint_1", 'type="revolute"', 'type="floating"'), ["joint_1", "floating"]),
    "no mass": (with_link(URDF, "link_3", "<inertial>.*</inertial>", ""), ["joint_3", "link_3", "mass"]),
    "no body": (with_link(URDF, "link_2", 'izz="0.01"', 'izz="0.05"'), ["link_2", "inertia"]),
    "negative mass": (with_link(URDF, "link_2", 'mass value="2"', 'mass value="-2"'), ["link_2", "mass"]),
    "no parent": (with_joint(URDF, "joint_2", "<parent[^>]*>", ""), ["joint_2", "parent"]),
    "a name twice": (URDF.replace("joint_2", "joint_3"), ["joint_3", "twice"]),
    "xacro": ('<robot xmlns:xacro="http://ros.org/wiki/xacro"><xacro:arg name="a"/></robot>', ["xacro"]),
    "a ring": (with_joint(URDF, "mount", 'parent link="world"', 'parent link="link_6"'), ["ring"]),
    "sdf": ("<sdf/>", ["<sdf>", "robot"]),
}


def test_what_is_missing_is_said_with_its_name() -> None:
    for case, (text, words) in BAD.items():
        with pytest.raises(InputError) as caught:
            usable_urdf(text, "tool0", JOINTS)
        line = str(caught.value)
        assert "\n" not in line, case
        assert all(word in line for word in words), (case, line)


def test_both_nodes_say_the_same_of_names_that_do_not_fit() -> None:
    for names, frame in ((JOINTS[:5], "tool0"), (JOINTS[::-1], "tool0"), (JOINTS, "tool1"), (("j", *JOINTS), "tool0")):
        params = BridgeParams(joint_names=names, ee_frame=frame, initial_position=(0.0,) * len(names))
        with pytest.raises(InputError) as of_controller:
            Robot(URDF, frame, names)
        with pytest.raises(InputError) as of_bridge:
            build_model(params, URDF)
        assert str(of_controller.value) == str(of_bridge.value)
