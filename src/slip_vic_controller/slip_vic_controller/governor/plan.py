"""The plan: sampled points of the path with their load on the contact and their largest speed.

On a path x_d(s) with x = sdot^2 and u = sddot the load is l = l_u u + l_x x + l_c. The backward pass needs only the
scalar products of these three vectors, so a point keeps those. The parameter s is the user's own time where the path is
only slowed down; for time-optimal motion it is a length, ds = sqrt(|v|^2 + L^2 |w|^2 + floor^2) dt. The floor lets s
advance where the path reverses; it vanishes towards the ends like the speed of a path that starts without acceleration,
so there s is a length.

The backward pass finds at every point the largest sdot^2 from which the rest of the path can be followed:

    K_i = max { x <= cap : there is a u with |l_u u + l_x x + l_c| <= F and 0 <= x + 2 D u <= K_(i+1) }

This is a convex problem in two variables. Its maximum lies at the velocity cap, at the edge of the ellipse, or on the
ellipse at one of the two lines; the largest admissible one is taken, or bisection decides if rounding rejects all.
"""

from __future__ import annotations

import math
from enum import IntEnum, unique
from typing import Final, NamedTuple

from slip_core.compiled import part
from slip_core.records import Real, Record, Records, dtype_of
from slip_core.vectors import Mat, Spatial
from slip_vic_controller.governor.layouts import FLOOR, LENGTH, GovernorConfig
from slip_vic_controller.governor.load import Held, drawn, turning, weight
from slip_vic_controller.path.paths import Reference
from slip_vic_controller.sizes import BISECTIONS

GRID_POINTS: Final = 200
FASTEST: Final = 1e3
"""Largest sdot of a point without limits."""
ROUNDING: Final = 1e-10
"""Relative error of a root."""
REST: Final = 1e-12
"""uu over F^2 below which u costs no load: there the path rests."""


@unique
class Governing(IntEnum):
    """How the governor changes the timing of the path."""

    OFF = 0
    SLOW_DOWN = 1
    TIME_OPTIMAL = 2


class GridPoint(Record):
    """A point of the path; uu = l_u . l_u, ux = l_u . l_x and so on: products of the parts of its load."""

    time: Real  # s, of the user's path
    s: Real
    speed: Real  # ds/dt
    bend: Real  # its rate
    uu: Real
    ux: Real
    uc: Real
    xx: Real
    xc: Real
    cc: Real  # N^2
    cap: Real  # largest sdot^2 for velocity limits
    K: Real  # largest sdot^2 from which the rest of the path can be run


GRID_POINT = dtype_of(GridPoint)


class Along(NamedTuple):
    """A point of the path over s {w}: attitude, first and second derivative; ds/dt of the user's time and its rate."""

    rotation: Mat
    tangent: Spatial
    curve: Spatial
    speed: float
    bend: float


@part
def sample_time(mode: int, i: int, duration: float) -> float:
    """Return the user's time of point i [s].

    Over a length, the ends are sampled a little inside the path, where it has a direction.
    """
    inside = INSIDE if mode == Governing.TIME_OPTIMAL else 0.0
    return duration * min(max(float(i), inside), GRID_POINTS - 1.0 - inside) / (GRID_POINTS - 1.0)


INSIDE: Final = 0.2
"""How far inside, in cells: the path has covered 1e-8 of its way there."""


@part
def along(config: GovernorConfig, duration: float, time: float, planned: Reference) -> Along:
    """Return a point of the path over s from its reference over the user's time [s]."""
    if config.mode != Governing.TIME_OPTIMAL:
        return along_at(planned, 1.0, 0.0)
    inside = sample_time(config.mode, 0, duration) / duration
    share = min(max(time / duration, inside), 1.0 - inside)
    c = 4.0 * share * (1.0 - share)
    floor, floor_rate = FLOOR * c * c, FLOOR * 8.0 * c * (1.0 - 2.0 * share) / duration
    v, w = planned.twist.linear, LENGTH * planned.twist.angular
    a, alpha = planned.acceleration.linear, LENGTH * planned.acceleration.angular
    speed = math.sqrt(v.dot(v) + w.dot(w) + floor * floor)
    bend = (v.dot(a) + w.dot(alpha) + floor * floor_rate) / speed
    return along_at(planned, speed, bend)


@part
def along_at(planned: Reference, speed: float, bend: float) -> Along:
    """Return a point of a path over s, from its reference over the user's time, where ds/dt and its rate are known."""
    curve = (1.0 / (speed * speed)) * (planned.acceleration - (bend / speed) * planned.twist)
    return Along(planned.rotation, (1.0 / speed) * planned.twist, curve, speed, bend)


