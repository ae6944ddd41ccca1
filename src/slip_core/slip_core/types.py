"""The value objects that travel between bridge, controller, bags and tests.

All are frozen and their arrays read-only. Stamps are integer nanoseconds of the run's clock; a stamp is
the time of measurement. 6-vectors are linear part first.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, TypeVar, dataclass_transform, get_args

import numpy as np

from slip_core.arrays import Array, readonly

_FLOAT64 = np.dtype(np.float64)
T = TypeVar("T")
AXES: Final = ("x", "y", "z", "rx", "ry", "rz")
"""Names of the coordinates of a 6-vector."""


def _frozen(values: Array) -> Array:
    """Return a read-only array as it is, and anything else as a read-only copy."""
    if type(values) is np.ndarray and values.dtype is _FLOAT64 and not values.flags.writeable:
        return values
    return readonly(values)


@dataclass_transform(frozen_default=True)
def sample(declared: type[T]) -> type[T]:
    """Make a frozen dataclass with slots, whose constructor takes arrays as `_frozen` does."""
    arrays = tuple(name for name, kind in declared.__annotations__.items() if kind == "Array")

    def freeze(self: T) -> None:
        for name in arrays:
            object.__setattr__(self, name, _frozen(getattr(self, name)))

    declared.__post_init__ = freeze  # type: ignore[attr-defined]
    return dataclass(frozen=True, slots=True)(declared)


@sample
class JointSample:
    """Joint state in the controller's joint order; (n,) [rad], (n,) [rad/s], (n,) [N m]."""

    stamp_ns: int
    position: Array
    velocity: Array
    effort: Array


@sample
class WrenchSample:
    """Wrench h_ee of the object on the robot at the pad centre; (6,) [N, N m] {ee} axes."""

    stamp_ns: int
    wrench: Array


@sample
class SlipSample:
    """Slip velocity v_s of the pad relative to the object's material under it; (6,) [m/s, rad/s] {ee} axes.

    An invalid sample (`valid` False) is published as NaN, so that it can never look like "no slip".
    """

    stamp_ns: int
    twist: Array
    valid: bool = True


@sample
class DisplacementSample:
    """Slip displacement: pose of the pad as seen from where it took the object, on its axes then {p}.

    pose (7,): position [m] and quaternion x y z w. An invalid sample is published as NaN.
    """

    stamp_ns: int
    pose: Array
    valid: bool = True


@sample
class CartesianReference:
    """Desired motion of {ee}: position (3,) [m], rotation (3, 3), twist (6,), acceleration (6,), all {w}.

    stamp_ns: when it shall be there, on any clock that goes as fast as the joint states'; 0 = when it comes.
    """

    position: Array
    rotation: Array
    twist: Array
    acceleration: Array
    stamp_ns: int = 0


@sample
class PoseGoal:
    """Where {ee} shall come to rest: position (3,) [m], rotation (3, 3), {w}; duration [s] that is asked for."""

    position: Array
    rotation: Array
    duration_s: float


CommandInterface = Literal["effort", "velocity", "position"]
INTERFACES: tuple[CommandInterface, ...] = get_args(CommandInterface)


@sample
class JointCommand:
    """Command of the joints answering the joint state of the same stamp; (n,) [N m], [rad/s] or [rad]."""

    stamp_ns: int
    numbers: Array
    interface: CommandInterface = "effort"


@sample
class ObjectTruth:
    """Ground truth of the grasp: object pose and twist {w}, slip s and v_s on pad axes.

    position (3,) [m] of the COM {w}; rotation (3, 3) {o} to {w}; twist (6,) of the COM {w};
    slip_displacement (6,) [m, rad] of {ee} relative to {p} on {p} axes; slip_velocity (6,) {ee} axes.
    """

    stamp_ns: int
    position: Array
    rotation: Array
    twist: Array
    slip_displacement: Array
    slip_velocity: Array
