"""The value objects that travel between bridge, controller, bags and tests.

All are frozen and their arrays read-only. Stamps are integer nanoseconds of the run's clock; a stamp is
the time of measurement. 6-vectors are linear part first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slip_msgs_py.arrays import Array, readonly


def _freeze(instance: object, *names: str) -> None:
    for name in names:
        value = getattr(instance, name)
        if not (isinstance(value, np.ndarray) and value.dtype == np.float64 and not value.flags.writeable):
            object.__setattr__(instance, name, readonly(value))


@dataclass(frozen=True, slots=True)
class JointSample:
    """Joint state in the controller's joint order; (n,) [rad], (n,) [rad/s], (n,) [N m]."""

    stamp_ns: int
    position: Array
    velocity: Array
    effort: Array

    def __post_init__(self) -> None:
        _freeze(self, "position", "velocity", "effort")


@dataclass(frozen=True, slots=True)
class WrenchSample:
    """Wrench h_ee of the object on the robot at the pad centre; (6,) [N, N m] {ee} axes."""

    stamp_ns: int
    wrench: Array

    def __post_init__(self) -> None:
        _freeze(self, "wrench")


@dataclass(frozen=True, slots=True)
class SlipSample:
    """Slip velocity v_s of the pad relative to the object's material under it; (6,) [m/s, rad/s] {ee} axes.

    An invalid sample (`valid` False) is published as NaN, so that it can never look like "no slip".
    """

    stamp_ns: int
    twist: Array
    valid: bool = True

    def __post_init__(self) -> None:
        _freeze(self, "twist")


@dataclass(frozen=True, slots=True)
class CartesianReference:
    """Desired motion of {ee}: position (3,) [m], rotation (3, 3), twist (6,), acceleration (6,), all {w}."""

    position: Array
    rotation: Array
    twist: Array
    acceleration: Array

    def __post_init__(self) -> None:
        _freeze(self, "position", "rotation", "twist", "acceleration")


@dataclass(frozen=True, slots=True)
class EffortCommand:
    """Joint effort answering the joint state of the same stamp; (n,) [N m]."""

    stamp_ns: int
    effort: Array

    def __post_init__(self) -> None:
        _freeze(self, "effort")


@dataclass(frozen=True, slots=True)
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

    def __post_init__(self) -> None:
        _freeze(self, "position", "rotation", "twist", "slip_displacement", "slip_velocity")
