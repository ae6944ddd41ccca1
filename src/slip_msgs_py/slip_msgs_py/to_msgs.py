"""Value objects to stock ROS messages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Twist, TwistStamped, Vector3, Wrench, WrenchStamped
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header, Int64MultiArray, String

from slip_msgs_py.arrays import Array, quat_xyzw_from_matrix, rotate6
from slip_msgs_py.stamps import split_ns
from slip_msgs_py.types import EffortCommand, JointSample, ObjectTruth, SlipSample, WrenchSample

WORLD = "world"
OBJECT = "object"
SLIP_AXES = ("s_x", "s_y", "s_z", "s_rx", "s_ry", "s_rz")


def time_msg(stamp_ns: int) -> Time:
    """Return the stamp as a message."""
    sec, nanosec = split_ns(stamp_ns)
    return Time(sec=sec, nanosec=nanosec)


def header(stamp_ns: int, frame_id: str) -> Header:
    """Return a header."""
    return Header(stamp=time_msg(stamp_ns), frame_id=frame_id)


def joint_state(sample: JointSample, names: Sequence[str]) -> JointState:
    """Return the joint state with its names; [rad, rad/s, N m]."""
    return JointState(
        header=header(sample.stamp_ns, ""),
        name=list(names),
        position=sample.position.tolist(),
        velocity=sample.velocity.tolist(),
        effort=sample.effort.tolist(),
    )


def effort_state(command: EffortCommand, answered: JointSample, names: Sequence[str]) -> JointState:
    """Return the command with the positions and velocities it answers, so that viewers draw the robot right."""
    return JointState(
        header=header(command.stamp_ns, ""),
        name=list(names),
        position=answered.position.tolist(),
        velocity=answered.velocity.tolist(),
        effort=command.effort.tolist(),
    )


def wrench_stamped(sample: WrenchSample, frame_id: str) -> WrenchStamped:
    """Return the wrench; (6,) [N, N m] in the axes of `frame_id`."""
    return six_as_wrench(sample.wrench, sample.stamp_ns, frame_id)


def six_as_wrench(six: Array, stamp_ns: int, frame_id: str) -> WrenchStamped:
    """Return any six numbers (translation, rotation) with the named axes of a wrench."""
    return WrenchStamped(
        header=header(stamp_ns, frame_id), wrench=Wrench(force=vector3(six[:3]), torque=vector3(six[3:]))
    )


def twist_stamped(twist: Array, stamp_ns: int, frame_id: str) -> TwistStamped:
    """Return a twist; (6,) [m/s, rad/s] in the axes of `frame_id`."""
    return TwistStamped(
        header=header(stamp_ns, frame_id), twist=Twist(linear=vector3(twist[:3]), angular=vector3(twist[3:]))
    )


def slip_stamped(sample: SlipSample, frame_id: str) -> TwistStamped:
    """Return the slip velocity, NaN where the sample is invalid."""
    twist = sample.twist if sample.valid else sample.twist * float("nan")
    return twist_stamped(twist, sample.stamp_ns, frame_id)


def pose_stamped(position: Array, rotation: Array, stamp_ns: int, frame_id: str = WORLD) -> PoseStamped:
    """Return a pose; (3,) [m], (3, 3) in `frame_id`."""
    return PoseStamped(header=header(stamp_ns, frame_id), pose=pose(position, rotation))


def odometry(truth: ObjectTruth) -> Odometry:
    """Return the object's pose in `world` and its twist in object axes, as nav_msgs/Odometry defines it."""
    message = Odometry(header=header(truth.stamp_ns, WORLD), child_frame_id=OBJECT)
    message.pose.pose = pose(truth.position, truth.rotation)
    twist = rotate6(truth.rotation.T, truth.twist)
    message.twist.twist = Twist(linear=vector3(twist[:3]), angular=vector3(twist[3:]))
    return message


def slip_truth(truth: ObjectTruth) -> JointState:
    """Return slip displacement and velocity as six named scalars; [m, rad], [m/s, rad/s]."""
    return JointState(
        header=header(truth.stamp_ns, ""),
        name=list(SLIP_AXES),
        position=truth.slip_displacement.tolist(),
        velocity=truth.slip_velocity.tolist(),
    )


def scalars(values: Mapping[str, float], stamp_ns: int) -> JointState:
    """Return named scalars in the position field of a JointState, which plotting tools show by name."""
    return JointState(header=header(stamp_ns, ""), name=list(values), position=[float(v) for v in values.values()])


def clock(stamp_ns: int) -> Clock:
    """Return simulation time."""
    return Clock(clock=time_msg(stamp_ns))


def int64_array(values: Sequence[int]) -> Int64MultiArray:
    """Return whole numbers without layout."""
    return Int64MultiArray(data=[int(v) for v in values])


def float64_array(values: Array) -> Float64MultiArray:
    """Return numbers without layout."""
    return Float64MultiArray(data=values.tolist())


def string(text: str) -> String:
    """Return a text."""
    return String(data=text)


def diagnostics(stamp_ns: int, name: str, level: int, message: str, values: Mapping[str, object]) -> DiagnosticArray:
    """Return one diagnostic status; level 0 OK, 1 WARN, 2 ERROR, 3 STALE."""
    status = DiagnosticStatus(
        level=bytes([level]),
        name=name,
        message=message,
        hardware_id="slip_vic",
        values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
    )
    return DiagnosticArray(header=header(stamp_ns, ""), status=[status])


def vector3(values: Any) -> Vector3:
    """Return three numbers."""
    x, y, z = values.tolist()
    return Vector3(x=x, y=y, z=z)


def pose(position: Array, rotation: Array) -> Pose:
    """Return a pose from (3,) [m] and (3, 3)."""
    x, y, z = position.tolist()
    qx, qy, qz, qw = quat_xyzw_from_matrix(rotation).tolist()
    return Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw))
