"""What the field of a tactile pad says as a whole: the planar rigid motion, or load, that fits its points best.

One input for every sensor: points on the pad, and at each point a displacement or a force along the pad. Taxels of a
XELA uSkin and pillars of a PapillArray give forces; the markers of a gel that a camera sees give displacements. A rigid
field is v_i = v + w e_z x (p_i - c): three numbers, fitted by iteratively reweighted least squares (Huber 1964), so
that single dead, stuck or edge points do not turn it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slip_core.arrays import Array
from slip_core.errors import InputError

HUBER = 1.345  # residuals beyond this many deviations count less: 95 % efficiency with normal noise
MAD_TO_DEVIATION = 1.4826
ITERATIONS = 30
TOLERANCE = 1e-10


class PlanarTwist(NamedTuple):
    """The rigid field that fits best; its unit is that of the field, [unit] below."""

    linear: Array
    """At the centroid of the points that were used; (2,) [unit]."""
    angular: float
    """About the pad's normal, counterclockwise [unit/m]: rad where the field is a displacement in m."""
    centre: Array
    """The centroid; (2,) [m]."""
    weights: Array
    """How much each point counted, 0 to 1; (n,)."""
    residual: float
    """Root mean square of what is left, weighted [unit]: large where the field is not rigid, as in partial slip."""


def planar_twist(points: Array, field: Array) -> PlanarTwist:
    """Fit a planar rigid field robustly.

    Args:
        points: places on the pad (n, 2) [m].
        field: displacement, velocity or force along the pad at each point (n, 2) [unit]. Rows that are not finite are
            left out.

    Raises:
        InputError: the shapes differ, or fewer than two points that are not at one place are left.
    """
    points, field = np.asarray(points, dtype=np.float64), np.asarray(field, dtype=np.float64)
    if points.ndim != 2 or points.shape[1:] != (2,) or field.shape != points.shape:
        raise InputError("tactile field", got=f"{field.shape} at {points.shape}", expected="(n, 2) at (n, 2)")
    usable = np.isfinite(points).all(axis=1) & np.isfinite(field).all(axis=1)
    if usable.sum() < 2 or not np.ptp(points[usable], axis=0).any():
        raise InputError("tactile field", got=f"{usable.sum()} usable points", expected="two or more, apart")
    p, f = points[usable], field[usable]
    weights = np.ones(len(p))
    centre, linear, angular = _least_squares(p, f, weights)
    for _ in range(ITERATIONS):
        error = np.hypot(*_left(p, f, centre, linear, angular).T)
        deviation = MAD_TO_DEVIATION * np.median(error)
        if deviation <= TOLERANCE * np.abs(f).max():
            weights = (error <= deviation + TOLERANCE * np.abs(f).max()).astype(np.float64)
        else:
            weights = np.minimum(1.0, HUBER * deviation / np.maximum(error, 1e-300))
        before = np.array([*linear, angular])
        centre, linear, angular = _least_squares(p, f, weights)
        if np.abs(np.array([*linear, angular]) - before).max() <= TOLERANCE * (1.0 + np.abs(before).max()):
            break
    left = _left(p, f, centre, linear, angular)
    every = np.zeros(len(points))
    every[usable] = weights
    return PlanarTwist(linear, angular, centre, every, float(np.sqrt(weights @ (left**2).sum(axis=1) / weights.sum())))


def _least_squares(p: Array, f: Array, weights: Array) -> tuple[Array, Array, float]:
    """Return centroid, field there and rotation of weighted least squares: they decouple about the centroid."""
    share = weights / weights.sum()
    centre, linear = share @ p, share @ f
    arm, rest = p - centre, f - linear
    spread = share @ (arm**2).sum(axis=1)
    turning = share @ (arm[:, 0] * rest[:, 1] - arm[:, 1] * rest[:, 0])
    return centre, linear, float(turning / spread) if spread > 0.0 else 0.0


def _left(p: Array, f: Array, centre: Array, linear: Array, angular: float) -> Array:
    """Return what the rigid field does not explain; (n, 2)."""
    arm = p - centre
    return f - linear - angular * np.stack([-arm[:, 1], arm[:, 0]], axis=1)
