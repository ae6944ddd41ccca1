"""Where the hand of a URDF is: the link at its end, the joints that carry it, and which way it reaches."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from xml.etree.ElementTree import Element

import numpy as np
from scipy.spatial.transform import Rotation

from slip_core.arrays import Array
from slip_core.errors import InputError, UnknownName
from slip_core.files.urdf import chain, end_of, moving, named, numbers_of

LEAST_JOINTS = 3
"""They bring the pad to a place; what further ones turn it about, the law commands too."""

AXES = {f"{sign}{name}": (-1.0 if sign else 1.0) * axis for name, axis in zip("xyz", np.eye(3), strict=True)
        for sign in ("", "-")}  # fmt: skip

_FINGER = re.compile(r"finger|knuckle|jaw|thumb|hand_(index|little|middle|mrl|ring)", re.IGNORECASE)
_GRIPPER = "gripper"
"""In the names of an arm's last link and of the joints that close the hand."""
_TURNS = re.compile(r"yaw|pitch|roll|rotat", re.IGNORECASE)
"""In the names of joints that turn a whole gripper."""
_TIP_NAMES = ("grasp", "tcp", "tool0", "eef", "end_effector", "ee_link", "tool", "flange", "hand", "ee")
"""How links at the end of an arm are called, the surest first."""
_ALONG = 0.9
"""Cosine above which a direction counts as along an axis."""
_LEVER = 1e-3
"""[m] Distance below which two points count as one."""


@dataclass(frozen=True, slots=True)
class Hand:
    """The end of an arm. Directions are axes of `link`: "x", "-z" and so on.

    joints: those that carry it, from base to tip; approach: out of the hand;
    normal: the closing direction of the jaws; said: what was found rather than given, one line each.
    """

    link: str
    joints: tuple[str, ...]
    approach: str
    normal: str
    said: tuple[str, ...]

    @property
    def rotation(self) -> Array:
        """Axes of the pad frame, x approach and z normal, on those of the link; (3, 3)."""
        x, z = AXES[self.approach], AXES[self.normal]
        return np.stack((x, np.cross(z, x), z), axis=1)


def find_hand(
    root: Element, link: str = "", approach: str = "", normal: str = "", locked: tuple[str, ...] = ()
) -> Hand:
    """Find the end of an arm, or take what is given of it.

    Args:
        root: <robot>.
        link: its last link; empty finds it.
        approach: axis of the link out of the hand; empty: the axis that the last joint turns about, outwards.
        normal: axis of the link along which the jaws close; empty: that of sliding fingers, else y.
        locked: joints that stay where they are.

    Raises:
        InputError: an unknown link, two arms, too few joints, an axis that cannot be found.
    """
    links = named(root, "link")
    said = []
    if link and link not in links:
        raise UnknownName("link", link, links, where="--ee")
    if not link:
        link = _last_link(root, locked)
        said.append(f"the hand is at link {link} (--ee LINK takes another)")
    joints = tuple(name for name in moving(chain(root, link)) if name not in locked)
    if len(joints) < LEAST_JOINTS:
        raise InputError(
            f"arm to link {link}",
            got=f"{len(joints)} moving joints ({', '.join(joints)})",
            expected=f"at least {LEAST_JOINTS}, which position the pad",
            fix=f"--ee names another link; left out: {', '.join(sorted(fingers(root)) or ['no finger'])}",
        )
    if not approach:
        approach = _approach(root, link, joints[-1])
        said.append(f"it reaches along {approach} of that link (--approach takes another axis)")
    if not normal:
        normal, why = _normal(root, link, joints[-1], approach)
        said.append(f"its jaws close along {normal} of that link, {why} (--normal takes another axis)")
    if abs(float(AXES[approach] @ AXES[normal])) > 0.0:
        raise InputError(f"--normal {normal}", got=f"along --approach {approach}", expected="another axis of the link")
    return Hand(link, joints, approach, normal, tuple(said))


def _last_link(root: Element, locked: tuple[str, ...]) -> str:
    """Return the link at the end of the longest chain of joints that are no fingers; by its name, where several are."""
    closing = fingers(root)
    counts: dict[str, int] = {}
    for link in named(root, "link"):
        names = moving(chain(root, link))
        if not closing & set(names):
            counts[link] = len([name for name in names if name not in locked])
    most = max((1, *counts.values()))
    ends = [link for link, count in counts.items() if count == most]
    arms = {moving(chain(root, link))[-1] for link in ends if moving(chain(root, link))}
    if len(arms) > 1 and most >= LEAST_JOINTS:
        raise InputError("--ee", got=f"{len(arms)} arms that are equally long", expected=f"one of {', '.join(ends)}")
    if not ends:
        raise InputError("robot_description", got="no moving joint", expected="an arm")
    for name in _TIP_NAMES:
        if found := [link for link in ends if name in link.lower() and not _FINGER.search(link)]:
            return found[0]
    return ends[0]


