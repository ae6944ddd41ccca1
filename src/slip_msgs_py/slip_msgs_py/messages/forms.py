"""The messages that this suite sends each tick, each described once: its type, what is constant in it, what varies."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, Final

from slip_core.stamps import split_ns
from slip_core.topics import WORLD
from slip_core.types import CommandInterface
from slip_msgs_py.messages.cdr import put_numbers
from slip_msgs_py.qos import message_class

OBJECT: Final = "object"
SLIP_AXES: Final = ("s_x", "s_y", "s_z", "s_rx", "s_ry", "s_rz")


@dataclass(frozen=True, slots=True)
class Form:
    """One form of message.

    type_name: ``pkg/msg/Type``.
    fields, sizes: paths of the numbers that vary, and how many each usually has.
    constants: by path, what is the same in all of them.
    stamp: path of the stamp; empty where the message has none.
    """

    type_name: str
    fields: tuple[str, ...]
    sizes: tuple[int, ...]
    constants: Mapping[str, Any]
    stamp: str = "header.stamp"

    def message(self, stamp_ns: int, *numbers: Iterable[Any]) -> Any:
        """Return the typed message; one array of numbers per field."""
        message: Any = message_class(self.type_name)()
        for path, value in self.constants.items():
            owner, _, name = path.rpartition(".")
            setattr(attrgetter(owner)(message) if owner else message, name, value)
        if self.stamp:
            put_numbers(message, self.stamp, split_ns(stamp_ns))
        for path, values in zip(self.fields, numbers, strict=True):
            put_numbers(message, path, values)
        return message


def joint_state(names: Sequence[str]) -> Form:
    """Positions, velocities and efforts of named joints; (n,) [rad], [rad/s], [N m]."""
    fields = ("position", "velocity", "effort")
    return Form("sensor_msgs/msg/JointState", fields, (len(names),) * 3, {"name": list(names)})


def joint_command(names: Sequence[str], interface: CommandInterface) -> Form:
    """Positions, velocities or efforts that named joints are commanded, and nothing else; (n,)."""
    return Form("sensor_msgs/msg/JointState", (interface,), (len(names),), {"name": list(names)})


def slip_truth() -> Form:
    """Slip displacement and velocity as six named scalars; (6,) [m, rad], [m/s, rad/s]."""
    return Form("sensor_msgs/msg/JointState", ("position", "velocity"), (6, 6), {"name": list(SLIP_AXES)})


def scalars(names: Sequence[str]) -> Form:
    """Named scalars in the position field of a JointState, which plotting tools show by name."""
    return Form("sensor_msgs/msg/JointState", ("position",), (len(names),), {"name": list(names)})


def wrench(frame_id: str) -> Form:
    """Six numbers with the named axes of a wrench; (6,) in the axes of `frame_id`."""
    return Form("geometry_msgs/msg/WrenchStamped", ("wrench",), (6,), {"header.frame_id": frame_id})


def twist(frame_id: str) -> Form:
    """A twist; (6,) [m/s, rad/s] in the axes of `frame_id`."""
    return Form("geometry_msgs/msg/TwistStamped", ("twist",), (6,), {"header.frame_id": frame_id})


def pose(frame_id: str = WORLD) -> Form:
    """A pose as position and quaternion x y z w; (7,) in `frame_id`."""
    return Form("geometry_msgs/msg/PoseStamped", ("pose",), (7,), {"header.frame_id": frame_id})


def odometry() -> Form:
    """The object's pose (7,) in `world` and twist (6,) in its own axes, as nav_msgs/Odometry defines it."""
    frames = {"header.frame_id": WORLD, "child_frame_id": OBJECT}
    return Form("nav_msgs/msg/Odometry", ("pose.pose", "twist.twist"), (7, 6), frames)


def clock() -> Form:
    """Simulation time."""
    return Form("rosgraph_msgs/msg/Clock", (), (), {}, stamp="clock")


def whole_numbers(count: int) -> Form:
    """Whole numbers without stamp."""
    return Form("std_msgs/msg/Int64MultiArray", ("data",), (count,), {}, stamp="")


def number() -> Form:
    """One number without stamp."""
    return Form("std_msgs/msg/Float64", ("data",), (1,), {}, stamp="")


def numbers(count: int) -> Form:
    """Numbers without stamp."""
    return Form("std_msgs/msg/Float64MultiArray", ("data",), (count,), {}, stamp="")
