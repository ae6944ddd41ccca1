"""The step on the path: an ordered list of named intervals of sddot, of which the largest common value is taken.

Each limit is one function that returns an interval. They apply in the order of `Limit`. A limit without a common value
with those before it is not met: the nearest value is used, and the first such limit is published.
"""

from __future__ import annotations

import math
from enum import IntEnum, unique
from typing import Final, NamedTuple

from slip_core.compiled import part
from slip_core.vectors import Mat, Spatial, Vec
from slip_vic_controller.contact.friction_estimate import Friction
from slip_vic_controller.governor.layouts import LENGTH, PATH_MARGIN, Governor, GovernorConfig
from slip_vic_controller.governor.load import Held, drawn, size, turning, weight
from slip_vic_controller.governor.plan import Along, Governing, left_for_motion, range_of_u

MORE_THAN_WEIGHT: Final = 1.0 + 1e-6
"""Of what the weight alone needs: enough to follow the path slowly."""
OVER: Final = 1.1
"""sdot^2 over K beyond which an overrun is reported, ..."""
SLOWEST: Final = 2e-2
"""... if this speed of the pad or more is too much [m/s]."""


@unique
class Limit(IntEnum):
    """Limits of sddot, in the order in which they apply."""

    NONE = 0
    PATH = 1
    LOAD = 2
    RESERVE = 3
    CATCH_UP = 4
    SPEED = 5


class Interval(NamedTuple):
    """Admissible values of sddot; met: whether there are any, else both are the nearest one."""

    low: float
    high: float
    met: bool


class Pad(NamedTuple):
    """The pad {w}: x, as seen from a point of the path [m]; attitude R; twist v; feedback: a_C - a_d, last cycle."""

    x: Vec
    R: Mat
    v: Spatial
    feedback: Spatial


class Bounds(NamedTuple):
    """Bounds of a step: K here, K and its slope at the next point; largest sdot that other limits admit.

    most_led: largest sdot while a slipping object leads; first, last: between which values of s it may.
    """

    K: float
    K_ahead: float
    slope: float
    most_rate: float
    most_led: float
    first: float
    last: float


class PathLoad(NamedTuple):
    """Load on pad axes [N], affine in sddot: l = per_u u + rest.

    rest: with the impedance's feedback; planned: without it; full: without it, at the user's own speed; weight: |l_c|.
    """

    per_u: Spatial
    rest: Spatial
    planned: Spatial
    full: Spatial
    weight: float


@part
def path_load(rate: float, held: Held, point: Along, pad: Pad) -> PathLoad:
    """Return the load of following the path at sdot = rate from a point of it."""
    R, l_c = pad.R, weight(held, pad.R)
    l_0 = turning(held, R, pad.v.angular) + l_c
    curve = drawn(held, R, point.curve)
    planned = (rate * rate) * curve + l_0
    rest = planned + drawn(held, R, pad.feedback)
    return PathLoad(drawn(held, R, point.tangent), rest, planned, curve + l_0, size(l_c))


# -- the limits


@part
def at_most(high: float) -> Interval:
    """Return the interval of all values that are not larger."""
    return Interval(-math.inf, high, True)


@part
def carried(per_u: Spatial, rest: Spatial, F: float) -> Interval:
    """Return the sddot with |per_u u + rest| <= F [N]; if there is none, the one with the least load."""
    uu, ub = per_u.dot(per_u), per_u.dot(rest)
    low, high, met = range_of_u(uu, ub, rest.dot(rest), F)
    if not met:
        low = high = -ub / uu if uu > 0.0 else 0.0
    return Interval(low, high, met)


@part
def of_reserve(config: GovernorConfig, state: Governor, load: PathLoad) -> Interval:
    """Without feedback the path leaves the reserve; braking may use it."""
    if config.reserve == 0.0:
        return at_most(math.inf)
    F = left_for_motion(state.usable, load.weight, config.reserve)
    return at_most(carried(load.per_u, load.planned, F).high)


@part
def of_catching_up(config: GovernorConfig, state: Governor, load: PathLoad) -> Interval:
    """Catching up uses no more load than the path as planned, or than has been carried.

    If the weight alone is more than that, this limit does not apply.
    """
    certified = config.most_grip * state.contact.carried
    if config.mode != Governing.SLOW_DOWN or load.weight >= certified:
        return at_most(math.inf)
    F = max(certified + config.most_grip * config.friction.probe, size(load.full))
    found = carried(load.per_u, load.rest, F)
    return at_most(max(found.high, 0.0) if found.met else 0.0)


@part
def to_bound(K: float, slope: float, rate: float, most_rate: float, dt: float) -> float:
    """Return the sddot that leads to sdot^2 = K, or to another limit of sdot, within a period dt [s]; slope: dK/ds."""
    m = 0.5 * slope * dt
    d = 0.25 * m * m + K - m * rate
    fastest = max(0.5 * m + math.sqrt(d), 0.0) if d > 0.0 else 0.0
    return (min(fastest, most_rate) - rate) / dt


# -- the step


@part
def step_on(
    config: GovernorConfig, state: Governor, bounds: Bounds, held: Held, point: Along, pad: Pad, dt: float
) -> float:
    """Return sddot of this cycle, and write what limits the path.

    Args:
        config, state: GOVERNOR_CONFIG, GOVERNOR.
        bounds: of the step.
        held: object on pad axes.
        point: the path at state.time, from `along`.
        pad: as seen from that point.
        dt: control period [s].
    """
    rate, load = state.rate, path_load(state.rate, held, point, pad)
    speed_up = to_bound(bounds.K_ahead, bounds.slope, rate, bounds.most_rate, dt)
    limits = (
        # not backwards, nor faster where sdot is above its bound already: there the guard decides
        Interval(-rate / dt, max(speed_up, 0.0), True),
        carried(load.per_u, load.rest, state.usable),
        of_reserve(config, state, load),
        of_catching_up(config, state, load),
        at_most(speed_up),
    )
    low, high, unmet = -math.inf, math.inf, 0
    for i in range(len(limits)):
        limit = limits[i]
        if unmet == 0 and not (limit.met and limit.low <= high and low <= limit.high):
            unmet = i + 1
        low, high = min(max(limit.low, low), high), max(min(limit.high, high), low)
    state.limit = unmet
    if (rate * rate - OVER * bounds.K_ahead) * pace(config, point) > SLOWEST * SLOWEST:
        state.overrun = 1
    return high


@part
def pace(config: GovernorConfig, point: Along) -> float:
    """Return the square of the pad's speed over sdot, with rotation as a length."""
    p, w = point.tangent.linear, LENGTH * point.tangent.angular
    return p.dot(p) + w.dot(w)


@part
def carried_weight(config: GovernorConfig, state: Governor, F: float, weight_load: float) -> float:
    """Return a load [N], at least what the weight needs [N], up to the friction at the start."""
    needed = MORE_THAN_WEIGHT * weight_load / PATH_MARGIN
    return float(max(F, min(needed, config.margin * state.contact.first)))


@part
def with_weight(config: GovernorConfig, state: Governor, F: float) -> float:
    """Return a load [N], at least what the weight alone needs on the path if that is to be tried.

    During the motion it is best to continue slowly: a stop may throw a weakly held object, and the weight acts at
    rest too. With unknown friction the grip is tested by loading it, up to the configured limit.
    """
    if state.planned == 0 and config.friction.friction != Friction.UNKNOWN:
        return F
    return carried_weight(config, state, F, state.weight_load)