@part
def take_point(
    points: Records[GridPoint], i: int, time: float, at: Along, held: Held, limits: tuple[float, float, float]
) -> None:
    """Write point i; the points before it are known.

    Args:
        points: of the grid of a path, or of a stream.
        i: index.
        time: of the user's path [s].
        at: the path there.
        held: object on pad axes.
        limits: largest sdot, and of the pad's twist [m/s], [rad/s].
    """
    most_rate, most_speed, most_turning = limits
    point = points[i]
    point.time, point.speed, point.bend = time, at.speed, at.bend
    point.s = 0.0
    if i > 0:
        before = points[i - 1]
        h = time - before.time
        point.s = before.s + 0.5 * h * (before.speed + at.speed) + h * h / 12.0 * (before.bend - at.bend)
    l_u = drawn(held, at.rotation, at.tangent)
    l_x = drawn(held, at.rotation, at.curve) + turning(held, at.rotation, at.tangent.angular)
    l_c = weight(held, at.rotation)
    point.uu, point.ux, point.uc = l_u.dot(l_u), l_u.dot(l_x), l_u.dot(l_c)
    point.xx, point.xc, point.cc = l_x.dot(l_x), l_x.dot(l_c), l_c.dot(l_c)
    moves, turns = most_speed, most_turning
    fastest = min(most_rate, ratio(moves, at.tangent.linear.norm()), ratio(turns, at.tangent.angular.norm()))
    point.cap = fastest * fastest


@part
def ratio(most: float, speed: float) -> float:
    """Return most / speed, not more than the largest sdot."""
    return most / speed if most < FASTEST * speed else FASTEST


@part
def cell(points: Records[GridPoint], s: float) -> int:
    """Return the point before s: i with s_i <= s < s_(i+1), held to the path."""
    low, high = 0, len(points) - 1
    while high - low > 1:
        middle = (low + high) // 2
        if points[middle].s <= s:
            low = middle
        else:
            high = middle
    return low


@part
def path_time(points: Records[GridPoint], s: float) -> float:
    """Return the user's time [s] at s: the inverse of the cubic between two points."""
    i = cell(points, s)
    a, b = points[i], points[i + 1]
    h, way = b.time - a.time, b.s - a.s
    if s <= a.s or way <= 0.0:
        return float(a.time)
    if s >= b.s:
        return float(b.time)
    first, last = h * a.speed, h * b.speed
    second, third = 3.0 * way - 2.0 * first - last, first + last - 2.0 * way
    t = (s - a.s) / way
    low, high = 0.0, 1.0
    for _ in range(BISECTIONS):
        error = ((third * t + second) * t + first) * t - (s - a.s)
        if error > 0.0:
            high = t
        else:
            low = t
        slope = (3.0 * third * t + 2.0 * second) * t + first
        step = error / slope if slope > 0.0 else 2.0
        t = t - step if low <= t - step <= high else 0.5 * (low + high)
        if abs(step) < ROUNDING:
            break
    return float(a.time + t * h)


@part
def bound(points: Records[GridPoint], s: float) -> tuple[float, float]:
    """Return K and its slope dK/ds at s; between points K is linear, as x is under a constant u."""
    i = cell(points, s)
    a, b = points[i], points[i + 1]
    way = b.s - a.s
    if way <= 0.0:
        return float(a.K), 0.0
    slope = (b.K - a.K) / way
    return float(a.K + slope * min(max(s - a.s, 0.0), way)), float(slope)


# -- backward pass


@part
def range_of_u(uu: float, ub: float, bb: float, F: float) -> tuple[float, float, bool]:
    """Return lowest and highest u with |l_u u + b| <= F, and whether there is any.

    Args:
        uu, ub, bb: l_u . l_u, l_u . b, b . b.
        F: [N].
    """
    c = bb - F * F
    if uu <= REST * F * F:
        return -math.inf, math.inf, c <= 0.0
    d = ub * ub - uu * c
    if d < 0.0:
        return 0.0, 0.0, False
    root = math.sqrt(d)
    return (-ub - root) / uu, (-ub + root) / uu, True


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
    if at_rest(point, F):
        return larger_root(point.xx, point.xc, c)
    a = point.uu * point.xx - point.ux * point.ux
    return larger_root(a, point.uu * point.xc - point.ux * point.uc, point.uu * c - point.uc * point.uc)


@part
def most(point: GridPoint, F: float, way: float, after: float) -> float:
    """Return K of a point; -1 where friction does not carry the weight there.

    Args:
        point: GRID_POINT.
        F: load that may be used [N].
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
        x = (1.0 - ROUNDING) * candidate
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
    """Return the load that a motion may use: F minus a fraction of what remains after the weight; all in N."""
    return F - reserve * max(F - weight, 0.0)


@part
def backward_pass(points: Records[GridPoint], F: float, reserve: float) -> None:
    """Write K of every point before the last, 0 if friction does not carry the weight.

    Args:
        points: of a path or of a stream; K of the last is known.
        F: load that may be used [N].
        reserve: unused fraction of what remains after the weight.
    """
    last = len(points) - 1
    for k in range(last):
        point, after = points[last - 1 - k], points[last - k]
        left = left_for_motion(F, math.sqrt(point.cc), reserve)
        point.K = max(most(point, left, after.s - point.s, after.K), 0.0)
