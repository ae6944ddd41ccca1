"""A URDF whose base stands somewhere else than in the origin of the world."""

from __future__ import annotations

import math
from collections.abc import Sequence
from xml.etree import ElementTree

from slip_core.errors import InputError

PLACED = "placed_base"


def placed_urdf(text: str, position: Sequence[float], rotation: Sequence[float]) -> str:
    """Return a URDF whose root stands at a pose in the world: a new root link `placed_base` and a fixed joint.

    Args:
        text: URDF.
        position: of its root (3,) [m].
        rotation: rotation vector of its root (3,) [rad].

    Raises:
        InputError: not XML, or no single root link.
    """
    try:
        robot = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise InputError("robot description", got=f"no XML ({error})", expected="a URDF") from None
    children = {joint.find("child").get("link") for joint in robot.iter("joint") if joint.find("child") is not None}  # type: ignore[union-attr]
    roots = [link.get("name") for link in robot.findall("link") if link.get("name") not in children]
    if len(roots) != 1:
        raise InputError("robot description", got=f"{len(roots)} root links", expected="one")
    ElementTree.SubElement(robot, "link", name=PLACED)
    joint = ElementTree.SubElement(robot, "joint", name=f"{PLACED}_joint", type="fixed")
    ElementTree.SubElement(joint, "parent", link=PLACED)
    ElementTree.SubElement(joint, "child", link=str(roots[0]))
    numbers = " ".join(repr(float(x)) for x in position)
    angles = " ".join(repr(x) for x in _roll_pitch_yaw(*rotation))
    ElementTree.SubElement(joint, "origin", xyz=numbers, rpy=angles)
    return ElementTree.tostring(robot, encoding="unicode")


def _roll_pitch_yaw(x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return the angles of Rz(yaw) Ry(pitch) Rx(roll) for a rotation vector; away from pitch = 90 deg."""
    angle = math.sqrt(x * x + y * y + z * z)
    if angle == 0.0:
        return 0.0, 0.0, 0.0
    x, y, z = x / angle, y / angle, z / angle
    s, k = math.sin(angle), 1.0 - math.cos(angle)
    xx, yx, zx = 1.0 - k * (y * y + z * z), k * x * y + s * z, k * x * z - s * y
    zy, zz = k * y * z + s * x, 1.0 - k * (x * x + y * y)
    return math.atan2(zy, zz), math.atan2(-zx, math.hypot(xx, yx)), math.atan2(yx, xx)
