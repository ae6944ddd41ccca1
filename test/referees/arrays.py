"""Plain array forms of what runs compiled."""

from __future__ import annotations

import numpy as np

from slip_core.arrays import Array


def skew(v: Array) -> Array:
    """Return S(v) with S(v) u = v x u; (3,) -> (3, 3), any unit and frame."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def rotate6(R: Array, twist_or_wrench: Array) -> Array:
    """Rotate both halves of a 6-vector by R without moving its point; (3, 3), (6,) -> (6,)."""
    return twist_or_wrench.reshape(2, 3).dot(R.T).reshape(6)


def quat_xyzw_from_matrix(R: Array) -> Array:
    """Return the unit quaternion (x, y, z, w) of a rotation matrix; (3, 3) -> (4,), w >= 0."""
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    candidates = (R[0, 0], R[1, 1], R[2, 2], trace)
    k = max(range(4), key=candidates.__getitem__)
    if k == 3:
        q = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], 1.0 + trace])
    else:
        i, j, m = k, (k + 1) % 3, (k + 2) % 3
        q = np.empty(4)
        q[i] = 1.0 + 2.0 * R[i, i] - trace
        q[j] = R[j, i] + R[i, j]
        q[m] = R[m, i] + R[i, m]
        q[3] = R[m, j] - R[j, m]
    q /= np.sqrt(q @ q)
    return q if q[3] >= 0.0 else -q
