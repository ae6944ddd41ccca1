"""Value objects to messages: the forms that are sent each tick, each described once, and typed messages."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, Final

import numpy as np
from builtin_interfaces.msg import Duration, Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped, TransformStamped, TwistStamped, WrenchStamped
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray, Header, Int64MultiArray, String
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from slip_core import poses
from slip_core.arrays import Array, readonly
from slip_core.stamps import seconds_to_ns, split_ns
from slip_core.topics import WORLD
from slip_core.types import SlipSample

_INVALID = readonly(np.full(6, np.nan))


@dataclass(frozen=True, slots=True)
class Form:
    """One form of message.

    template: a typed message with what is the same in all of them.
    fields: paths of the numbers that vary.
    stamp: path of the stamp; empty where the message has none.
    dtype: of the numbers, float64 or int64.
    """

    template: Any
    fields: tuple[str, ...]
    stamp: str = "header.stamp"
    dtype: str = "<f8"

    def message(self, stamp_ns: int, *numbers: Iterable[Any]) -> Any:
        """Return the typed message; one array of numbers per field."""
        message = deepcopy(self.template)
        if self.stamp:
            put_numbers(message, self.stamp, split_ns(stamp_ns))
        for path, values in zip(self.fields, numbers, strict=True):
            put_numbers(message, path, values)
        return message


def put_numbers(message: object, path: str, values: Iterable[Any]) -> None:
    """Write numbers to `path` of a typed message, in the order of its fields; a sequence takes all that are left."""
    owner, _, name = path.rpartition(".")
    _put(attrgetter(owner)(message) if owner else message, name, iter(values))


def _put(owner: Any, name: str, values: Iterator[Any]) -> None:
    old = getattr(owner, name)
    if hasattr(old, "get_fields_and_field_types"):
        for field in old.get_fields_and_field_types():
            _put(old, field, values)
    elif isinstance(old, int | float):
        setattr(owner, name, type(old)(next(values)))
    else:
        setattr(owner, name, array(old.typecode, values))


def joint_state(names: Sequence[str], *fields: str) -> Form:
    """Positions [rad], velocities [rad/s] and efforts [N m] of named joints, (n,) each; fields: those of them alone."""
    return Form(JointState(name=list(names)), fields or ("position", "velocity", "effort"))


def wrench(frame_id: str) -> Form:
    """Six numbers with the named axes of a wrench; (6,) in the axes of `frame_id`."""
    return Form(WrenchStamped(header=Header(frame_id=frame_id)), ("wrench",))


def twist(frame_id: str) -> Form:
    """A twist; (6,) [m/s, rad/s] in the axes of `frame_id`."""
    return Form(TwistStamped(header=Header(frame_id=frame_id)), ("twist",))


def pose(frame_id: str = WORLD) -> Form:
    """A pose as position and quaternion x y z w; (7,) in `frame_id`."""
    return Form(PoseStamped(header=Header(frame_id=frame_id)), ("pose",))


ODOMETRY: Final = Form(Odometry(header=Header(frame_id=WORLD), child_frame_id="object"), ("pose.pose", "twist.twist"))
"""The object's pose (7,) in `world` and twist (6,) in its own axes, as nav_msgs/Odometry defines it."""
CLOCK: Final = Form(Clock(), (), stamp="clock")
"""Simulation time."""
NUMBER: Final = Form(Float64(), ("data",), stamp="")
NUMBERS: Final = Form(Float64MultiArray(), ("data",), stamp="")
WHOLE_NUMBERS: Final = Form(Int64MultiArray(), ("data",), stamp="", dtype="<i8")
"""Without stamp."""


def header(stamp_ns: int, frame_id: str) -> Header:
    """Return a header."""
    sec, nanosec = split_ns(stamp_ns)
    return Header(stamp=Time(sec=sec, nanosec=nanosec), frame_id=frame_id)


def string(text: str) -> String:
    """Return a text."""
    return String(data=text)


def diagnostics(
    stamp_ns: int, name: str, level: bytes, message: str, values: Mapping[str, object], hardware_id: str
) -> DiagnosticArray:
    """Return one diagnostic status; level: of DiagnosticStatus; hardware_id: robot and arm."""
    status = DiagnosticStatus(
        level=level,
        name=name,
        message=message,
        hardware_id=hardware_id,
        values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
    )
    return DiagnosticArray(header=header(stamp_ns, ""), status=[status])


def goal(position: Array, rotation: Array, duration_s: float) -> MultiDOFJointTrajectory:
    """Return a goal at rest for {ee} in {w} as the one point of a trajectory; (3,) [m], (3, 3), [s]."""
    place, (sec, nanosec) = TransformStamped(), split_ns(seconds_to_ns(duration_s))
    put_numbers(place, "transform", pose_numbers(position, rotation))
    after = Duration(sec=sec, nanosec=nanosec)
    point = MultiDOFJointTrajectoryPoint(transforms=[place.transform], time_from_start=after)
    return MultiDOFJointTrajectory(header=Header(frame_id=WORLD), points=[point])


def slip_numbers(sample: SlipSample) -> Array:
    """Return the slip velocity (6,) [m/s, rad/s], NaN where the sample is invalid."""
    return sample.twist if sample.valid else _INVALID


def pose_numbers(position: Array, rotation: Array) -> Array:
    """Return position and quaternion x y z w; (3,) [m], (3, 3) -> (7,)."""
    numbers = np.empty(7)
    poses.pose(position, np.ascontiguousarray(rotation), numbers)
    return numbers


def odometry_numbers(position: Array, rotation: Array, twist: Array) -> tuple[Array, Array]:
    """Return a body's pose (7,), and its twist on its own axes (6,); (3,) [m], (3, 3), (6,) [m/s, rad/s] {w}."""
    numbers = np.empty(13)
    poses.odometry(position, np.ascontiguousarray(rotation), twist, numbers)
    return numbers[:7], numbers[7:]
