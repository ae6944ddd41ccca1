"""The arm of a URDF as the page draws it: links from base to tip, each with its joint and its shapes."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import Any, Final
from xml.etree.ElementTree import Element

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from slip_core.files.resources import find_file
from slip_core.files.urdf import MOVING, base_of, end_of, joints_on, named, numbers_of, parse_urdf
from slip_vic.page.packing import Packer

_GREY: Final = (0.7, 0.7, 0.72, 1.0)
_NONE: Final = (0.0, 0.0, 0.0)


def links_of(urdf: str, packer: Packer) -> tuple[list[dict[str, Any]], list[str]]:
    """Return the links, parents first, and what could not be drawn.

    A link: name, parent (number in the list, -1 for the base), joint (name, "" where fixed), kind, axis, position and
    quaternion xyzw of the joint on the parent, shapes. A shape: kind, size (box: edges; cylinder: radius, length;
    sphere: radius; mesh: scale), position, quaternion, colour, and for a mesh its points and faces.

    Raises:
        InputError: where the text is no URDF with one base.
    """
    robot = parse_urdf(urdf)
    materials = {one.get("name"): one for one in robot.findall("material") if one.find("color") is not None}
    missing: list[str] = []
    elements, below = named(robot, "link"), joints_on(robot)
    links: list[dict[str, Any]] = []
    waiting: list[tuple[str, int, Element | None]] = [(base_of(robot), -1, None)]
    for name, parent, joint in waiting:  # grows while it is walked
        kind = "fixed" if joint is None else joint.get("type", "fixed")
        axis = np.array(numbers_of(None if joint is None else joint.find("axis"), "xyz", (1.0, 0.0, 0.0)))
        links.append(
            {
                "name": name,
                "parent": parent,
                "joint": joint.get("name", "") if joint is not None and kind in MOVING else "",
                "kind": kind,
                "axis": (axis / (np.linalg.norm(axis) or 1.0)).tolist(),
                **_origin(joint),
                "shapes": list(_shapes(elements[name], materials, packer, missing)),
            }
        )
        waiting += [(end_of(one, "child"), len(links) - 1, one) for one in below.get(name, [])]
    return links, missing


def _origin(element: Element | None) -> dict[str, list[float]]:
    """Return position [m] and quaternion x, y, z, w of an element's origin."""
    origin = None if element is None else element.find("origin")
    turn = Rotation.from_euler("xyz", numbers_of(origin, "rpy", _NONE))
    return {"position": numbers_of(origin, "xyz", _NONE), "quaternion": turn.as_quat().tolist()}


def _shapes(
    link: Element, materials: dict[str | None, Element], packer: Packer, missing: list[str]
) -> Iterator[dict[str, Any]]:
    for visual in link.findall("visual"):
        geometry = visual.find("geometry")
        shape = None if geometry is None else next(iter(geometry), None)
        if shape is None:
            continue
        material = visual.find("material")
        if material is not None and material.find("color") is None:  # it has the name of one of the robot's
            material = materials.get(material.get("name"))
        colour = None if material is None else material.find("color")
        made = _shape(shape, packer, missing)
        if made is not None:
            yield {**made, "colour": numbers_of(colour, "rgba", _GREY), **_origin(visual)}


def _shape(shape: Element, packer: Packer, missing: list[str]) -> dict[str, Any] | None:
    if shape.tag == "box":
        return {"kind": "box", "size": numbers_of(shape, "size", (0.1, 0.1, 0.1))}
    if shape.tag == "cylinder":
        return {"kind": "cylinder", "size": [float(shape.get("radius", 0.05)), float(shape.get("length", 0.1))]}
    if shape.tag == "sphere":
        return {"kind": "sphere", "size": [float(shape.get("radius", 0.05))]}
    if shape.tag != "mesh":
        return None
    file = shape.get("filename", "")
    try:
        mesh = trimesh.load_mesh(str(find_file(file)))
        points, faces = packer.add(np.asarray(mesh.vertices)), packer.add(np.asarray(mesh.faces))
    except Exception:  # a reader of many foreign formats: anything may happen, and a shape is only decoration
        missing.append(file)
        return None
    return {"kind": "mesh", "size": numbers_of(shape, "scale", (1.0, 1.0, 1.0)), "points": points, "faces": faces}


@functools.lru_cache
def box_of(urdf: str) -> tuple[float, ...]:
    """Return the edges of the first box in a URDF [m], as `object_description` has one."""
    return tuple(numbers_of(parse_urdf(urdf).find(".//box"), "size", (0.1, 0.1, 0.1)))
