"""Soft walls: torques that keep joints from their stops and limit speeds, before the output gate."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slip_core.arrays import Array, readonly
from slip_vic_controller.core.arm import ArmModel
from slip_vic_controller.core.guard_kernel import BRAKE_ANGULAR, BRAKE_LINEAR, BRAKED_FROM
from slip_vic_controller.core.safety_params import LimitParams

PAD_BRAKE = np.repeat((BRAKE_LINEAR, BRAKE_ANGULAR), 3)  # [N s/m], [N m s/rad]
PAD_BRAKE.setflags(write=False)
TRIP = 4.0 / 3.0  # of the pad's speed limits


class Walls(NamedTuple):
    """Where the walls stand.

    near_lower, near_upper (n,) [rad]: the joints' stops less the margin [rad]; velocity, brake_from, trip (n,) [rad/s];
    effort (n,) [N m]; speed: linear [m/s] and angular [rad/s] speed limit of the pad.
    """

    near_lower: Array
    near_upper: Array
    margin: float
    velocity: Array
    brake_from: Array
    trip: Array
    effort: Array
    speed: tuple[float, float]


def make_walls(arm: ArmModel, params: LimitParams) -> Walls:
    """Return the walls of an arm: the URDF's limits and the parameters.

    Implements: ours: limits come from one place.
    """
    velocity = arm.velocity_limit * params.velocity_scale
    return Walls(
        arm.position_lower + params.position_margin,
        arm.position_upper - params.position_margin,
        params.position_margin,
        velocity,
        velocity * params.velocity_brake,
        velocity * params.velocity_trip,
        arm.effort_limit,
        (params.speed_linear, params.speed_angular),
    )


def pack_walls(walls: Walls) -> tuple[Array, Array]:
    """Return the walls as `guard_kernel` takes them: one row per kind, and margin and speed limits of the pad.

    Implements: ours: packed once.
    """
    rows = (walls.near_lower, walls.near_upper, walls.brake_from, walls.velocity, walls.trip, walls.effort)
    return readonly(rows), readonly((walls.margin, *walls.speed))


def joint_repulsion(walls: Walls, q: Array, qd: Array) -> Array | None:
    """Return the torque away from the stops and against too high velocities; (n,) [rad], [rad/s] -> (n,) [N m].

    None where no wall is touched, which is nearly always. Grows from zero with the square of the depth, to the full
    effort at the stop, and in proportion from the braking velocity on, to the full effort at the velocity limit.

    Implements: ours: continuous, bounded by the effort limits, no gains to tune.
    """
    speed = np.abs(qd)
    if not np.count_nonzero((q < walls.near_lower) | (q > walls.near_upper) | (speed > walls.brake_from)):
        return None
    low, high = _share((walls.near_lower - q) / walls.margin), _share((q - walls.near_upper) / walls.margin)
    brake = _share((speed - walls.brake_from) / (walls.velocity - walls.brake_from))
    return np.asarray(walls.effort * (low * low - high * high - np.sign(qd) * brake))


def pad_brake(walls: Walls, J: Array, twist: Array) -> Array | None:
    """Return the torque that brakes a pad near its speed limits; J (6, n), twist (6,) [m/s, rad/s] {w} -> (n,) [N m].

    None below three quarters of the limits.

    Implements: ours: a Cartesian damper on what is too fast.
    """
    force = None
    for half, limit in ((slice(0, 3), walls.speed[0]), (slice(3, 6), walls.speed[1])):
        v = twist[half]
        speed = math.sqrt(v.dot(v))
        if speed > BRAKED_FROM * limit:
            force = np.zeros(6) if force is None else force
            force[half] = -PAD_BRAKE[half] * v * (1.0 - BRAKED_FROM * limit / speed)
    return None if force is None else J.T.dot(force)


def too_fast(walls: Walls, names: tuple[str, ...], qd: Array, twist: Array | None) -> str:
    """Return which joint or pad speed is beyond what braking should have allowed; (n,) [rad/s], (6,) {w}.

    Implements: ours: a control loop that runs away ends here.
    """
    over = np.abs(qd) > walls.trip
    if np.count_nonzero(over):
        i = int(over.argmax())
        return f"{names[i]} turns at {abs(qd[i]):.1f} rad/s, the limit is {walls.velocity[i]:.1f}"
    if twist is not None:
        for half, limit, unit in ((twist[:3], walls.speed[0], "m/s"), (twist[3:], walls.speed[1], "rad/s")):
            speed = math.sqrt(half.dot(half))
            if speed > TRIP * limit:
                return f"the pad moves at {speed:.1f} {unit}, the limit is {limit:.1f}"
    return ""


def _share(x: Array) -> Array:
    return np.minimum(np.maximum(x, 0.0), 1.0)
