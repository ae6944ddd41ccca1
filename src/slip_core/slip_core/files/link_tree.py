"""The links of a URDF as a tree: names, joints, and where each link is on its parent; no dynamics, no display."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element

from slip_core.files.urdf import MOVING, base_of, end_of, named, numbers_of, parse_urdf


@dataclass(frozen=True, slots=True)
class Link:
    """One link; its joint's name is "" where it does not move.

    parent: number in the list, -1 for the base. position [m], quaternion (x, y, z, w): of the joint's frame on the
    parent where the joint is at 0. axis: unit vector on the joint's frame.
    """

    name: str
    parent: int
    joint: str
    kind: str
    axis: tuple[float, float, float]
    position: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]
    element: Element


def read_links(urdf: str) -> list[Link]:
    """Return the links of a URDF, parents before children.

    Raises:
        InputError: where the text is no URDF with one base.
    """
    robot = parse_urdf(urdf)
    base, by_name = base_of(robot), named(robot, "link")
    joints: dict[str, list[Element]] = {}
    for joint in named(robot, "joint").values():
        joints.setdefault(end_of(joint, "parent"), []).append(joint)
    links = [Link(base, -1, "", "fixed", (1.0, 0.0, 0.0), (0.0,) * 3, (0.0, 0.0, 0.0, 1.0), by_name[base])]
    for number, parent in enumerate(links):  # grows while it is walked
        for joint in joints.get(parent.name, []):
            name, kind = end_of(joint, "child"), joint.get("type", "fixed")
            position, quaternion = origin_of(joint)
            x, y, z = numbers_of(joint.find("axis"), "xyz", (1.0, 0.0, 0.0))
            size = math.sqrt(x * x + y * y + z * z) or 1.0
            moves = joint.get("name", "") if kind in MOVING else ""
            axis = (x / size, y / size, z / size)
            links.append(Link(name, number, moves, kind, axis, position, quaternion, by_name[name]))
    return links


def origin_of(element: Element) -> tuple[tuple[float, float, float], tuple[float, float, float, float]]:
    """Return position [m] and quaternion x, y, z, w of an element's origin."""
    origin = element.find("origin")
    roll, pitch, yaw = (0.5 * value for value in numbers_of(origin, "rpy", (0.0, 0.0, 0.0)))
    about_z = (0.0, 0.0, math.sin(yaw), math.cos(yaw))
    about_y = (0.0, math.sin(pitch), 0.0, math.cos(pitch))
    about_x = (math.sin(roll), 0.0, 0.0, math.cos(roll))
    x, y, z = numbers_of(origin, "xyz", (0.0, 0.0, 0.0))
    return (x, y, z), _product(_product(about_z, about_y), about_x)


def _product(a: Sequence[float], b: Sequence[float]) -> tuple[float, float, float, float]:
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )
