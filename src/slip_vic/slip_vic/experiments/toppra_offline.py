"""Planning: the fastest timing of the path that friction as configured admits, made before the run."""

from __future__ import annotations

import importlib
from typing import Any, ClassVar

import numpy as np
from scipy.spatial import ConvexHull

from slip_core.arrays import Array
from slip_core.errors import require_extra
from slip_core.types import PadMotion
from slip_vic.experiments.law import Seen, Setup
from slip_vic.experiments.schools import PLAN_POINTS, MotionLaw, planned_load, timed

FACETS = 200
"""Of the polytope inside of the limit surface."""
ENDS = (1.0, 0.5, 0.2, 0.05)
"""Rates at the end that are tried; the path is at rest there, whatever its rate."""


class ToppraOffline(MotionLaw):
    """TOPP-RA over the path's own time s: load(s, s', s'') within a polytope inside of the limit surface.

    The timing is never faster than the path as given, so that arrivals can be compared. Where friction cannot carry the
    path at any timing, the path is run as it is.

    Source: H. Pham, Q.-C. Pham, A new approach to time-optimal path parameterization based on reachability analysis,
    IEEE T-RO 34 (2018) 645-659; library toppra. Ours: margin 0.9 of the friction limit.
    """

    margin: ClassVar[float] = 0.9

    def reset(self, setup: Setup) -> None:
        """Plan."""
        super().reset(setup)
        path = np.linspace(0.0, setup.duration_s, PLAN_POINTS)
        rates = timing(setup, path, self.margin * setup.friction_limit)
        squares = np.ones_like(path) if rates is None else rates**2
        self._path, self._slopes = path, np.diff(squares) / (2.0 * np.diff(path))
        mean = 0.5 * (np.sqrt(squares[1:]) + np.sqrt(squares[:-1]))
        self._rates = np.sqrt(squares)
        self._times = np.concatenate(([0.0], np.cumsum(np.diff(path) / np.maximum(mean, 1e-9))))

    def wanted(self, seen: Seen) -> PadMotion:
        """Return where the timing is: between two points s'' is constant."""
        if seen.time >= self._times[-1]:
            return timed(self.setup, self._path[-1], 0.0, 0.0)
        k = int(np.searchsorted(self._times, seen.time, side="right")) - 1
        slope, since = float(self._slopes[k]), seen.time - float(self._times[k])
        rate = max(float(self._rates[k]) + slope * since, 0.0)
        at = float(self._path[k]) + (float(self._rates[k]) + 0.5 * slope * since) * since
        return timed(self.setup, at, rate, slope)


def timing(setup: Setup, path: Array, limit: float) -> Array | None:
    """Return the rate s' at times of the path (m,) [s]; None where friction carries it at no timing.

    Raises:
        InputError: toppra is not installed.
    """
    require_extra("toppra", "law toppra_offline", "benchmark")
    toppra: Any
    toppra, algorithm, constraint = map(importlib.import_module, ("toppra", "toppra.algorithm", "toppra.constraint"))
    toppra.setup_logging("CRITICAL")
    loads = np.array([[planned_load(setup, timed(setup, t, *pair)) for pair in ((0, 0), (0, 1), (1, 0))] for t in path])
    rest = loads[:, 0]
    facets = ConvexHull(sphere(FACETS)).equations

    def linear(*rows: Array) -> Any:
        """Return the constraint F (a s'' + b s'^2 + c) <= g; rows: a, b, c at the points of the path, F, g."""
        found = constraint.LinearConstraint()
        found.dof, found.identical = 1, True
        found.compute_constraint_params = lambda *_: (*rows, None, None)
        return found

    surface = linear(loads[:, 1] - rest, loads[:, 2] - rest, rest, facets[:, :3], -limit * facets[:, 3])
    none = np.zeros((len(path), 1))
    given = linear(none, none + 1.0, none - 1.0, np.ones((1, 1)), np.zeros(1))
    line = toppra.SplineInterpolator(np.array([0.0, path[-1]]), np.array([[0.0], [path[-1]]]))
    solver = algorithm.TOPPRA([surface, given], line, gridpoints=path, solver_wrapper="seidel")
    for last in ENDS:
        sets = solver.compute_controllable_sets(last, last)
        if np.isfinite(sets).all() and sets[0, 1] >= 0.0:
            _, rates, _ = solver.compute_parameterization(float(np.sqrt(sets[0, 1])) * (1.0 - 1e-6), last)
            if rates is not None and np.isfinite(rates).all():
                return np.array(rates)
    return None


def sphere(count: int) -> Array:
    """Return points that are spread evenly over the unit sphere; (count, 3)."""
    k = np.arange(count)
    z, turn = 1 - (2 * k + 1) / count, np.pi * (1 + np.sqrt(5)) * k
    return np.column_stack((np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z))
