"""The arm's URDF and the scenario files, read through `importlib.resources` so that every kind of install works."""

from __future__ import annotations

import importlib.resources
import math
from collections.abc import Sequence
from xml.etree import ElementTree

__all__ = ["pair_names", "pair_text", "placed_urdf", "scenario_names", "scenario_text", "urdf_text"]

PLACED = "placed_base"

_FILES = importlib.resources.files(__name__)


def scenario_names() -> list[str]:
    """Return the names of the scenarios that come with the package, sorted."""
    return sorted(
        entry.name.removesuffix(".yaml") for entry in (_FILES / "scenarios").iterdir() if entry.name.endswith(".yaml")
    )


def scenario_text(name: str) -> str:
    """Return the YAML text of one scenario.

    Raises:
        KeyError: where `name` is not one of `scenario_names()`.
    """
    if name not in scenario_names():
        raise KeyError(name)
    return (_FILES / "scenarios" / f"{name}.yaml").read_text(encoding="utf-8")


def pair_names() -> list[str]:
    """Return the names of the scenarios with two arms, sorted."""
    entries = (_FILES / "scenarios" / "pairs").iterdir()
    return sorted(entry.name.removesuffix(".yaml") for entry in entries if entry.name.endswith(".yaml"))


def pair_text(name: str) -> str:
    """Return the YAML text of one scenario with two arms.

    Raises:
        KeyError: where `name` is not one of `pair_names()`.
    """
    if name not in pair_names():
        raise KeyError(name)
    return (_FILES / "scenarios" / "pairs" / f"{name}.yaml").read_text(encoding="utf-8")


def urdf_text() -> str:
    """Return the URDF of the arm with its gripper; its header comment names the sources of all numbers."""
    return (_FILES / "urdf" / "arm.urdf").read_text(encoding="utf-8")


def placed_urdf(text: str, position: Sequence[float], rotation: Sequence[float]) -> str:
    """Return a URDF whose root stands at a pose in the world: a new root link `placed_base` and a fixed joint.

    Args:
        text: URDF.
        position: of its root (3,) [m].
        rotation: rotation vector of its root (3,) [rad].

    Raises:
        ValueError: not XML, or no single root link.
    """
    try:
        robot = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ValueError(f"robot description is not XML: {error}") from None
    children = {joint.find("child").get("link") for joint in robot.iter("joint") if joint.find("child") is not None}  # type: ignore[union-attr]
    roots = [link.get("name") for link in robot.findall("link") if link.get("name") not in children]
    if len(roots) != 1:
        raise ValueError(f"robot description has {len(roots)} root links, one is needed")
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
