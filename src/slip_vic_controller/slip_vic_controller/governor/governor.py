"""The reference governor: how fast the path is followed, so that the load stays within what friction carries.

A cycle calls, in this order: `sample_point` for every point of a path without a plan, `run`, the law with `governed` as
reference, and `hold_back` with the law's a_C. All are in place and deterministic: the state is GOVERNOR, PAD and the
points of the path.

The whole path is planned in the cycle in which it begins, and again when the load that it may use has changed by
REPLAN.
"""

from __future__ import annotations

import math
from typing import Final

from slip_core.compiled import part
from slip_core.records import Records
from slip_core.vectors import NOTHING, Spatial, Vec, put_spatial
from slip_vic_controller.contact.belief import start_belief
from slip_vic_controller.contact.estimate import SensorHealth
from slip_vic_controller.contact.friction_estimate import KEPT, start_friction
from slip_vic_controller.contact.slip_health import start_health
from slip_vic_controller.contact.wrench_evidence import start_evidence
from slip_vic_controller.governor.layouts import (
    FLOOR,
    GIVEN_UP,
    LENGTH,
    PATH_MARGIN,
    GovernedPad,
    Governor,
    GovernorConfig,
)
from slip_vic_controller.governor.load import Held
from slip_vic_controller.governor.plan import (
    FASTEST,
    GRID_POINTS,
    Along,
    Governing,
    GridPoint,
    along,
    at_rest,
    backward_pass,
    bound,
    cell,
    left_for_motion,
    path_time,
    sample_time,
    take_point,
)
from slip_vic_controller.governor.step import OVER, SLOWEST, Bounds, Pad, carried_weight, pace, step_on, with_weight
from slip_vic_controller.path.paths import Reference

REPLAN: Final = 5e-3
"""Relative change of the usable load that causes a new plan, and relative accuracy of the least load that stops."""
ARRIVED_SHARE: Final = 1e-6
"""Remaining fraction of the path at which it counts as completed."""
LED_S: Final = 0.2
"""How long a slipping object may lead a path that hardly moves, because trembling pads slip back and forth endlessly,
or one that has to brake [s]."""
BACK: Final = 1e-3
"""Distance to the path below which an overrun ends, if the pad can stop on the path again [m]."""


@part
def start_path(config: GovernorConfig, state: Governor) -> None:
    """Start a path: it has no plan yet. The friction estimate stays."""
    state.s, state.end, state.arrived = 0.0, 0.0, 0
    state.time = sample_time(config.mode, 0, state.duration)
    discard_plan(config, state)


@part
def discard_plan(config: GovernorConfig, state: Governor) -> None:
    """Rest at the current point of the path and replan: object or friction may have changed."""
    state.rate, state.planned, state.asked, state.plan_load = 0.0, 0, 0.0, 0.0
    state.infeasible, state.heaviest_time, state.weight_load = 0, 0.0, 0.0
    state.limit, state.overrun, state.endless, state.led_s = 0, 0, 0, 0.0
    steady(config, state)


@part
def start_pad(config: GovernorConfig, pad: GovernedPad, at_rest: float, weighed: bool, grip: float) -> None:
    """Start with a pad: friction as configured, or as the object at rest shows.

    Args:
        config, pad: GOVERNOR_CONFIG, PAD.
        at_rest: load of the object at rest [N].
        weighed: whether it was measured by a tare rather than configured.
        grip: over the one for which friction is configured.
    """
    rests_with = at_rest / (grip * PATH_MARGIN) if weighed else 0.0
    start_friction(config.friction, pad.contact, pad.friction, at_rest / grip, rests_with)
    start_evidence(pad.evidence)
    start_health(pad.sensor)
    pad.contact.v_s[:], pad.contact.variance[:], pad.contact.age_ns = 0.0, 0.0, 0
    pad.contact.slip_health = SensorHealth.OK.value
    pad.contact.needs = pad.contact.lacks = 0.0
    pad.commanded = pad.measured = at_rest
    pad.contact.F_risk = config.friction.configured
    start_belief(pad.belief, at_rest, grip * config.friction.configured)
    pad.guard, pad.grip = 1.0, grip
    put_spatial(pad.feedback, NOTHING)


@part
def start_governor(config: GovernorConfig, state: Governor, pad: GovernedPad) -> None:
    """Start a path, with the state of a pad."""
    state.duration = config.duration
    start_path(config, state)
    state.contact = pad.contact


@part
def steady(config: GovernorConfig, state: Governor) -> None:
    """Restart the moving average at the current point of the path."""
    for i in range(config.window):
        state.ring[i, 0], state.ring[i, 1], state.ring[i, 2] = state.s, state.rate, 0.0
    state.ring_count = 0
    state.out_s, state.out_rate, state.out_u, state.out_time = state.s, state.rate, 0.0, state.time


# -- planning


