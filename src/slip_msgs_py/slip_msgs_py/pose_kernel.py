"""Poses and odometry as the numbers of their messages, compiled; plain forms: `quat_xyzw_from_matrix` and `rotate6`."""

from __future__ import annotations

import math

from slip_msgs_py.arrays import Array
from slip_msgs_py.compiled import IN1, IN2, OUT1, VOID, kernel, part


@part
def quaternion(R: Array) -> tuple[float, float, float, float]:
    """Return `quat_xyzw_from_matrix`: Shepperd's choice of the largest element, w >= 0."""
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    k, largest = 3, trace
    for i in range(2, -1, -1):  # of equal elements the first counts
        if R[i, i] >= largest:
            k, largest = i, R[i, i]
    if k == 3:
        x, y, z, w = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], 1.0 + trace
    elif k == 0:
        x, y, z, w = 1.0 + 2.0 * R[0, 0] - trace, R[1, 0] + R[0, 1], R[2, 0] + R[0, 2], R[2, 1] - R[1, 2]
    elif k == 1:
        x, y, z, w = R[1, 0] + R[0, 1], 1.0 + 2.0 * R[1, 1] - trace, R[2, 1] + R[1, 2], R[0, 2] - R[2, 0]
    else:
        x, y, z, w = R[2, 0] + R[0, 2], R[2, 1] + R[1, 2], 1.0 + 2.0 * R[2, 2] - trace, R[1, 0] - R[0, 1]
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    if not w / norm >= 0.0:
        norm = -norm
    return x / norm, y / norm, z / norm, w / norm


@kernel(VOID(IN1, IN2, OUT1))
def pose(position: Array, rotation: Array, out: Array) -> None:
    """Write position and quaternion x y z w; (3,) [m], (3, 3) -> (7,).

    Implements: ours: `quat_xyzw_from_matrix` behind the position.
    """
    for i in range(3):
        out[i] = position[i]
    out[3], out[4], out[5], out[6] = quaternion(rotation)


@kernel(VOID(IN1, IN2, IN1, OUT1))
def odometry(position: Array, rotation: Array, twist: Array, out: Array) -> None:
    """Write position, quaternion x y z w, and the twist turned to the body's axes; (3,), (3, 3), (6,) {w} -> (13,).

    Implements: ours: `quat_xyzw_from_matrix`, and `rotate6` by the transpose.
    """
    for i in range(3):
        out[i] = position[i]
        out[7 + i] = rotation[0, i] * twist[0] + rotation[1, i] * twist[1] + rotation[2, i] * twist[2]
        out[10 + i] = rotation[0, i] * twist[3] + rotation[1, i] * twist[4] + rotation[2, i] * twist[5]
    out[3], out[4], out[5], out[6] = quaternion(rotation)
