"""The arm of a URDF as the page draws it: links from base to tip, each with its joint and its shapes."""

from __future__ import annotations

import importlib.resources
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from slip_bringup.web.packing import Packer
from slip_core.errors import InputError

MOVING: Final = ("revolute", "continuous", "prismatic")
_GREY: Final = (0.7, 0.7, 0.72, 1.0)


def links_of(urdf: str, packer: Packer) -> tuple[list[dict[str, Any]], list[str]]:
    """Return the links, parents first, and what could not be drawn.

    A link: name, parent (number in the list, -1 for the base), joint (name, "" where fixed), kind, axis, position and
    quaternion xyzw of the joint on the parent, shapes. A shape: kind, size (box: edges; cylinder: radius, length;
    sphere: radius; mesh: scale), position, quaternion, colour, and for a mesh its points and faces.

    Raises:
        InputError: where the text is no URDF with one base.
    """
    try:
        robot = ET.fromstring(urdf)
    except ET.ParseError as error:
        raise InputError("robot_description", got=str(error), expected="a URDF") from None
    colours = {
        m.get("name"): _colour(m) for m in robot.findall("material") if m.get("name") and m.find("color") is not None
    }
    by_name = {link.get("name", ""): link for link in robot.findall("link")}
    joints: dict[str, list[ET.Element]] = {}
    for joint in robot.findall("joint"):
        joints.setdefault(_end(joint, "parent"), []).append(joint)
    bases = set(by_name) - {_end(joint, "child") for found in joints.values() for joint in found}
    if len(bases) != 1:
        raise InputError("robot_description", got=f"{len(bases)} links without a parent", expected="one base")
    missing: list[str] = []
    links: list[dict[str, Any]] = []

    def add(name: str, parent: int, joint: ET.Element | None) -> None:
        kind = "fixed" if joint is None else joint.get("type", "fixed")
        moves = joint is not None and kind in MOVING
        axis = None if joint is None else joint.find("axis")
        links.append(
            {
                "name": name,
                "parent": parent,
                "joint": joint.get("name", "") if joint is not None and moves else "",
                "kind": kind,
                "axis": _numbers(axis, "xyz", (1.0, 0.0, 0.0)),
                **_placed(joint),
                "shapes": list(_shapes(by_name[name], colours, packer, missing)),
            }
        )
        number = len(links) - 1
        for child in joints.get(name, []):
            add(_end(child, "child"), number, child)

    add(bases.pop(), -1, None)
    return links, missing


def _end(joint: ET.Element, which: str) -> str:
    found = joint.find(which)
    return "" if found is None else found.get("link", "")


def _shapes(
    link: ET.Element, colours: dict[str | None, list[float]], packer: Packer, missing: list[str]
) -> Iterator[dict[str, Any]]:
    for visual in link.findall("visual"):
        geometry = visual.find("geometry")
        shape = None if geometry is None else next(iter(geometry), None)
        if shape is None:
            continue
        material = visual.find("material")
        colour = list(_GREY)
        if material is not None:
            own = material.find("color") is not None
            colour = _colour(material) if own else colours.get(material.get("name"), colour)
        made = _shape(shape, packer, missing)
        if made is not None:
            yield {**made, "colour": colour, **_placed(visual)}


def _shape(shape: ET.Element, packer: Packer, missing: list[str]) -> dict[str, Any] | None:
    if shape.tag == "box":
        return {"kind": "box", "size": _numbers(shape, "size", (0.1, 0.1, 0.1))}
    if shape.tag == "cylinder":
        return {"kind": "cylinder", "size": [float(shape.get("radius", 0.05)), float(shape.get("length", 0.1))]}
    if shape.tag == "sphere":
        return {"kind": "sphere", "size": [float(shape.get("radius", 0.05))]}
    if shape.tag == "mesh":
        file = shape.get("filename", "")
        try:
            mesh = trimesh.load_mesh(_path(file))
            points, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
        except Exception:  # a reader of many foreign formats: anything may happen, and a shape is only decoration
            missing.append(file)
            return None
        scale = _numbers(shape, "scale", (1.0, 1.0, 1.0))
        return {
            "kind": "mesh",
            "size": scale,
            "points": packer.add(points),
            "faces": packer.add(faces.astype(np.uint32)),
        }
    return None


def _path(file: str) -> str:
    if not file.startswith("package://"):
        return file.removeprefix("file://")
    package, _, inner = file.removeprefix("package://").partition("/")
    return str(importlib.resources.files(package).joinpath(inner))


def _colour(material: ET.Element) -> list[float]:
    return _numbers(material.find("color"), "rgba", _GREY)


def _placed(element: ET.Element | None) -> dict[str, list[float]]:
    origin = None if element is None else element.find("origin")
    rpy = _numbers(origin, "rpy", (0.0, 0.0, 0.0))
    return {
        "position": _numbers(origin, "xyz", (0.0, 0.0, 0.0)),
        "quaternion": Rotation.from_euler("xyz", rpy).as_quat().tolist(),
    }


def _numbers(element: ET.Element | None, name: str, default: Sequence[float]) -> list[float]:
    text = None if element is None else element.get(name)
    try:
        return list(default) if text is None else [float(word) for word in text.split()]
    except ValueError:
        raise InputError("robot_description", got=f'{name}="{text}"', expected="numbers") from None