@part
def sample_point(
    config: GovernorConfig, state: Governor, grid: Records[GridPoint], i: int, held: Held, planned: Reference
) -> None:
    """Sample point i of a path that has no plan, in order, at its `sample_time`.

    Args:
        config, state, grid: GOVERNOR_CONFIG, GOVERNOR, points of the path.
        i: index, from 0 to GRID_POINTS - 1.
        held: object on pad axes.
        planned: the path in the user's time {w}.
    """
    time = sample_time(config.mode, i, state.duration)
    most_rate = FASTEST if config.mode == Governing.TIME_OPTIMAL else 1.0
    limits = most_rate, config.most_speed, config.most_turning
    take_point(grid, i, time, along(config, state.duration, time, planned), held, limits)
    heavy = math.sqrt(grid[i].cc)
    if i == 0 or heavy > state.weight_load:
        state.weight_load, state.heaviest_time = heavy, time
    state.end = grid[i].s


@part
def load_to_plan(config: GovernorConfig, state: Governor, grid: Records[GridPoint]) -> float:
    """Return the load that the path is to be planned for [N].

    An object at rest is carried. So before the path begins, a slip at less than the weight counts as one at the weight:
    something pushed the object, or several arms pressed on each other.
    """
    F = config.most_grip * min(state.contact.F_lo, config.margin * state.contact.F_median)
    if state.planned == 0:
        at_start = math.sqrt(grid[cell(grid, state.s)].cc)
        F = carried_weight(config, state, F, at_start / KEPT)
    return with_weight(config, state, F)


@part
def plan(config: GovernorConfig, state: Governor, grid: Records[GridPoint]) -> None:
    """Plan a sampled path, and replan it if the load that it may use has changed."""
    F = load_to_plan(config, state, grid)
    if state.planned == 1 and abs(F - state.asked) <= REPLAN * state.asked:
        return
    plan_load = stopping_load(config, state, grid, F)
    state.asked, state.plan_load = F, plan_load
    carries = PATH_MARGIN * plan_load
    state.infeasible = 1 if state.weight_load > carries else 0
    if state.planned == 0:
        state.planned = 1
        # The timing of a path that begins at rest need not.
        begins = state.s == 0.0 and config.mode != Governing.TIME_OPTIMAL
        if begins and at_rest(grid[0], carries):
            state.rate = math.sqrt(min(grid[0].K, grid[1].K))
            steady(config, state)


@part
def stopping_load(config: GovernorConfig, state: Governor, grid: Records[GridPoint], F: float) -> float:
    """Plan for a load F [N], or the least above it under which the pad can stop on the path; return that load.

    Margin and reserve are given up first, the end of the path last.
    """
    if stops_with(config, state, grid, F, config.reserve):
        return F
    low, high = F, max(F, config.most_grip * GIVEN_UP * state.contact.slipped_at)
    if not stops_with(config, state, grid, high, 0.0):
        stops_with(config, state, grid, F, 0.0)  # brakes with what there is
        return F
    while high - low > REPLAN * low:
        load = 0.5 * (low + high)
        if stops_with(config, state, grid, load, 0.0):
            high = load
        else:
            low = load
    stops_with(config, state, grid, high, 0.0)
    return high


@part
def stops_with(config: GovernorConfig, state: Governor, grid: Records[GridPoint], F: float, reserve: float) -> bool:
    """Do the backward pass for a load F [N]; return whether the pad can stop on the path under it.

    At the end sdot need not be 0 where the path itself ends at rest, unless it is time-optimal.
    """
    usable, end = PATH_MARGIN * F, grid[GRID_POINTS - 1]
    left = left_for_motion(usable, math.sqrt(end.cc), reserve)
    free = config.mode != Governing.TIME_OPTIMAL and at_rest(end, left) and end.cc <= left * left
    end.K = end.cap if free else 0.0
    backward_pass(grid, usable, reserve)
    return bool(state.planned == 0 or state.rate * state.rate <= bound(grid, state.s)[0])


# -- running


@part
def allow(config: GovernorConfig, state: Governor) -> None:
    """Write which loads path and guard may use now."""
    F = config.most_grip * state.contact.F_median
    more = config.most_grip * (state.contact.F_lo + config.friction.probe)  # than is certain, where it is unknown
    state.usable = with_weight(config, state, min(more, config.margin * F))
    state.ceiling = with_weight(config, state, min(more, F))
    if state.planned == 1 and state.plan_load > max(state.usable, config.margin * F):
        state.usable = state.plan_load  # margin was given up
        state.ceiling = max(state.ceiling, state.plan_load)


