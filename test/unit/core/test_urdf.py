"""URDFs as they are distributed: both nodes read the same arm from them, and what is missing is named."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from slip_core.errors import InputError
from slip_core.files.urdf import NESTED, chain, moving, parse_urdf, usable_urdf
from slip_core.records import new, record
from slip_sim_bridge.params import BridgeParams
from slip_sim_bridge.plant.rigid import build_model
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.robot import Robot
from test.support.odd_arm import JOINTS, odd_arm_urdf, with_joint, with_link

ROUNDING = 1e-12
URDF = odd_arm_urdf()


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
    "no range": (with_joint(URDF, "joint_4", 'lower="-2.9" upper="2.9"', 'lower="0" upper="0"'), ["joint_4", "0..0"]),
    "not a number": (with_joint(URDF, "joint_4", 'lower="-2.9"', 'lower="low"'), ["joint_4", "low"]),
    "floating": (with_joint(URDF, "joint_1", 'type="revolute"', 'type="floating"'), ["joint_1", "floating"]),
    "no mass": (with_link(URDF, "link_3", "<inertial>.*</inertial>", ""), ["joint_3", "link_3", "mass"]),
    "no body": (with_link(URDF, "link_2", 'izz="0.01"', 'izz="0.05"'), ["link_2", "inertia"]),
    "negative mass": (with_link(URDF, "link_2", 'mass value="2"', 'mass value="-2"'), ["link_2", "mass"]),
    "no parent": (with_joint(URDF, "joint_2", "<parent[^>]*>", ""), ["joint_2", "parent"]),
    "a name twice": (URDF.replace("joint_2", "joint_3"), ["joint_3", "twice"]),
    "xacro": ('<robot xmlns:xacro="http://ros.org/wiki/xacro"><xacro:arg name="a"/></robot>', ["xacro"]),
    "a mass that is no number": (with_link(URDF, "link_2", 'mass value="2"', 'mass value="nan"'), ["link_2", "mass"]),
    "a mass for Python alone": (with_link(URDF, "link_2", 'mass value="2"', 'mass value="8_0"'), ["link_2", "8_0"]),
    "two numbers": (with_joint(URDF, "joint_2", 'xyz="[^"]*"', 'xyz="0 0"'), ["joint_2", "numbers, 3 of them"]),
    "an endless effort": (with_joint(URDF, "joint_3", 'effort="150"', 'effort="1e308"'), ["joint_3", "at most 10000"]),
    "no place": (with_joint(URDF, "joint_2", 'xyz="[^"]*"', 'xyz="0 abc 0"'), ["joint_2", "origin", "abc", "numbers"]),
    "an endless axis": (with_joint(URDF, "joint_2", '(<axis xyz=")[^"]*"', '\\g<1>0 0 1e300"'), ["joint_2", "1e300"]),
    "nested": (f"<robot>{'<link>' * 50}{'</link>' * 50}</robot>", ["nested more than 50 deep"]),
    "deeply nested": (f"<robot>{'<a>' * 100_000}{'</a>' * 100_000}</robot>", ["nested more than 50 deep"]),
    "a prefix without its namespace": ('<robot drake:a="1"/>', ["unbound prefix"]),
}


@pytest.mark.parametrize(("text", "words"), BAD.values(), ids=BAD.keys())
def test_bad_urdf_is_refused_in_one_line(text: str, words: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        usable_urdf(text, "tool0", JOINTS)
    line = str(caught.value)
    assert "\n" not in line
    assert len(line) < 1000
    assert all(word in line for word in words), line


def test_nesting_up_to_the_bound_is_read() -> None:
    parse_urdf(f'<robot><link name="a"/>{"<material>" * (NESTED - 1)}{"</material>" * (NESTED - 1)}</robot>')


@pytest.mark.parametrize(
    ("names", "frame", "word"),
    [
        (JOINTS[:5], "tool0", "from base to tip"), (JOINTS[::-1], "tool0", "from base to tip"),
        (JOINTS, "tool1", "did you mean tool0"), (("joint_7", *JOINTS), "tool0", "did you mean joint_"),
    ],
)  # fmt: skip
def test_both_nodes_refuse_wrong_names(names: tuple[str, ...], frame: str, word: str) -> None:
    params = BridgeParams(joint_names=names, ee_frame=frame, initial_position=(0.0,) * len(names))
    with pytest.raises(InputError, match=word) as of_controller:
        Robot(URDF, frame, names)
    with pytest.raises(InputError) as of_bridge:
        build_model(params, URDF)
    assert str(of_controller.value) == str(of_bridge.value)
