"""Messages to value objects; works on ROS messages and on what a bag reader decodes, without importing ROS."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from slip_core.arrays import Array, matrix_from_quat_xyzw, readonly
from slip_core.errors import InputError
from slip_core.stamps import NS_PER_S
from slip_core.topics import WORLD
from slip_core.types import (
    CartesianReference,
    CommandInterface,
    DisplacementSample,
    JointCommand,
    JointSample,
    PoseGoal,
    SlipSample,
)

if TYPE_CHECKING:  # the fields are the same, whether ROS or a bag reader decodes
    from geometry_msgs.msg import PoseStamped, TwistStamped, Vector3, WrenchStamped
    from sensor_msgs.msg import JointState
    from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory

Sample = TypeVar("Sample")
FLAG_UP = 0.5
JOINT_FIELDS = ("position", "velocity", "effort")
LEAST_NORM = 1e-6


def vector6(linear: Vector3, angular: Vector3) -> Array:
    """Return the six numbers of two Vector3; (6,), unit and frame of the message."""
    return np.array([linear.x, linear.y, linear.z, angular.x, angular.y, angular.z])


@functools.lru_cache
def joint_indices(joints: tuple[str, ...], names: tuple[str, ...]) -> list[int]:
    """Return where each of the joints stands among the names of a JointState.

    Raises:
        InputError: where a joint is missing or named twice.
    """
    for joint in joints:
        if names.count(joint) != 1:
            what = f"joint state: joint {joint}"
            expected = f"each of {list(joints)} once, all in one message"
            raise InputError(what, got=f"names {list(names)}", expected=expected)
    return [names.index(joint) for joint in joints]


def joint_samples(message: JointState, joints: tuple[str, ...]) -> Callable[[int, Array, Array, Array], JointSample]:
    """Check names and sizes of a JointState; return what makes samples of (stamp_ns, position, velocity, effort).

    Velocities that the message leaves out are NaN, efforts are zero.

    Raises:
        InputError: wrong names, or arrays shorter than the names.
    """
    pick = _picker(joint_indices(joints, tuple(message.name)))
    count = len(message.name)
    if len(message.position) != count or len(message.velocity) not in (0, count):
        raise InputError(
            "joint state",
            got=f"{count} names, {len(message.position)} positions, {len(message.velocity)} velocities",
            expected="one position per name, and one velocity or none at all",
        )
    size = len(joints)
    no_effort = readonly(np.zeros(size)) if len(message.effort) != count else None
    no_velocity = readonly(np.full(size, np.nan)) if len(message.velocity) != count else None

    def make(stamp_ns: int, position: Array, velocity: Array, effort: Array) -> JointSample:
        measured = pick(velocity) if no_velocity is None else no_velocity
        return JointSample(stamp_ns, pick(position), measured, pick(effort) if no_effort is None else no_effort)

    return make


def joint_commands(
    message: JointState, joints: tuple[str, ...], interface: CommandInterface
) -> Callable[[int, Array, Array, Array], JointCommand]:
    """Check names and sizes of a command; return what makes commands of (stamp_ns, position, velocity, effort).

    interface: which of the three counts. No number at all means "no command for this stamp".

    Raises:
        InputError: wrong names, or not one number per name.
    """
    index, count = joint_indices(joints, tuple(message.name)), len(getattr(message, interface))
    if count not in (0, len(message.name)):
        raise InputError(
            f"{interface} command", got=f"{len(message.name)} names, {count} numbers", expected="one number per name"
        )
    pick = _picker(index if count else [])
    which = JOINT_FIELDS.index(interface)
    return lambda stamp_ns, *fields: JointCommand(stamp_ns, pick(fields[which]), interface)


def _picker(index: list[int]) -> Callable[[Array], Array]:
    """Return what puts numbers into order; where they are in order it hands them on."""
    in_order = index == list(range(len(index)))
    return lambda values: values if in_order and len(values) == len(index) else values[index]


def in_frame(
    message: WrenchStamped | TwistStamped | PoseStamped, *, frame: str, make: Callable[[int, Array], Sample]
) -> Callable[[int, Array], Sample]:
    """Check the frame of a stamped message, where it names one; return what makes samples of (stamp_ns, numbers).

    Raises:
        InputError: another frame; nothing here knows how to turn it.
    """
    if message.header.frame_id not in ("", frame):
        raise InputError("frame_id", got=message.header.frame_id, expected=frame)
    return make


def slip_sample(stamp_ns: int, twist: Array) -> SlipSample:
    """Return the slip velocity; invalid where any number is not finite."""
    return SlipSample(stamp_ns, twist, valid=bool(np.isfinite(twist).all()))


def displacement_sample(stamp_ns: int, pose: Array) -> DisplacementSample:
    """Return the slip displacement; invalid where any number is not finite or the quaternion has no length."""
    valid = bool(np.isfinite(pose).all() and np.linalg.norm(pose[3:]) > LEAST_NORM)
    return DisplacementSample(stamp_ns, pose, valid)


def slip_flag(stamp_ns: int, flags: Array) -> SlipSample:
    """Return flags of slip as a slip sample: all ones where any is up, zeros where none is.

    What is not known (NaN) is not "no slip": where nothing else is known, or no flag is there, the sample is invalid.
    """
    known = flags[np.isfinite(flags)]
    return SlipSample(stamp_ns, np.full(6, float((known > FLAG_UP).any())), valid=len(known) > 0)


def flag_samples(message: JointState) -> Callable[[int, Array], SlipSample]:
    """Check that a JointState has a position per name; return what makes samples of (stamp_ns, positions).

    Raises:
        InputError: it has not.
    """
    if len(message.position) != len(message.name):
        got = f"{len(message.name)} names, {len(message.position)} positions"
        raise InputError("slip flag", got=got, expected="one position per name: 1 slips, 0 holds, NaN unknown")
    return slip_flag


def cartesian_reference(message: MultiDOFJointTrajectory) -> CartesianReference:
    """Return the first point of a MultiDOFJointTrajectory as the desired motion of {ee} in {w}.

    Velocities and accelerations that the message leaves out are zero.

    Raises:
        InputError: no point, no transform, or a quaternion of no length.
    """
    if not message.points or not message.points[0].transforms:
        raise InputError("reference", got="no point with a transform", expected="one point with one transform")
    point = message.points[0]
    pose = point.transforms[0]
    quat = (pose.rotation.x, pose.rotation.y, pose.rotation.z, pose.rotation.w)
    twist = vector6(point.velocities[0].linear, point.velocities[0].angular) if point.velocities else np.zeros(6)
    acceleration = (
        vector6(point.accelerations[0].linear, point.accelerations[0].angular) if point.accelerations else np.zeros(6)
    )
    return CartesianReference(
        position=np.array([pose.translation.x, pose.translation.y, pose.translation.z]),
        rotation=matrix_from_quat_xyzw(quat),
        twist=twist,
        acceleration=acceleration,
        stamp_ns=message.header.stamp.sec * NS_PER_S + message.header.stamp.nanosec,
    )


def streamed_reference(message: MultiDOFJointTrajectory) -> CartesianReference:
    """Return a reference of a stream that is governed.

    Raises:
        InputError: as `cartesian_reference`, or without the motion that friction must carry, or not finite.
    """
    reference, point = cartesian_reference(message), message.points[0]
    if not point.velocities or not point.accelerations:
        raise InputError(
            "reference", got="a pose alone", expected="velocities and accelerations too: the governor needs them",
            fix="fill them, or send a goal (trajectory.kind goal)",
        )  # fmt: skip
    if not all(np.isfinite(part).all() for part in (reference.position, reference.twist, reference.acceleration)):
        raise InputError("reference", got="numbers that are not finite", expected="finite numbers")
    return reference


def pose_goal(message: MultiDOFJointTrajectory, duration_s: float) -> PoseGoal:
    """Return the one point of a MultiDOFJointTrajectory as a goal at rest for {ee} in {w}.

    Its time_from_start is the duration; where that is zero it is `duration_s`.

    Raises:
        InputError: not one point at rest in {w}, numbers that are not finite, or no positive duration.
    """
    if len(message.points) != 1:
        raise InputError("goal", got=f"{len(message.points)} points", expected="one, with pose and time_from_start")
    if message.header.frame_id not in ("", WORLD):
        raise InputError("goal: frame_id", got=message.header.frame_id, expected=WORLD)
    reference, after = cartesian_reference(message), message.points[0].time_from_start
    if not np.isfinite(reference.position).all():
        raise InputError("goal: position", got=reference.position.tolist(), expected="finite numbers")
    if reference.twist.any() or reference.acceleration.any():
        raise InputError("goal: velocities", got="a motion", expected="none: a goal is at rest", fix="leave them out")
    duration = after.sec + 1e-9 * after.nanosec or duration_s
    if not duration > 0.0:
        raise InputError("goal: time_from_start", got=f"{duration:g} s", expected="more than 0")
    return PoseGoal(reference.position, reference.rotation, duration)


def joint_trajectory(message: JointTrajectory) -> tuple[Array, Array, tuple[str, ...]]:
    """Return times (m,) [s], positions (m, n) [rad] and joint names of a JointTrajectory.

    Raises:
        InputError: a point without a position per joint.
    """
    names, points = tuple(message.joint_names), message.points
    for number, point in enumerate(points, 1):
        if len(point.positions) != len(names):
            got = f"{len(point.positions)} positions in point {number}"
            raise InputError("joint trajectory", got=got, expected=f"{len(names)}, one per joint name")
    times = [point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec for point in points]
    return np.array(times), np.array([point.positions for point in points]), names
