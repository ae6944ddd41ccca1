"""A URDF as both nodes read it: without what neither uses, and with an error that names what is missing.

Real files refer to absent meshes and have gripper joints that are not commanded and joints without limits. Pinocchio
and MuJoCo treat each of these differently; here they are settled once, for both.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from slip_core.arrays import Array
from slip_core.errors import InputError, nearest
from slip_core.grasp_params import BaseParams
from slip_core.params import range_of

MOVING = ("revolute", "continuous", "prismatic")
NO_LIMIT = 1e4
"""[rad] Limits that stand for none: a joint without end is read as a revolute one that never comes there. No place [m],
angle, mass [kg] or inertia [kg m2] of a robot is larger."""

LARGEST = 4 << 20
DEEPEST = 200
NESTED = 50
"""Bounds of a text in characters, of a tree in joints from its base to a tip, and of elements inside each other: beyond
any robot, and below what Pinocchio and MuJoCo support, whose recursions end the process on a chain of 5,000 links."""

_NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")
_MEASURED = ("origin", "mass", "inertia", "axis", "limit")
_IN_FIXED_JOINT = ("parent", "child", "origin")
_IN_MOVING_JOINT = (*_IN_FIXED_JOINT, "axis", "limit", "dynamics")
PLACED = "placed_base"


def parse_urdf(text: str, what: str = "robot_description") -> Element:
    """Return the <robot> element of a URDF text, checked before anything else reads it; what: its name in errors.

    Raises:
        InputError: not XML, another format, entities or a document type, too large or too deep, no tree of links,
            numbers beyond any robot, or xacro that was not expanded.
    """
    if len(text) > LARGEST:
        raise InputError(what, got=f"{len(text)} characters", expected=f"a URDF of at most {LARGEST}")
    if any(word in text.upper() for word in ("<!DOCTYPE", "<!ENTITY")):
        raise InputError(what, got="XML with a document type", expected="a URDF without declarations")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise InputError(what, got=text[:40] or "nothing", expected="a URDF", fix=str(error)) from None
    if root.tag != "robot":
        raise InputError(what, got=f"<{root.tag}>", expected="a URDF, whose root is <robot>")
    level = [root]
    for _ in range(NESTED):
        level = [child for element in level for child in element]
    if level:
        raise InputError(what, got=f"elements nested more than {NESTED} deep", expected="a URDF")
    if any("xacro" in element.tag or "${" in "".join(element.attrib.values()) for element in root.iter()):
        fix = "rename the file to end in .xacro, so that it is expanded"
        raise InputError(what, got="xacro", expected="a URDF", fix=fix)
    base_of(root, what)
    for part in (*root.findall("link"), *root.findall("joint")):
        _check_numbers(part)
    return root


def _check_numbers(part: Element) -> None:
    """Check that the numbers of a link or joint are as many as belong there, finite, and not beyond any robot.

    Raises:
        InputError: with the name of the link or joint.
    """
    for element in part.iter():
        bound = math.inf if element.tag == "limit" else NO_LIMIT
        for key, text in element.attrib.items() if element.tag in _MEASURED else ():
            count = 3 if key in ("xyz", "rpy") else 1
            found = [float(word) for word in text.split() if _NUMBER.fullmatch(word)]
            if len(text.split()) != count or sum(abs(x) <= bound and math.isfinite(x) for x in found) != count:
                most = f", at most {bound:g}" if bound < math.inf else ""
                got, expected = f'<{element.tag} {key}="{text}">', f"numbers, {count} of them, finite{most}"
                raise InputError(f"URDF {part.tag} {part.get('name')}", got=got, expected=expected)


def base_of(root: Element, what: str = "robot_description") -> str:
    """Return the only link that no joint carries, from which joints lead to all others; what: as in `parse_urdf`.

    Raises:
        InputError: links that are no such tree, or one that is too deep.
    """
    links = named(root, "link")
    below = {parent: [end_of(joint, "child") for joint in joints] for parent, joints in joints_on(root).items()}
    carried = {child for group in below.values() for child in group}
    bases = level = [name for name in links if name not in carried]
    reached, depth = list(bases), 0
    while level and depth <= DEEPEST and len(reached) <= len(links):
        level, depth = [child for name in level for child in below.get(name, ())], depth + 1
        reached += level
    if depth > DEEPEST:
        raise InputError(what, got=f"more than {DEEPEST} joints in a row", expected="an arm")
    if len(bases) != 1 or sorted(reached) != sorted(links):
        expected = "one tree: a base, and one joint that carries each other link"
        raise InputError(what, got=f"{len(links)} links that do not form one tree", expected=expected)
    return bases[0]


def numbers_of(element: Element | None, name: str, default: Sequence[float]) -> list[float]:
    """Return the numbers of an attribute.

    Raises:
        InputError: where they are none, or not as many as the default has.
    """
    text = None if element is None else element.get(name)
    if text is None:
        return list(default)
    try:
        found = [float(word) for word in text.split()]
    except ValueError:
        found = []
    if len(found) != len(default):
        raise InputError("robot_description", got=f'{name}="{text}"', expected=f"{len(default)} numbers")
    return found


def named(root: Element, tag: str) -> dict[str, Element]:
    """Return the links or joints of a robot by name, in the order of the file; tag: "link" or "joint".

    Raises:
        InputError: a name that is missing or there twice, a joint without parent or child.
    """
    found: dict[str, Element] = {}
    for element in root.findall(tag):
        name = element.get("name", "")
        if not name or name in found:
            raise InputError(
                f"URDF {tag} {name}", got="the name twice" if name else "no name", expected="one name each"
            )
        found[name] = element
        for end in ("parent", "child") if tag == "joint" else ():
            part = element.find(end)
            if part is None or part.get("link") is None:
                raise InputError(f"URDF joint {name}", got=f"no <{end}>", expected=f'<{end} link="..."/>')
    return found


def end_of(joint: Element, end: str) -> str:
    """Return the link at an end of a joint; end: "parent" or "child"."""
    part = joint.find(end)
    return "" if part is None else part.get("link", "")


def joints_on(root: Element) -> dict[str, list[Element]]:
    """Return the joints whose parent a link is, by its name."""
    found: dict[str, list[Element]] = {}
    for joint in named(root, "joint").values():
        found.setdefault(end_of(joint, "parent"), []).append(joint)
    return found


def chain(root: Element, link: str) -> list[Element]:
    """Return the joints that carry a link, from the base to it, fixed ones too."""
    above = {end_of(joint, "child"): joint for joint in named(root, "joint").values()}
    joints: list[Element] = []
    while link in above:
        joints.append(above[link])
        link = end_of(above[link], "parent")
    return joints[::-1]


def moving(joints: Sequence[Element]) -> list[str]:
    """Return the names of those joints that are not fixed."""
    return [str(joint.get("name")) for joint in joints if joint.get("type") != "fixed"]


def on_base(text: str, base: BaseParams) -> str:
    """Return a URDF with its root at a base: a new root link and a fixed joint; the text itself if that is the origin.

    Raises:
        InputError: as `parse_urdf`.
    """
    if not any((*base.position, *base.rotation)):
        return text
    robot = parse_urdf(text)
    root = base_of(robot)
    ElementTree.SubElement(robot, "link", name=PLACED)
    joint = ElementTree.SubElement(robot, "joint", name=f"{PLACED}_joint", type="fixed")
    ElementTree.SubElement(joint, "parent", link=PLACED)
    ElementTree.SubElement(joint, "child", link=root)
    numbers = " ".join(repr(x) for x in base.position)
    angles = " ".join(repr(x) for x in _roll_pitch_yaw(*base.rotation))
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


def usable_urdf(text: str, ee_frame: str, joint_names: Sequence[str]) -> str:
    """Return the URDF with `joint_names` as its only moving joints.

    Other joints are locked at 0 and continuous joints get limits that are never met. Left out are all shapes, by which
    MuJoCo would give a mass to a link without one, and impossible inertias of links that do not move.

    Args:
        text: a URDF.
        ee_frame: link at the pad centre.
        joint_names: the joints that carry it, from base to tip.

    Raises:
        InputError: names that do not fit; a joint's limits or a moving link's inertia missing or impossible.
    """
    root = parse_urdf(text)
    links, joints = named(root, "link"), named(root, "joint")
    if ee_frame not in links:
        raise InputError("ee_frame", got=ee_frame, expected="a link of the URDF", fix=nearest(ee_frame, links))
    _check_names(moving(chain(root, ee_frame)), moving(list(joints.values())), ee_frame, joint_names)
    for name in joint_names:
        _check_limits(joints[name])
    carried = carried_links(root, joint_names)
    for name in joint_names:
        _check_inertias(name, [links[one] for one in carried[name]])
    for name, joint in joints.items():
        if name not in joint_names:
            fix(joint)
        elif joint.get("type") == "continuous":
            joint.set("type", "revolute")
            for end, value in (("lower", -NO_LIMIT), ("upper", NO_LIMIT)):
                joint.find("limit").set(end, f"{value:g}")  # type: ignore[union-attr]  # `_check_limits` has seen it
        _keep(joint, _IN_MOVING_JOINT)
    moved = {one for group in carried.values() for one in group}
    for name, link in links.items():
        mass, inertia = inertial(link) or (-1.0, np.zeros((3, 3)))
        _keep(link, ("inertial",) if name in moved or (mass >= 0.0 and is_physical(inertia)) else ())
    _keep(root, ("link", "joint"))
    return ElementTree.tostring(root, encoding="unicode")


def fix(joint: Element) -> None:
    """Make a joint a fixed one, where it is 0."""
    joint.set("type", "fixed")
    _keep(joint, _IN_FIXED_JOINT)


def _keep(element: Element, tags: Sequence[str]) -> None:
    for part in list(element):
        if part.tag not in tags:
            element.remove(part)


def _check_names(carrying: list[str], movable: list[str], ee_frame: str, names: Sequence[str]) -> None:
    """Compare the configured joints with those that carry the pad, from base to tip."""
    if list(names) != carrying:
        near = [nearest(name, movable) for name in names if name not in movable][:1]
        raise InputError("joint_names", got=list(names), expected=f"those that move {ee_frame}, in the order of the "
                         f"URDF's chain from base to tip: {', '.join(carrying)}",
                         fix="; ".join((*near, "for an arm of your own: slip-vic arm FILE")))  # fmt: skip


def _check_limits(joint: Element) -> None:
    """Look whether a commanded joint has what a controller needs of it.

    Raises:
        InputError: with the joint's name.
    """
    name, kind, limit = joint.get("name"), joint.get("type"), joint.find("limit")
    length = math.hypot(*numbers_of(joint.find("axis"), "xyz", (1.0, 0.0, 0.0)))
    if length < 1.0 / NO_LIMIT:
        raise InputError(f"URDF joint {name}", got=f"an <axis> of length {length:g}", expected="a direction")
    keys = ("lower", "upper", "effort", "velocity")
    lower, upper, effort, velocity = (numbers_of(limit, key, (0.0,))[0] for key in keys)
    most = range_of("N m")[1], range_of("rad/s")[1]
    possible = 0.0 < effort <= most[0] and 0.0 < velocity <= most[1]
    if kind in MOVING and possible and (kind == "continuous" or lower < upper):
        return
    limits = f"limits {lower:g}..{upper:g}, effort {effort:g}, velocity {velocity:g}"
    raise InputError(
        f"URDF joint {name}",
        got=f"type {kind}, {'no <limit>' if limit is None else limits}",
        expected="a revolute, continuous or prismatic one with <limit>: lower < upper, effort above 0, at most "
        f"{most[0]:g}, velocity above 0, at most {most[1]:g}",
        fix=f"slip-vic arm FILE --limit {name}=EFFORT,VELOCITY, or where it is to stay: --lock {name}=VALUE",
    )


def carried_links(root: Element, joint_names: Sequence[str]) -> dict[str, list[str]]:
    """Return the links that are one rigid body behind each commanded joint, where all other joints are locked."""
    below, groups = joints_on(root), {}
    for name, joint in named(root, "joint").items():
        if name in joint_names:
            groups[name] = group = [end_of(joint, "child")]
            for link in group:  # grows while it is walked
                group += [end_of(one, "child") for one in below.get(link, []) if one.get("name") not in joint_names]
    return groups


def inertial(link: Element) -> tuple[float, Array] | None:
    """Return mass [kg] and inertia (3, 3) [kg m2] of a link, None where it has none.

    Raises:
        InputError: what is no number.
    """
    found = link.find("inertial")
    if found is None:
        return None
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    xx, xy, xz, yy, yz, zz = (numbers_of(found.find("inertia"), key, (0.0,))[0] for key in keys)
    return numbers_of(found.find("mass"), "value", (0.0,))[0], np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def is_physical(inertia: Array) -> bool:
    """Whether (3, 3) [kg m2] is the inertia of a body: principal moments positive, none above the sum of the others."""
    a, b, c = np.linalg.eigvalsh(inertia)
    return bool(a >= 0.0 and a + b >= c)


def _check_inertias(joint: str, group: list[Element]) -> None:
    """Look whether what a joint moves is a body."""
    total = 0.0
    for link in group:
        mass, tensor = inertial(link) or (0.0, np.zeros((3, 3)))
        total += mass
        if not (math.isfinite(mass) and mass >= 0.0 and is_physical(tensor)):
            moments = ", ".join(f"{value:.3g}" for value in np.linalg.eigvalsh(tensor))
            raise InputError(
                f"URDF link {link.get('name')}",
                got=f"mass {mass:g}, inertia with principal moments {moments}",
                expected="a body: nothing negative, no moment above the sum of the other two",
                fix="correct <inertial>, or let `slip-vic arm` write a URDF with the nearest possible inertia",
            )
    if not total > 0.0:
        names = ", ".join(str(link.get("name")) for link in group)
        expected = "<inertial> with <mass> and <inertia>, from the arm's data sheet"
        raise InputError(f"URDF joint {joint}", got=f"no mass behind it (link {names})", expected=expected)
