"""Poses and odometry as the numbers of their messages."""

from __future__ import annotations

import math

from slip_core.arrays import Array
from slip_core.compiled import IN1, IN2, OUT1, VOID, kernel, part
from slip_core.vectors import Mat, mat, put, quaternion, vec


@part
def put_unit_quaternion(out: Array, R: Mat) -> None:
    """Write a rotation matrix as unit quaternion x y z w, w >= 0; (4,)."""
    v, w = quaternion(R)
    size = math.sqrt(v.x * v.x + v.y * v.y + v.z * v.z + w * w)
    out[0], out[1], out[2], out[3] = v.x / size, v.y / size, v.z / size, w / size


@kernel(VOID, IN1, IN2, OUT1)
def pose(position: Array, rotation: Array, out: Array) -> None:
    """Write position and quaternion x y z w; (3,) [m], (3, 3) -> (7,)."""
    put(out, vec(position))
    put_unit_quaternion(out[3:], mat(rotation))


@kernel(VOID, IN1, IN2, IN1, OUT1)
def odometry(position: Array, rotation: Array, twist: Array, out: Array) -> None:
    """Write position, quaternion x y z w, and the twist turned to the body's axes; (3,), (3, 3), (6,) {w} -> (13,)."""
    R = mat(rotation)
    put(out, vec(position))
    put_unit_quaternion(out[3:], R)
    put(out[7:], R.T() @ vec(twist))
    put(out[10:], R.T() @ vec(twist[3:]))
