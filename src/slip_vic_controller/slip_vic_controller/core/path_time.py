"""Time along the path: slower near the edge of what the arm can follow, at rest where slip is not known."""

from __future__ import annotations

import math
from typing import NamedTuple

from slip_core.arrays import Array
from slip_core.types import CartesianReference
from slip_vic_controller.core.guard_kernel import MOVING


class PathTime(NamedTuple):
    """scale: speed along the path, 1 = as planned; rate: its rate of change [1/s]."""

    scale: float
    rate: float


FULL = PathTime(1.0, 0.0)


def advance_path_time(state: PathTime, wanted: float, dt: float, slow_down_s: float) -> PathTime:
    """Move the scale towards `wanted`, at most from 1 to 0 in `slow_down_s`; dt [s].

    Implements: ours: the reference brakes in a known time, and never jumps.
    """
    if wanted == state.scale:
        return PathTime(wanted, 0.0)
    step = dt / slow_down_s
    scale = min(max(wanted, state.scale - step), state.scale + step)
    return PathTime(scale, (scale - state.scale) / dt if dt > 0.0 else 0.0)


def scale_for_error(linear: float, angular: float, bound_linear: float, bound_angular: float) -> float:
    """Return how fast the path may run at these errors [m], [rad]: 1 up to half the bounds, 0 at the bounds.

    Implements: ours: the reference waits for the arm.
    """
    worst = max(linear / bound_linear, angular / bound_angular)
    return 1.0 if worst <= 0.5 else max(0.0, 2.0 - 2.0 * worst)


def scaled(reference: CartesianReference, time: PathTime) -> CartesianReference:
    """Return the reference of a path that is run through at another speed.

    Implements: ours: chain rule, twist sigma v, acceleration sigma^2 a + sigma_dot v.
    """
    return CartesianReference(
        reference.position,
        reference.rotation,
        time.scale * reference.twist,
        time.scale**2 * reference.acceleration + time.rate * reference.twist,
    )


def lost_ns(time: PathTime, dt_ns: int) -> int:
    """Return by how much the start of the trajectory moves later in a tick of dt_ns [ns]; 0 at full speed, exactly.

    Implements: ours: whole nanoseconds, so that full speed leaves the trajectory's clock alone.
    """
    return 0 if time.scale == 1.0 else round((1.0 - time.scale) * dt_ns)


def moving(twist: Array, slowest: float = MOVING) -> bool:
    """Return whether a reference's twist (6,) asks for motion: above `slowest` [m/s] or [rad/s].

    Implements: ours: an arm that should move and whose joint values stay equal to the last bit is not measured.
    """
    return math.sqrt(twist.dot(twist)) > slowest
