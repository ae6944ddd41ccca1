"""Messages to value objects; works on ROS messages and on what a bag reader decodes, without importing ROS."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import numpy as np

from slip_core.arrays import Array, matrix_from_quat_xyzw
from slip_core.errors import InputError
from slip_core.stamps import NS_PER_S, stamp_to_ns
from slip_core.topics import WORLD
from slip_core.types import (
    CartesianReference,
    CommandInterface,
    DisplacementSample,
    JointCommand,
    JointSample,
    PoseGoal,
    SlipSample,
    WrenchSample,
)

if TYPE_CHECKING:  # the fields are the same, whether ROS or a bag reader decodes
    from geometry_msgs.msg import PoseStamped, TwistStamped, Vector3, WrenchStamped
    from sensor_msgs.msg import JointState
    from trajectory_msgs.msg import MultiDOFJointTrajectory

FLAG_UP = 0.5
LEAST_NORM = 1e-6
TURN = "transform it to the pad's axes in the driver"


def vector6(linear: Vector3, angular: Vector3) -> Array:
    """Return the six numbers of two Vector3; (6,), unit and frame of the message."""
    return np.array([linear.x, linear.y, linear.z, angular.x, angular.y, angular.z])


@functools.lru_cache
def joint_indices(joints: tuple[str, ...], names: tuple[str, ...]) -> list[int]:
    """Return the index of each joint among the names of a JointState.

    Raises:
        InputError: where a joint is missing or named twice.
    """
    for joint in joints:
        if names.count(joint) != 1:
            what = f"joint state: joint {joint}"
            expected = f"each of {list(joints)} once, all in one message"
            raise InputError(what, got=f"names {list(names)}", expected=expected)
    return [names.index(joint) for joint in joints]


def joint_sample(message: JointState, joints: tuple[str, ...]) -> JointSample:
    """Return positions, velocities and efforts of the joints; those left out: velocities NaN, efforts zero.

    Raises:
        InputError: wrong names, or arrays shorter than the names.
    """
    stamp_ns, index, count = stamp_of(message), joint_indices(joints, tuple(message.name)), len(message.name)
    if len(message.position) != count or len(message.velocity) not in (0, count):
        raise InputError(
            "joint state",
            got=f"{count} names, {len(message.position)} positions, {len(message.velocity)} velocities",
            expected="one position per name, and one velocity or none at all",
        )
    position, velocity, effort = map(np.array, (message.position, message.velocity, message.effort))
    return JointSample(
        stamp_ns,
        position[index],
        velocity[index] if len(velocity) else np.full(len(joints), np.nan),
        effort[index] if len(effort) == count else np.zeros(len(joints)),
    )


def joint_command(message: JointState, joints: tuple[str, ...], interface: CommandInterface) -> JointCommand:
    """Return what one interface of the joints is commanded; no number at all means "no command for this stamp".

    Raises:
        InputError: wrong names, or not one number per name.
    """
    index, numbers = joint_indices(joints, tuple(message.name)), np.array(getattr(message, interface))
    if len(numbers) not in (0, len(message.name)):
        got = f"{len(message.name)} names, {len(numbers)} numbers"
        raise InputError(f"{interface} command", got=got, expected="one number per name")
    return JointCommand(stamp_of(message), numbers[index] if len(numbers) else numbers, interface)


def stamp_of(message: JointState | WrenchStamped | TwistStamped | PoseStamped) -> int:
    """Return the stamp of a message [ns].

    Raises:
        InputError: nanoseconds of a second or more, which could not be sent back.
    """
    stamp = message.header.stamp
    if stamp.nanosec >= NS_PER_S:
        got = f"{stamp.nanosec} nanoseconds"
        raise InputError("stamp", got=got, expected="less than a second of them")
    return stamp_to_ns(stamp)


def check_frame(message: WrenchStamped | TwistStamped | PoseStamped, frame: str, fix: str = TURN) -> None:
    """Check the frame of a stamped message, if it names one; fix: what to do about another.

    Raises:
        InputError: another frame, which cannot be transformed here.
    """
    if message.header.frame_id not in ("", frame):
        raise InputError("frame_id", got=message.header.frame_id, expected=frame, fix=fix)


def wrench_sample(message: WrenchStamped, frame: str) -> WrenchSample:
    """Return a wrench in the axes of `frame`; raises as `check_frame` and `stamp_of` do."""
    check_frame(message, frame, "set wrench.frame, where that is a link of the URDF")
    return WrenchSample(stamp_of(message), vector6(message.wrench.force, message.wrench.torque))


def slip_velocity(message: TwistStamped, frame: str) -> SlipSample:
    """Return a slip velocity in the axes of `frame`, invalid where any number is not finite.

    Raises as `check_frame` and `stamp_of` do.
    """
    check_frame(message, frame)
    twist = vector6(message.twist.linear, message.twist.angular)
    return SlipSample(stamp_of(message), twist, valid=bool(np.isfinite(twist).all()))


def slip_displacement(message: PoseStamped, frame: str) -> DisplacementSample:
    """Return a slip displacement in the axes of `frame`, invalid if not finite or if its quaternion has no length.

    Raises as `check_frame` and `stamp_of` do.
    """
    check_frame(message, frame)
    place, turn = message.pose.position, message.pose.orientation
    pose = np.array([place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w])
    valid = bool(np.isfinite(pose).all() and np.linalg.norm(pose[3:]) > LEAST_NORM)
    return DisplacementSample(stamp_of(message), pose, valid)


def slip_flags(message: JointState) -> SlipSample:
    """Return the flags in the position field of a JointState as a slip sample: all ones where any is up, else zeros.

    What is not known (NaN) is not "no slip": where nothing else is known, or no flag is there, the sample is invalid.

    Raises:
        InputError: not one per name; or the stamp is refused by `stamp_of`.
    """
    if len(message.position) != len(message.name):
        got = f"{len(message.name)} names, {len(message.position)} positions"
        raise InputError("slip flag", got=got, expected="one position per name: 1 slips, 0 holds, NaN unknown")
    known = [flag for flag in message.position if np.isfinite(flag)]
    slips = any(flag > FLAG_UP for flag in known)
    return SlipSample(stamp_of(message), np.full(6, float(slips)), valid=len(known) > 0)


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
        stamp_ns=stamp_to_ns(message.header.stamp),
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
