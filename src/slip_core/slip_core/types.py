"""The value objects that travel between bridge, controller, bags and tests.

All are frozen and their arrays read-only. Stamps are integer nanoseconds of the run's clock; a stamp is
the time of measurement. 6-vectors are linear part first.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, NamedTuple, TypeVar, dataclass_transform, get_args

from slip_core.arrays import Array, readonly

T = TypeVar("T")
AXES: Final = ("x", "y", "z", "rx", "ry", "rz")
"""Names of the coordinates of a 6-vector."""


@dataclass_transform(frozen_default=True)
def sample(declared: type[T]) -> type[T]:
    """Make a frozen dataclass with slots, whose arrays are `readonly`."""
    arrays = tuple(name for name, kind in declared.__annotations__.items() if kind == "Array")

    def freeze(self: T) -> None:
        for name in arrays:
            object.__setattr__(self, name, readonly(getattr(self, name)))

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


class PadMotion(NamedTuple):
    """The pad at one time {w}: position (3,) [m], rotation (3, 3), twist (6,) and acceleration (6,), linear first."""

    position: Array
    rotation: Array
    twist: Array
    acceleration: Array


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


@dataclass(frozen=True, slots=True)
class Incident:
    """What makes a run one that went wrong, although no program failed: when, in its own time [s]; one line of text.

    kind: lost, the object left the pads; fault, the controller gave up; unreachable, the path cannot be followed;
    saturated, the arm cannot do what is asked.
    """

    kind: str
    time_s: float
    text: str

    def __str__(self) -> str:
        return f"{self.kind.upper()} at {self.time_s:.3f} s: {self.text}"