@part
def run(
    config: GovernorConfig,
    state: Governor,
    grid: Records[GridPoint],
    held: Held,
    point: Along,
    pad: Pad,
    most_rate: float,
    dt: float,
) -> None:
    """Plan if necessary, and do a cycle's step on the path: writes out_s, out_rate, out_u, out_time.

    Args:
        config, state, grid: GOVERNOR_CONFIG, GOVERNOR, points of the path.
        held: object on pad axes.
        point: the path at state.time, from `along`.
        pad: where it is, as seen from that point of the path.
        most_rate: largest sdot that other limits admit; 0 = come to rest on the path.
        dt: control period [s].
    """
    plan(config, state, grid)
    allow(config, state)
    if state.arrived == 1:
        watch_overrun(state, pad, math.inf)
        state.led_s, state.endless = 0.0, 0
        smooth(config, state, 0.0)
    else:
        K, ahead = bound(grid, state.s)[0], bound(grid, state.s + dt * state.rate)
        most_led, last = math.sqrt(grid[cell(grid, state.s)].cap), state.end * (1.0 - 2.0 * ARRIVED_SHARE)
        bounds = Bounds(K, ahead[0], ahead[1], most_rate, most_led, 0.0, last)
        follow(config, state, bounds, held, point, pad, dt)
        if state.s >= state.end * (1.0 - ARRIVED_SHARE):
            state.s, state.rate, state.arrived = state.end, 0.0, 1
        state.time = time_at(state, grid, state.s)
    state.out_time = time_at(state, grid, state.out_s)


@part
def follow(
    config: GovernorConfig, state: Governor, bounds: Bounds, held: Held, point: Along, pad: Pad, dt: float
) -> None:
    """Do a cycle's step on a path or a stream: writes s and sdot, and their means; other arguments as in `run`.

    While the contact slips and the object leads, s follows the pad.
    """
    watch_overrun(state, pad, bounds.K)
    watch_lead(config, state, point, bounds.K, dt)
    if is_led(config, state):
        rate, ahead = on_pad(config, point, pad.x, pad.v)
        state.rate = min(max(rate, 0.0), bounds.most_led)
        state.s += ahead + dt * state.rate
        state.s = min(max(state.s, bounds.first), bounds.last)
        steady(config, state)
        return
    u = step_on(config, state, bounds, held, point, pad, dt)
    smooth(config, state, u)
    state.s += dt * (state.rate + 0.5 * dt * u)
    state.rate = max(state.rate + dt * u, 0.0)


@part
def smooth(config: GovernorConfig, state: Governor, u: float) -> None:
    """Average s, sdot and sddot over the same window: the mean of admissible accelerations is admissible."""
    place = state.ring_count % config.window
    state.ring[place, 0], state.ring[place, 1], state.ring[place, 2] = state.s, state.rate, u
    state.ring_count += 1
    s = rate = rate_rate = 0.0
    for i in range(config.window):
        s += state.ring[i, 0]
        rate += state.ring[i, 1]
        rate_rate += state.ring[i, 2]
    state.out_s, state.out_rate, state.out_u = s / config.window, rate / config.window, rate_rate / config.window


@part
def time_at(state: Governor, grid: Records[GridPoint], s: float) -> float:
    """Return the user's time at s [s]; where the path is completed, its end."""
    return float(state.duration) if s >= state.end else path_time(grid, s)


@part
def watch_overrun(state: Governor, pad: Pad, K: float) -> None:
    """End an overrun when the pad is back and can stop on the path again."""
    if pad.x.dot(pad.x) < BACK * BACK and state.rate * state.rate <= K:
        state.overrun = 0


@part
def watch_lead(config: GovernorConfig, state: Governor, point: Along, K: float, dt: float) -> None:
    """Find a slip that does not end while the object leads a path that hardly moves, or that exceeds K [1/s^2].

    point, dt: as in `run`.
    """
    if config.led == 0:
        state.led_s, state.endless = 0.0, 0
    elif state.contact.slipping == 0:
        state.led_s = max(state.led_s - dt, 0.0)
        if state.led_s == 0.0:
            state.endless = 0
    elif state.endless == 0:
        crawls = state.rate * state.rate * pace(config, point) < SLOWEST * SLOWEST
        late = state.rate * state.rate > OVER * K
        state.led_s = state.led_s + dt if crawls or late else 0.0
        state.endless = 1 if state.led_s > LED_S else 0


@part
def is_led(config: GovernorConfig, state: Governor) -> bool:
    """Return whether the object slips and leads the path."""
    return state.contact.slipping == 1 and config.led != 0 and state.endless == 0


@part
def governed(config: GovernorConfig, state: Governor, point: Along) -> tuple[Spatial, Spatial]:
    """Return twist and acceleration of the reference {w}; point: the path at state.out_time, from `along`.

    While a slipping object leads a_d = 0: a reference would drag it.
    """
    rate = state.out_rate
    if is_led(config, state):
        return rate * point.tangent, 0.0 * point.tangent
    return rate * point.tangent, rate * rate * point.curve + state.out_u * point.tangent


@part
def on_pad(config: GovernorConfig, point: Along, x_e: Vec, v_ee: Spatial) -> tuple[float, float]:
    """Return sdot of the pad along the path, and how far ahead of the point it is; arguments as in `run`."""
    p, w = point.tangent.linear, LENGTH * point.tangent.angular
    square = pace(config, point) + FLOOR * FLOOR
    return (p.dot(v_ee.linear) + LENGTH * w.dot(v_ee.angular)) / square, p.dot(x_e) / square
