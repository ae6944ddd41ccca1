"""Poses and odometry as the numbers of their messages, compiled; plain forms: `quat_xyzw_from_matrix` and `rotate6`."""

from __future__ import annotations

import math

from slip_core.arrays import Array
from slip_core.compiled import IN1, IN2, OUT1, VOID, kernel, part
from slip_core.vector_kernel import quaternion, rows


@part
def unit_quaternion(rotation: Array) -> tuple[float, float, float, float]:
    """Return `quat_xyzw_from_matrix`."""
    (x, y, z), w = quaternion(rows(rotation))
    size = math.sqrt(x * x + y * y + z * z + w * w)
    return x / size, y / size, z / size, w / size


@kernel(VOID(IN1, IN2, OUT1))
def pose(position: Array, rotation: Array, out: Array) -> None:
    """Write position and quaternion x y z w; (3,) [m], (3, 3) -> (7,).

    Implements: ours: `quat_xyzw_from_matrix` behind the position.
    """
    for i in range(3):
        out[i] = position[i]
    out[3], out[4], out[5], out[6] = unit_quaternion(rotation)


@kernel(VOID(IN1, IN2, IN1, OUT1))
def odometry(position: Array, rotation: Array, twist: Array, out: Array) -> None:
    """Write position, quaternion x y z w, and the twist turned to the body's axes; (3,), (3, 3), (6,) {w} -> (13,).

    Implements: ours: `quat_xyzw_from_matrix`, and `rotate6` by the transpose.
    """
    for i in range(3):
        out[i] = position[i]
        out[7 + i] = rotation[0, i] * twist[0] + rotation[1, i] * twist[1] + rotation[2, i] * twist[2]
        out[10 + i] = rotation[0, i] * twist[3] + rotation[1, i] * twist[4] + rotation[2, i] * twist[5]
    out[3], out[4], out[5], out[6] = unit_quaternion(rotation)
