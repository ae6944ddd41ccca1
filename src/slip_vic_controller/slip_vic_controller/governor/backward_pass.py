"""The backward pass: at every point of the path the largest sdot^2 from which the rest of it can be run.

    K_i = max { x <= cap : there is a u with |l_u u + l_x x + l_c| <= F and 0 <= x + 2 D u <= K_(i+1) }

A convex problem of two variables. Its maximum is where the velocity cap, the edge of the ellipse, or the ellipse on one
of the two lines is; the largest admissible one of these is taken, and where rounding refuses all, bisection decides.
"""

from __future__ import annotations

import math
from typing import Final

from slip_core.compiled import part
from slip_vic_controller.governor.path_grid import GridPoint, PathGrid

INSIDE: Final = 1.0 - 1e-10
"""Share of a root that is tried, so that rounding does not put it outside."""
MOST_U: Final = 1e9
NEGLIGIBLE: Final = 1e-20
"""uu below which u costs no load; [N^2] over the square of u's unit."""
BISECTIONS: Final = 60
REST: Final = 1e-12
"""uu over F^2 below which the path rests."""


@part
def range_of_u(uu: float, ub: float, bb: float, F: float) -> tuple[float, float, bool]:
    """Return lowest and highest u with |l_u u + b| <= F, and whether there is any.

    Args:
        uu, ub, bb: l_u . l_u, l_u . b, b . b.
        F: [N].
    """
    c = bb - F * F
    if uu <= NEGLIGIBLE:
        return -MOST_U, MOST_U, c <= 0.0
    d = ub * ub - uu * c
    if d < 0.0:
        return 0.0, 0.0, False
    root = math.sqrt(d)
    return max((-ub - root) / uu, -MOST_U), min((-ub + root) / uu, MOST_U), True


@part
def admissible(point: GridPoint, x: float, F: float, twice: float, after: float) -> bool:
    """Return whether the path can be run from this point at sdot^2 = x; twice: 2 D; after: K of the next point."""
    low, high, any_u = range_of_u(
        point.uu, point.ux * x + point.uc, (point.xx * x + 2.0 * point.xc) * x + point.cc, F
    )  # fmt: skip
    return any_u and max(low, -x / twice) <= min(high, (after - x) / twice)


@part
def larger_root(a: float, b: float, c: float) -> float:
    """Return the larger x with a x^2 + 2 b x + c = 0, a >= 0; -1 where there is none."""
    d = b * b - a * c
    if a <= 0.0 or d < 0.0:
        return -1.0
    root = math.sqrt(d)
    return -c / (b + root) if b > 0.0 else (root - b) / a


@part
def on_line(point: GridPoint, F: float, twice: float, after: float) -> float:
    """Return the largest x of the ellipse on the line x + 2 D u = after."""
    k, m = after / twice, -1.0 / twice
    a = point.uu * m * m + 2.0 * point.ux * m + point.xx
    b = point.uu * k * m + m * point.uc + k * point.ux + point.xc
    return larger_root(a, b, point.uu * k * k + 2.0 * k * point.uc + point.cc - F * F)


@part
def edge(point: GridPoint, F: float) -> float:
    """Return the largest x of the ellipse, whatever u."""
    c = point.cc - F * F
    if point.uu <= NEGLIGIBLE:
        return larger_root(point.xx, point.xc, c)
    a = point.uu * point.xx - point.ux * point.ux
    return larger_root(a, point.uu * point.xc - point.ux * point.uc, point.uu * c - point.uc * point.uc)


@part
def most(point: GridPoint, F: float, way: float, after: float) -> float:
    """Return K of a point; -1 where friction does not carry the weight there.

    Args:
        point: GRID_POINT.
        F: load that may be asked [N].
        way: D = s_(i+1) - s_i.
        after: K of the next point.
    """
    if point.cc > F * F:
        return -1.0
    twice = 2.0 * max(way, 1e-12)
    if admissible(point, point.cap, F, twice, after):
        return float(point.cap)
    best = 0.0
    for candidate in (edge(point, F), on_line(point, F, twice, after), on_line(point, F, twice, 0.0)):
        x = INSIDE * candidate
        if best < x <= point.cap and admissible(point, x, F, twice, after):
            best = x
    if best > 0.0:
        return best
    low, high = 0.0, float(point.cap)
    for _ in range(BISECTIONS):
        x = 0.5 * (low + high)
        if admissible(point, x, F, twice, after):
            low = x
        else:
            high = x
    return low


@part
def at_rest(point: GridPoint, F: float) -> bool:
    """Return whether the user's path rests at a point, so that sdot is free there: u costs no load."""
    return bool(point.uu <= REST * F * F)


@part
def left_for_motion(F: float, weight: float, reserve: float) -> float:
    """Return the load that a motion may ask: F less a share of what the weight leaves of it; all in N."""
    return F - reserve * max(F - weight, 0.0)


@part
def step_back(grid: PathGrid, i: int, F: float, reserve: float, free_end: bool) -> float:
    """Write K_next of point i from that of point i + 1; return it, -1 where the weight is too much.

    Args:
        grid: PATH_GRID.
        i: index, counted down from the last.
        F: load that may be asked [N].
        reserve: share of what the weight leaves of it that is not used.
        free_end: whether sdot need not be 0 at the end of a path that itself ends at rest.
    """
    point, last = grid.points[i], len(grid.points) - 1
    F = left_for_motion(F, math.sqrt(point.cc), reserve)
    if i == last:
        K = point.cap if free_end and at_rest(point, F) else 0.0
        K = -1.0 if point.cc > F * F else K
    else:
        after = grid.points[i + 1]
        K = most(point, F, after.s - point.s, after.K_next)
    point.K_next = max(K, 0.0)
    return float(K)
