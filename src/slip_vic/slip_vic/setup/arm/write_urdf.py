"""The URDF that both nodes can use as it is: other joints locked, inertias possible, a pad frame, simple shapes."""

from __future__ import annotations

import fnmatch
import math
import warnings
from collections.abc import Mapping
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from scipy.spatial.transform import Rotation

from slip_core.arrays import Array
from slip_core.errors import InputError, UnknownName
from slip_core.files.urdf import (
    carried_links,
    chain,
    end_of,
    fix,
    inertial,
    is_physical,
    named,
    numbers_of,
    parse_urdf,
    usable_urdf,
)
from slip_core.grasp_params import ArmParams
from slip_vic.setup.arm.hand import Hand, axis_of, pose_of

PAD = "slip_pad"
GRAVITY = float(np.linalg.norm(ArmParams().gravity))
_SLACK = 1e-6
"""Part of the largest principal moment that the smallest two are given beyond what is just possible."""
_SHAPE_RADIUS, _SHORTEST = 0.035, 0.02
"""[m] Cylinders that are drawn in the place of meshes, and the shortest lever that gets one."""


Limits = Mapping[str, Mapping[str, float]]
"""Limits by name of a joint, or a pattern such as *: "effort" [N m], "velocity" [rad/s], or one of them."""


def arm_urdf(
    root: Element, hand: Hand, reach: float, positions: Mapping[str, float], limits: Limits, *, by_effort: bool
) -> tuple[str, list[str]]:
    """Return the URDF of an arm, ready for both nodes, and one line for each thing that had to be changed.

    Args:
        root: <robot>, which is changed.
        hand: where its hand is.
        reach: from the link's origin to the pad centre, along the approach [m].
        positions: where locked joints stay [rad, m]; 0, or the nearest limit, where there is none.
        limits: in the place of those of the file.
        by_effort: whether its drives have an effort interface.

    Raises:
        InputError: an unknown joint, or one without what a controller needs.
    """
    said: list[str] = []
    _limit(root, hand, limits, said, by_effort=by_effort)
    _lock(root, hand, positions, said)
    _mend_inertias(root, hand, said)
    text = usable_urdf(ElementTree.tostring(root, encoding="unicode"), hand.link, hand.joints)
    ready = parse_urdf(text)
    _add_pad(ready, hand, reach)
    _add_shapes(ready, hand)
    ElementTree.indent(ready)
    return ElementTree.tostring(ready, encoding="unicode", xml_declaration=True) + "\n", said


def _limit(root: Element, hand: Hand, limits: Limits, said: list[str], *, by_effort: bool) -> None:
    """Set the given limits; find placeholders for unknown ones in the file, such as 0, -1, or 1 at all joints."""
    joints = {name: joint for name, joint in named(root, "joint").items() if name in hand.joints}
    found: dict[str, Element] = {}
    for name, joint in joints.items():
        limit = joint.find("limit")
        found[name] = SubElement(joint, "limit") if limit is None else limit
    for pattern, given in limits.items():
        chosen = fnmatch.filter(joints, pattern)
        if not chosen:
            raise UnknownName("joint", pattern, joints, where="--limit")
        for name in chosen:
            for key, value in given.items():
                found[name].set(key, f"{value:g}")
    for key, unit in (("velocity", "rad/s"), ("effort", "N m")):
        values = {name: numbers_of(limit, key, (0.0,))[0] for name, limit in found.items()}
        same = set(values.values()) == {1.0} and not any(key in given for given in limits.values())
        unknown = list(values) if same else [name for name, value in values.items() if value <= 0.0]
        if same and key == "velocity":
            said.append("velocity limits of 1 rad/s at all joints: where these are placeholders, --limit '*=,VELOCITY'")
        elif unknown and key == "effort" and not by_effort:
            most = _largest_effort(root, hand)
            for name in unknown:
                found[name].set(key, f"{most:.4g}")
            said.append(
                f"no effort limit of {', '.join(unknown)}: {most:.3g} N m is assumed, the arm's weight at its end"
            )
        elif unknown:
            form = "'*=,VELOCITY'" if key == "velocity" else "'*=EFFORT,'"
            other = "" if key == "velocity" else ", or choose --drive with a position or velocity interface"
            raise InputError(
                f"URDF joint {', '.join(unknown)}", got=f"{key} limit {values[unknown[0]]:g}, which means unknown",
                expected=f"a limit [{unit}]", fix=f"--limit {form} from the data sheet, or a joint's name for *{other}",
            )  # fmt: skip


def _largest_effort(root: Element, hand: Hand) -> float:
    """Return the torque [N m] of the weight of all moving links at the end of the stretched arm: none needs more."""
    links = named(root, "link")
    mass = sum(
        (inertial(links[one]) or (0.0,))[0] for group in carried_links(root, hand.joints).values() for one in group
    )
    return GRAVITY * mass * sum(float(np.linalg.norm(pose_of(joint)[0])) for joint in chain(root, hand.link))


