"""The forms of the messages this suite sends each tick: a typed maker, and the numbers in it that vary."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slip_msgs_py.messages import to_msgs


@dataclass(frozen=True, slots=True)
class Form:
    """One form of message.

    make: (stamp_ns, *numbers) -> typed message, one array of numbers per field.
    fields, sizes: paths of the numbers, and how many each usually has.
    stamp: path of the stamp; empty where the message has none.
    whole: whether the numbers are int64 instead of float64.
    """

    make: Callable[..., Any]
    fields: tuple[str, ...]
    sizes: tuple[int, ...]
    stamp: str = "header.stamp"
    whole: bool = False

    def zeros(self, sizes: tuple[int, ...] | None = None) -> list[NDArray[Any]]:
        """Return zeros for every field, of its usual size or of the sizes given."""
        kind = np.int64 if self.whole else np.float64
        return [np.zeros(size, kind) for size in (self.sizes if sizes is None else sizes)]


def joint_state(names: Sequence[str]) -> Form:
    """Positions, velocities and efforts of named joints; (n,) [rad], [rad/s], [N m]."""
    fields = ("position", "velocity", "effort")
    return Form(lambda stamp_ns, *arrays: to_msgs.joint_state(stamp_ns, names, *arrays), fields, (len(names),) * 3)


def slip_truth() -> Form:
    """Slip displacement and velocity as six named scalars; (6,) [m, rad], [m/s, rad/s]."""
    return Form(
        lambda stamp_ns, *arrays: to_msgs.joint_state(stamp_ns, to_msgs.SLIP_AXES, *arrays),
        ("position", "velocity"),
        (6, 6),
    )


def scalars(names: Sequence[str]) -> Form:
    """Named scalars in the position field of a JointState, which plotting tools show by name."""
    return Form(lambda stamp_ns, values: to_msgs.joint_state(stamp_ns, names, values), ("position",), (len(names),))


def wrench(frame_id: str) -> Form:
    """Six numbers with the named axes of a wrench; (6,) in the axes of `frame_id`."""
    return Form(lambda stamp_ns, six: to_msgs.wrench_stamped(stamp_ns, six, frame_id), ("wrench",), (6,))


def twist(frame_id: str) -> Form:
    """A twist; (6,) [m/s, rad/s] in the axes of `frame_id`."""
    return Form(lambda stamp_ns, six: to_msgs.twist_stamped(stamp_ns, six, frame_id), ("twist",), (6,))


def pose(frame_id: str = to_msgs.WORLD) -> Form:
    """A pose as position and quaternion x y z w; (7,) in `frame_id`."""
    return Form(lambda stamp_ns, seven: to_msgs.pose_stamped(stamp_ns, seven, frame_id), ("pose",), (7,))


def flag() -> Form:
    """One flag of slip, 1, 0 or NaN; (1,)."""
    return scalars(("slip",))


def odometry() -> Form:
    """The object's pose (7,) in `world` and twist (6,) in its own axes."""
    return Form(to_msgs.odometry, ("pose.pose", "twist.twist"), (7, 6))


def clock() -> Form:
    """Simulation time."""
    return Form(to_msgs.clock, (), (), stamp="clock")


def whole_numbers(count: int) -> Form:
    """Whole numbers without stamp."""
    return Form(lambda _, values: to_msgs.int64_array(values), ("data",), (count,), stamp="", whole=True)


def number() -> Form:
    """One number without stamp."""
    return Form(lambda _, values: to_msgs.float64(values[0]), ("data",), (1,), stamp="")


def numbers(count: int) -> Form:
    """Numbers without stamp."""
    return Form(lambda _, values: to_msgs.float64_array(values), ("data",), (count,), stamp="")
