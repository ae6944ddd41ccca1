"""Small array helpers shared by the maths and the physics; nothing here uses ROS."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slip_core.errors import InputError

Array = NDArray[np.float64]


def readonly(values: ArrayLike) -> Array:
    """Return a read-only float64 copy of `values`; any shape, unit and frame are kept."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def vector(values: ArrayLike, size: int, what: str) -> Array:
    """Return `values` as a read-only vector; (size,), unit and frame of the caller.

    Raises:
        InputError: where the shape is not (size,) or an element is not finite.
    """
    try:
        array = readonly(values)
    except (TypeError, ValueError):
        raise InputError(what, got=values, expected=f"{size} numbers") from None
    if array.shape != (size,):
        raise InputError(what, got=f"{array.size} numbers", expected=f"{size} numbers")
    if not np.isfinite(array).all():
        raise InputError(what, got=array.tolist(), expected="finite numbers")
    return array


def matrix_from_quat_xyzw(quat_xyzw: ArrayLike) -> Array:
    """Return the rotation matrix of a quaternion (x, y, z, w), normalised first; (4,) -> (3, 3).

    Raises:
        InputError: where the quaternion is not finite or its norm is below 1e-6.
    """
    q = vector(quat_xyzw, 4, "quaternion (x, y, z, w)")
    x, y, z, w = q.tolist()
    norm = math.sqrt(x * x + y * y + z * z + w * w)  # of `@` the last bit depends on the processor
    if norm < 1e-6:
        raise InputError("quaternion (x, y, z, w)", got=q.tolist(), expected="a norm of 1")
    x, y, z, w = (q / norm).tolist()
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def inertia_from_six(six: Sequence[float], what: str = "inertia") -> Array:
    """Return the symmetric inertia matrix of (ixx, iyy, izz, ixy, ixz, iyz); (6,) [kg m2] -> (3, 3).

    Raises:
        InputError: where the matrix is not positive definite or breaks the triangle inequality.
    """
    ixx, iyy, izz, ixy, ixz, iyz = vector(six, 6, what)
    matrix = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
    principal = np.linalg.eigvalsh(matrix)
    if principal[0] <= 0.0 or principal[0] + principal[1] < principal[2] * (1.0 - 1e-9):
        raise InputError(
            what,
            got=f"principal moments {principal.tolist()}",
            expected="positive principal moments, each at most the sum of the other two",
        )
    return matrix
