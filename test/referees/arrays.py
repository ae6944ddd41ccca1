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
