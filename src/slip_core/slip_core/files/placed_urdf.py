"""A URDF whose base stands somewhere else than in the origin of the world."""

from __future__ import annotations

import math
from collections.abc import Sequence
from xml.etree import ElementTree

from slip_core.files.urdf import base_of, parse_urdf
from slip_core.grasp_params import BaseParams

PLACED = "placed_base"


def placed_urdf(text: str, position: Sequence[float], rotation: Sequence[float]) -> str:
    """Return a URDF whose root stands at a pose in the world: a new root link `placed_base` and a fixed joint.

    Args:
        text: URDF.
        position: of its root (3,) [m].
        rotation: rotation vector of its root (3,) [rad].

    Raises:
        InputError: as `parse_urdf`, or no single root link.
    """
    robot = parse_urdf(text)
    base = base_of(robot)
    ElementTree.SubElement(robot, "link", name=PLACED)
    joint = ElementTree.SubElement(robot, "joint", name=f"{PLACED}_joint", type="fixed")
    ElementTree.SubElement(joint, "parent", link=PLACED)
    ElementTree.SubElement(joint, "child", link=base)
    numbers = " ".join(repr(float(x)) for x in position)
    angles = " ".join(repr(x) for x in _roll_pitch_yaw(*rotation))
    ElementTree.SubElement(joint, "origin", xyz=numbers, rpy=angles)
    return ElementTree.tostring(robot, encoding="unicode")


def on_base(text: str, base: BaseParams) -> str:
    """Return a URDF whose root stands where a base is; the text itself where that is the origin."""
    return placed_urdf(text, base.position, base.rotation) if any((*base.position, *base.rotation)) else text


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
