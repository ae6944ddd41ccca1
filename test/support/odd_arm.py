"""A six-joint arm as arms are distributed: written here, with every property that real files have, each on demand."""

from __future__ import annotations

import functools
import re

_BODY = (
    '<inertial><origin xyz="0 0 0.1"/><mass value="2"/>'
    '<inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>'
)
_MESH = '<visual><geometry><mesh filename="package://odd_description/meshes/part.dae"/></geometry></visual>'
# origin xyz, axis
_JOINTS = (
    ("0 0 0.2", "0 0 1"),
    ("0 0 0.1", "0 1 0"),
    ("0 0 0.4", "0 1 0"),
    ("0 0 0.4", "0 1 0"),
    ("0 0 0.1", "0 0 1"),
    ("0 0 0.1", "0 1 0"),
)
JOINTS = tuple(f"joint_{i}" for i in range(1, 7))


def odd_arm_urdf() -> str:
    """Return the arm: meshes that are not there, a joint named like a link, wheels, a torso, a gripper with a mimic.

    The hand `tool0` reaches along its x, which the last joint's axis is; sliding fingers close along its z.
    """
    parts = [
        '<?xml version="1.0" encoding="utf-8"?><robot name="odd"><link name="world"/>',
        '<joint name="mount" type="fixed"><parent link="world"/><child link="link_0"/></joint>',
        f'<link name="link_0">{_MESH}</link>',
        # What does not carry the hand may be as it likes.
        '<link name="wheel"><inertial><mass value="1"/><inertia ixx="0" iyy="-1" izz="0" ixy="0" ixz="0" iyz="0"/>'
        '</inertial></link><joint name="wheel_joint" type="continuous"><parent link="link_0"/><child link="wheel"/>'
        '<axis xyz="0 1 0"/><limit effort="6" velocity="10"/></joint>',
    ]
    for i, (xyz, axis) in enumerate(_JOINTS, start=1):
        kind = "continuous" if i == 5 else "revolute"
        ends = "" if i == 5 else 'lower="-2.9" upper="2.9" '
        parts.append(
            f'<link name="link_{i}">{_BODY}{_MESH}</link><joint name="joint_{i}" type="{kind}">'
            f'<parent link="link_{i - 1}"/><child link="link_{i}"/><origin xyz="{xyz}" rpy="0 0 0"/>'
            f'<axis xyz="{axis}"/><limit {ends}effort="150" velocity="3"/><dynamics damping="1"/></joint>'
        )
    parts.append(
        # The link `gripper` and the joint `gripper` are two things.
        f'<link name="gripper">{_BODY}</link><joint name="gripper" type="fixed"><parent link="link_6"/>'
        '<child link="gripper"/><origin xyz="0 0.05 0" rpy="0 0 1.5707963267948966"/></joint>'
        '<link name="tool0"><visual><geometry><box size="0.01 0.01 0.01"/></geometry></visual></link>'
        '<joint name="tool0_joint" type="fixed"><parent link="gripper"/><child link="tool0"/></joint>'
    )
    for side, sign in (("left", ""), ("right", "-")):
        follows = '<mimic joint="left_finger_joint" multiplier="1"/>' if side == "right" else ""
        parts.append(
            f'<link name="{side}_finger">{_BODY}</link><joint name="{side}_finger_joint" type="prismatic">'
            f'<parent link="gripper"/><child link="{side}_finger"/><origin xyz="0.1 0 0"/><axis xyz="0 0 {sign}1"/>'
            f'<limit lower="0.0" upper="0.04" effort="20" velocity="0.1"/>{follows}</joint>'
        )
    return "".join([*parts, '<transmission name="t"><type>x</type></transmission></robot>'])


def _changed(kind: str, text: str, name: str, pattern: str, instead: str) -> str:
    """Return a URDF in which something of one link or joint reads otherwise."""
    element = re.search(rf'<{kind} name="{name}".*?</{kind}>', text)
    assert element
    changed, count = re.subn(pattern, instead, element.group(0))
    assert count
    return text.replace(element.group(0), changed)


with_joint, with_link = functools.partial(_changed, "joint"), functools.partial(_changed, "link")
