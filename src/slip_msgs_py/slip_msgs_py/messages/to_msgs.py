"""Value objects to stock ROS messages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import (
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    Transform,
    Twist,
    TwistStamped,
    Vector3,
    Wrench,
    WrenchStamped,
)
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray, Header, Int64MultiArray, String
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from slip_core import poses
from slip_core.arrays import Array, readonly
from slip_core.stamps import split_ns
from slip_core.types import CartesianReference, ObjectTruth, SlipSample

Floats = Array | Sequence[float]
WORLD = "world"
OBJECT = "object"
SLIP_AXES = ("s_x", "s_y", "s_z", "s_rx", "s_ry", "s_rz")
_INVALID = readonly(np.full(6, np.nan))


def time_msg(stamp_ns: int) -> Time:
    """Return the stamp as a message."""
    sec, nanosec = split_ns(stamp_ns)
    return Time(sec=sec, nanosec=nanosec)


def header(stamp_ns: int, frame_id: str) -> Header:
    """Return a header."""
    return Header(stamp=time_msg(stamp_ns), frame_id=frame_id)


def joint_state(
    stamp_ns: int, names: Sequence[str], position: Floats, velocity: Floats = (), effort: Floats = ()
) -> JointState:
    """Return named joints, or any named numbers in the position field; [rad, rad/s, N m] for joints."""
    return JointState(
        header=header(stamp_ns, ""),
        name=list(names),
        position=_floats(position),
        velocity=_floats(velocity),
        effort=_floats(effort),
    )


def wrench_stamped(stamp_ns: int, wrench: Array, frame_id: str) -> WrenchStamped:
    """Return six numbers (translation, rotation) with the named axes of a wrench; (6,) in the axes of `frame_id`."""
    return WrenchStamped(
        header=header(stamp_ns, frame_id), wrench=Wrench(force=vector3(wrench[:3]), torque=vector3(wrench[3:]))
    )


def twist_stamped(stamp_ns: int, twist: Array, frame_id: str) -> TwistStamped:
    """Return a twist; (6,) [m/s, rad/s] in the axes of `frame_id`."""
    return TwistStamped(header=header(stamp_ns, frame_id), twist=twist_msg(twist))


def pose_stamped(stamp_ns: int, numbers: Array, frame_id: str = WORLD) -> PoseStamped:
    """Return a pose from its position and quaternion x y z w; (7,) in `frame_id`."""
    return PoseStamped(header=header(stamp_ns, frame_id), pose=pose(numbers))


def odometry(stamp_ns: int, pose_numbers: Array, twist: Array) -> Odometry:
    """Return the object's pose in `world` (7,) and its twist in object axes (6,), as nav_msgs/Odometry defines it."""
    message = Odometry(header=header(stamp_ns, WORLD), child_frame_id=OBJECT)
    message.pose.pose = pose(pose_numbers)
    message.twist.twist = twist_msg(twist)
    return message


def reference(sample: CartesianReference) -> MultiDOFJointTrajectory:
    """Return a desired motion of {ee} in {w} as the one point of a trajectory."""
    x, y, z, qx, qy, qz, qw = _floats(pose_numbers(sample.position, sample.rotation))
    at = Transform(translation=Vector3(x=x, y=y, z=z), rotation=Quaternion(x=qx, y=qy, z=qz, w=qw))
    motion = {"velocities": [twist_msg(sample.twist)], "accelerations": [twist_msg(sample.acceleration)]}
    point = MultiDOFJointTrajectoryPoint(transforms=[at], **motion)
    return MultiDOFJointTrajectory(header=header(sample.stamp_ns, WORLD), points=[point])


def clock(stamp_ns: int) -> Clock:
    """Return simulation time."""
    return Clock(clock=time_msg(stamp_ns))


def int64_array(values: Sequence[int]) -> Int64MultiArray:
    """Return whole numbers without layout."""
    return Int64MultiArray(data=[int(v) for v in values])


def float64(value: float) -> Float64:
    """Return one number."""
    return Float64(data=float(value))


def float64_array(values: Floats) -> Float64MultiArray:
    """Return numbers without layout."""
    return Float64MultiArray(data=_floats(values))


def string(text: str) -> String:
    """Return a text."""
    return String(data=text)


def diagnostics(
    stamp_ns: int, name: str, level: int, message: str, values: Mapping[str, object], hardware_id: str
) -> DiagnosticArray:
    """Return one diagnostic status; level 0 OK, 1 WARN, 2 ERROR, 3 STALE; hardware_id: robot and arm."""
    status = DiagnosticStatus(
        level=bytes([level]),
        name=name,
        message=message,
        hardware_id=hardware_id,
        values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
    )
    return DiagnosticArray(header=header(stamp_ns, ""), status=[status])


# -- value objects as the numbers of a message --------------------------------------------------------


def slip_numbers(sample: SlipSample) -> Array:
    """Return the slip velocity (6,) [m/s, rad/s], NaN where the sample is invalid."""
    return sample.twist if sample.valid else _INVALID


def flag_numbers(sample: SlipSample) -> Array:
    """Return the flag of a slip sample (1,): 1, 0, or NaN where it is invalid."""
    return slip_numbers(sample)[:1]


def pose_numbers(position: Array, rotation: Array) -> Array:
    """Return position and quaternion x y z w; (3,) [m], (3, 3) -> (7,)."""
    numbers = np.empty(7)
    poses.pose(position, np.ascontiguousarray(rotation), numbers)
    return numbers


def odometry_numbers(truth: ObjectTruth) -> tuple[Array, Array]:
    """Return the object's pose (7,) in `world` and its twist (6,) in object axes."""
    numbers = np.empty(13)
    poses.odometry(truth.position, np.ascontiguousarray(truth.rotation), truth.twist, numbers)
    return numbers[:7], numbers[7:]


# -- parts of messages --------------------------------------------------------------------------------


def vector3(values: Floats) -> Vector3:
    """Return three numbers."""
    x, y, z = _floats(values)
    return Vector3(x=x, y=y, z=z)


def twist_msg(twist: Array) -> Twist:
    """Return a twist from (6,)."""
    return Twist(linear=vector3(twist[:3]), angular=vector3(twist[3:]))


def pose(numbers: Array) -> Pose:
    """Return a pose from position and quaternion x y z w; (7,)."""
    x, y, z, qx, qy, qz, qw = _floats(numbers)
    return Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw))


def _floats(values: Floats) -> list[float]:
    return [float(value) for value in values]