def _lock(root: Element, hand: Hand, positions: Mapping[str, float], said: list[str]) -> None:
    """Lock every joint that does not carry the hand, followers where their leaders are."""
    joints = named(root, "joint")
    for name in positions:
        if name not in joints:
            raise UnknownName("joint", name, joints, where="--lock")
    where = {
        name: _locked(joint, positions.get(name))
        for name, joint in joints.items()
        if name in positions
        or (name not in hand.joints and joint.get("type") != "fixed" and joint.find("mimic") is None)
    }
    for name, joint in joints.items():
        follows = joint.find("mimic")
        if follows is not None and name not in hand.joints:
            leader = where.get(str(follows.get("joint")), 0.0)
            value = leader * numbers_of(follows, "multiplier", (1.0,))[0] + numbers_of(follows, "offset", (0.0,))[0]
            where.setdefault(name, value)
    for value in sorted(set(where.values())):
        names = [name for name in where if where[name] == value]
        said.append(f"locked at {value:g}: {', '.join(names)}")
    for name, value in where.items():
        joint = joints[name]
        position, rotation = pose_of(joint)
        if value and joint.get("type") == "prismatic":
            position = position + rotation @ (value * axis_of(joint))
        elif value:
            rotation = rotation @ Rotation.from_rotvec(value * axis_of(joint)).as_matrix()
        fix(joint)
        if value:
            _place(joint, position, rotation)


def _locked(joint: Element, wanted: float | None) -> float:
    """Return where a joint stays [rad, m]: where it is wanted, else at 0 or the nearest limit.

    Raises:
        InputError: beyond its limits, or no number.
    """
    limit, (low, high) = joint.find("limit"), (-math.inf, math.inf)
    if limit is not None and joint.get("type") in ("revolute", "prismatic"):
        low, high = float(limit.get("lower", "0")), float(limit.get("upper", "0"))
    if wanted is None:
        return min(max(0.0, low), high)
    if not (math.isfinite(wanted) and low <= wanted <= high):
        raise InputError(
            f"--lock {joint.get('name')}", got=f"{wanted:g}", expected=f"within its limits {low:g}..{high:g} [rad, m]"
        )
    return wanted


def _place(element: Element, position: Array, rotation: Array) -> None:
    """Give a joint or a shape its origin; (3,) [m], (3, 3)."""
    origin = element.find("origin")
    if origin is None:
        origin = SubElement(element, "origin")
    origin.set("xyz", " ".join(f"{v:.12g}" for v in position))
    with warnings.catch_warnings(action="ignore"):  # at a pitch of 90 degrees only the sum of roll and yaw counts
        rpy = Rotation.from_matrix(rotation).as_euler("xyz")
    origin.set("rpy", " ".join(f"{v:.12g}" for v in rpy))


def _mend_inertias(root: Element, hand: Hand, said: list[str]) -> None:
    """Replace an inertia that no body has by the nearest that one has."""
    links = named(root, "link")
    for name in [link for group in carried_links(root, hand.joints).values() for link in group]:
        found = inertial(links[name])
        if found is None or is_physical(found[1]):
            continue
        mended = possible_inertia(found[1])
        tensor = links[name].find("inertial/inertia")
        assert tensor is not None
        for key, (i, j) in zip(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"),
                               ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)), strict=True):  # fmt: skip
            tensor.set(key, f"{mended[i, j]:.12g}")
        before, after = (", ".join(f"{v:.3g}" for v in np.linalg.eigvalsh(one)) for one in (found[1], mended))
        said.append(f"link {name}: no body has the principal moments {before}; the nearest possible are {after}")


def possible_inertia(inertia: Array) -> Array:
    """Return the nearest inertia that a body can have; (3, 3) [kg m2].

    What a body cannot have is a negative spread of mass along an axis, an eigenvalue of tr(I)/2 - I: those are set to
    zero.
    """
    spread, axes = np.linalg.eigh(0.5 * np.trace(inertia) * np.eye(3) - inertia)
    spread = np.maximum(spread, _SLACK * np.abs(spread).max())
    return np.array(axes @ np.diag(spread.sum() - spread) @ axes.T)


def _add_pad(root: Element, hand: Hand, reach: float) -> None:
    if PAD in named(root, "link"):
        raise InputError(
            f"URDF link {PAD}", got="a link of that name", expected="a URDF that `slip-vic arm` did not write"
        )
    SubElement(root, "link", name=PAD)
    joint = SubElement(root, "joint", name=f"{PAD}_joint", type="fixed")
    SubElement(joint, "parent", link=hand.link)
    SubElement(joint, "child", link=PAD)
    _place(joint, reach * hand.rotation[:, 0], hand.rotation)


def _add_shapes(root: Element, hand: Hand) -> None:
    """Draw a cylinder from each moving link without shapes to the joints on it, for those who look at the arm."""
    links = named(root, "link")
    carried = [link for group in carried_links(root, hand.joints).values() for link in group]
    for joint in named(root, "joint").values():
        link = links[end_of(joint, "parent")]
        lever = pose_of(joint)[0]
        length = float(np.linalg.norm(lever))
        drawn = any(visual.get("name") is None for visual in link.findall("visual"))
        if end_of(joint, "parent") not in carried or link.find("inertial") is None or length < _SHORTEST or drawn:
            continue
        visual = SubElement(link, "visual", name=f"to_{joint.get('name')}")
        _place(visual, 0.5 * lever, Rotation.align_vectors(lever[None] / length, [[0.0, 0.0, 1.0]])[0].as_matrix())
        SubElement(SubElement(visual, "geometry"), "cylinder", radius=f"{_SHAPE_RADIUS:g}", length=f"{length:.6g}")