def fingers(root: Element) -> set[str]:
    """Return the moving joints that close a hand: named as fingers are, coupled with another, or side by side.

    The joint that carries or turns a gripper is not one of them. A gripper's own joints have its name, or connect two
    of its links, and carry no fingers.
    """
    joints = {name: joint for name, joint in named(root, "joint").items() if joint.get("type") != "fixed"}
    carriers = {name: moving(chain(root, end_of(joint, "parent"))) for name, joint in joints.items()}
    carrying = {one for names in carriers.values() for one in names}
    last = [names[-1] for name, names in carriers.items() if names and name not in carrying]
    found = {
        name for name, names in carriers.items() if name not in carrying and last.count(names[-1] if names else "") > 1
    }
    for name, joint in joints.items():
        follows = joint.find("mimic")
        if follows is not None or _FINGER.search(f"{name} {end_of(joint, 'child')}"):
            found |= {name, name if follows is None else str(follows.get("joint"))}
    carrying = {one for name in found & carriers.keys() for one in carriers[name]}
    for name, joint in joints.items():
        ends = [end_of(joint, end).lower() for end in ("parent", "child")]
        of_gripper = _GRIPPER in name.lower() or all(_GRIPPER in end for end in ends)
        if of_gripper and name not in carrying and not _TURNS.search(name):
            found.add(name)
    return found


def pose_of(joint: Element) -> tuple[Array, Array]:
    """Return the origin of a joint on its parent's axes: position (3,) [m], rotation (3, 3)."""
    origin, none = joint.find("origin"), (0.0, 0.0, 0.0)
    turn = Rotation.from_euler("xyz", numbers_of(origin, "rpy", none))
    return np.array(numbers_of(origin, "xyz", none)), turn.as_matrix()


def axis_of(joint: Element) -> Array:
    """Return the unit axis of a joint; (3,)."""
    found = np.array(numbers_of(joint.find("axis"), "xyz", (1.0, 0.0, 0.0)))
    return np.array(found / np.linalg.norm(found))


def _pose(root: Element, link: str) -> tuple[Array, Array]:
    """Return where a link is with all joints at 0: position (3,) [m], rotation (3, 3)."""
    p, R = np.zeros(3), np.eye(3)
    for joint in chain(root, link):
        d, turn = pose_of(joint)
        p, R = p + R @ d, R @ turn
    return p, R


def _approach(root: Element, link: str, last: str) -> str:
    """Return the axis of the link that is nearest to that of the joint `last`, away from the arm."""
    position, R = _pose(root, link)
    carrying = chain(root, link)
    behind = [str(joint.get("name")) for joint in carrying].index(last)
    axis = _pose(root, end_of(carrying[behind], "child"))[1] @ axis_of(carrying[behind])
    # The side on which the hand is, seen from the last joint; where it is at it, from the joints before.
    ends = [end_of(carrying[behind], "child"), *(end_of(joint, "parent") for joint in carrying[behind::-1])]
    sides = (float((position - _pose(root, end)[0]) @ axis) for end in ends)
    direction = math.copysign(1.0, next((side for side in sides if abs(side) > _LEVER), 1.0)) * R.T @ axis
    name = max(AXES, key=lambda one: float(AXES[one] @ direction))
    if float(AXES[name] @ direction) < _ALONG:
        raise InputError(
            "--approach", got="nothing, and the last joint turns about none of the hand's axes",
            expected="the axis of the hand's link that points out of it: x, -x, y, -y, z or -z",
        )  # fmt: skip
    return name


def _normal(root: Element, link: str, last: str, approach: str) -> tuple[str, str]:
    """Return along which axis of the link the jaws close, and how that was found."""
    for name, joint in named(root, "joint").items():
        child = end_of(joint, "child")
        if joint.get("type") != "prismatic" or name == last or last not in moving(chain(root, child)):
            continue
        direction = _pose(root, link)[1].T @ _pose(root, child)[1] @ axis_of(joint)
        found = max("xyz", key=lambda one: abs(float(AXES[one] @ direction)))
        if abs(float(AXES[found] @ direction)) > _ALONG and found != approach[-1]:
            return found, f"as finger {name} does"
    return next(name for name in "yz" if name != approach[-1]), "as assumed: no sliding finger shows it"
