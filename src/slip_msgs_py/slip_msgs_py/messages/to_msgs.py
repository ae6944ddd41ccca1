"""Value objects to the numbers of a message (`forms`), and to the stock messages that are not sent each tick."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Transform, Twist
from std_msgs.msg import Header, String
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from slip_core import poses
from slip_core.arrays import Array, readonly
from slip_core.stamps import split_ns
from slip_core.topics import WORLD
from slip_core.types import CartesianReference, ObjectTruth, SlipSample
from slip_msgs_py.messages.cdr import put_numbers

_INVALID = readonly(np.full(6, np.nan))


def header(stamp_ns: int, frame_id: str) -> Header:
    """Return a header."""
    sec, nanosec = split_ns(stamp_ns)
    return Header(stamp=Time(sec=sec, nanosec=nanosec), frame_id=frame_id)


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


def reference(sample: CartesianReference) -> MultiDOFJointTrajectory:
    """Return a desired motion of {ee} in {w} as the one point of a trajectory."""
    point = MultiDOFJointTrajectoryPoint(transforms=[Transform()], velocities=[Twist()], accelerations=[Twist()])
    pose = pose_numbers(sample.position, sample.rotation)
    put_numbers(point.transforms[0], "translation", pose[:3])
    put_numbers(point.transforms[0], "rotation", pose[3:])
    for motion, numbers in ((point.velocities[0], sample.twist), (point.accelerations[0], sample.acceleration)):
        put_numbers(motion, "linear", numbers[:3])
        put_numbers(motion, "angular", numbers[3:])
    return MultiDOFJointTrajectory(header=header(sample.stamp_ns, WORLD), points=[point])


def slip_numbers(sample: SlipSample) -> Array:
    """Return the slip velocity (6,) [m/s, rad/s], NaN where the sample is invalid."""
    return sample.twist if sample.valid else _INVALID


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
