"""The reference governor: how fast the path is run through, so that the load stays within what friction carries.

A cycle calls, in this order: `feel`, `slip_sample` for every slip sample, `next_point` a few times while
`wants_points`, `run`, then its law with `governed` as reference, then `hold_back` with the law's a_C. All of it is in
place and deterministic: what it knows is GOVERNOR, the PATH_GRID and the LOAD_HISTORY.

Planning (sampling the path, backward pass) is done in pieces of `points_per_cycle`, never at once. While a pass for a
smaller F^ is under way, the pad brakes as hard as the new F^ admits: any braking is on the safe side of any plan, and
no cycle asks for more than the new F^. A plan for a larger F^ may wait: the old one is safe.
"""

from __future__ import annotations

import math
from enum import IntEnum, unique
from typing import Annotated, Final, NamedTuple

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.records import Real, Record, Vec3, Vec6, Whole, dtype_of
from slip_core.vectors import Mat, Spatial, Vec, put_spatial, spatial, vec
from slip_vic_controller.governor.backward_pass import at_rest, left_for_motion, range_of_u, step_back
from slip_vic_controller.governor.friction_estimate import (
    Estimate,
    EstimateConfig,
    Friction,
    LoadHistory,
    allowed,
    certain,
    certify,
    provisional,
    remember,
    start_estimate,
)
from slip_vic_controller.governor.guard import guard_factor
from slip_vic_controller.governor.load import Held, drawn, size, surface, turning, weight
from slip_vic_controller.governor.path_grid import (
    FASTEST,
    GRID_POINTS,
    Along,
    Governing,
    PathGrid,
    along,
    bound,
    bound_next,
    cell,
    path_time,
    sample_time,
    take_point,
)

MAX_WINDOW: Final = 64
"""Largest number of cycles of the moving average."""
SEARCH_PASSES: Final = 3
"""Bisections of the search for the least load that still stops on the path."""
REPLAN: Final = 1.005
"""Rise of the certain load that is worth a new pass."""
ARRIVED_SHARE: Final = 1e-6
"""Share of the path that may be left when it counts as run through."""
MORE_THAN_WEIGHT: Final = 1.0 + 1e-6
"""Of what the weight alone asks: with that the path can be run through, as slowly as need be."""
OVER: Final = 1.1
"""sdot^2 over K beyond which an overrun is said, ..."""
SLOWEST: Final = 2e-2
"""... if this speed of the pad or more is too much [m/s]."""
BRAKES: Final = 1.1
"""Of the load of the weight alone, where the estimate of friction does not carry that: the arm has to brake."""
LED_S: Final = 1.0
"""How long a slipping object may lead a path that hardly moves: pads that tremble slip to and fro for ever [s]."""
LED_LATE_S: Final = 0.2
"""The same of one that has to be braked [s]."""
BACK: Final = 1e-3
"""How near its path the pad has come back when an overrun is over, where it can stop on the path again [m]."""


@unique
class Phase(IntEnum):
    """What the planning is at."""

    SAMPLING = 0
    BACKWARD = 1
    READY = 2


@unique
class Search(IntEnum):
    """Whether a pass looks for the least load that still stops on the path."""

    NO = 0
    CEILING = 1
    BISECTION = 2
    LAST = 3


class GovernorConfig(Record):
    """How the path is governed."""

    mode: Whole  # Governing
    margin: Real  # beta, share of F^ that a motion may use
    path_margin: Real  # share of that in the backward pass
    reserve: Real  # share of the friction beside the weight that the path does not use
    given_up: Real  # share of the load at which it slipped that may be used where nothing less stops on the path
    radius: Real  # m, rho
    slip_axes: Vec6  # Sigma, 0 or 1, {ee}
    gravity: Vec3  # m/s^2 {w}
    duration: Real  # s, of the user's path
    length: Real  # m, L: makes turning a length
    floor: Real  # m/s, of the path's length
    most_grip: Real  # largest grip over the configured one
    most_speed: Real  # m/s, of the pad
    most_turning: Real  # rad/s
    points_per_cycle: Whole  # of planning
    window: Whole  # cycles of the moving average
    guards: Whole  # whether the guard holds back where the object slips and the path is overrun
    led: Whole  # whether an object that slips leads the path; several arms keep to it
    estimate: EstimateConfig


class Governor(Record):
    """Where on the path the object is, and the planning."""

    duration: Real  # s, of the path that is run through
    s: Real
    rate: Real  # sdot
    time: Real  # s, the user's time at s
    end: Real  # of s
    out_s: Real  # the same after smoothing
    out_rate: Real
    out_u: Real  # sddot
    out_time: Real  # s
    phase: Whole  # Phase
    cursor: Whole  # of the sampling or the pass
    planned: Whole  # whether there is a plan
    urgent: Whole  # whether a smaller F^ is being planned for
    search: Whole  # Search
    search_pass: Whole
    asked: Real  # N, that is planned for
    pass_load: Real  # N, of the pass under way
    plan_load: Real  # N, of the plan in use
    low_load: Real  # N, between which the search is
    high_load: Real  # N
    infeasible: Whole  # friction does not carry the weight everywhere on the path
    heaviest_time: Real  # s, where the weight loads most
    weight_load: Real  # N, that load
    overrun: Whole  # no allowed load stops on the path
    strained: Whole  # no sddot keeps the load of feedback and path within the limit
    halted: Whole  # the path rests, since the observer has found slip at a load below what it needs from here on
    led_s: Real  # s, for which a slipping object has led the path while it hardly moved
    endless: Whole  # that slip does not end, so the path goes on
    arrived: Whole
    out_speed: Real  # ds/dt of the first pad's path at out_time
    out_bend: Real  # its rate
    usable: Real  # N, load that the path may use
    ceiling: Real  # N, load that the guard lets pass
    bound: Real  # sdot^2 over K
    grip: Real  # least of all pads, over the one for which F^ is configured
    ring_count: Whole
    ring: Annotated[Array, (MAX_WINDOW, 3)]  # s, sdot, sddot
    estimate: Estimate  # of the weakest pad


class GovernedPad(Record):
    """What the governor keeps of each pad."""

    feedback: Vec6  # a_C - a_d of the last cycle {w}
    commanded: Real  # N, load of the last cycle
    measured: Real  # N
    guard: Real  # factor on a_C
    grip: Real  # over the one for which F^ is configured
    estimate: Estimate
    loads: LoadHistory  # of the last cycles


GOVERNOR_CONFIG, GOVERNOR, PAD = dtype_of(GovernorConfig), dtype_of(Governor), dtype_of(GovernedPad)


@part
def start_path(config: GovernorConfig, state: Governor) -> None:
    """Begin a path: it has to be sampled. What is known of friction stays."""
    state.s, state.end, state.arrived = 0.0, 0.0, 0
    state.time = sample_time(config.mode, 0, state.duration)
    plan_anew(config, state)


@part
def plan_anew(config: GovernorConfig, state: Governor) -> None:
    """Rest where the path is, and sample it again: what is held or known of friction may be another."""
    state.rate = 0.0
    state.phase, state.cursor, state.planned, state.urgent = Phase.SAMPLING, 0, 0, 0
    state.search, state.search_pass = Search.NO, 0
    state.asked = state.pass_load = state.plan_load = state.low_load = state.high_load = 0.0
    state.infeasible, state.heaviest_time, state.weight_load = 0, 0.0, 0.0
    state.overrun, state.strained, state.halted, state.endless = 0, 0, 0, 0
    state.bound = state.led_s = 0.0
    steady(config, state)


@part
def start_pad(config: GovernorConfig, pad: GovernedPad, at_rest: float, weighed: bool, grip: float) -> None:
    """Begin with a pad: of friction is known what is configured, or what the object at rest shows.

    Args:
        config, pad: GOVERNOR_CONFIG, PAD.
        at_rest: load of the object at rest [N].
        weighed: whether a tare has found that, and not the configuration.
        grip: over the one for which friction is configured.
    """
    rests_with = at_rest / (grip * config.path_margin) if weighed else 0.0
    start_estimate(config.estimate, pad.estimate, pad.loads, at_rest / grip, rests_with)
    pad.commanded = pad.measured = at_rest
    pad.guard, pad.grip = 1.0, grip
    put_spatial(pad.feedback, Spatial(Vec(0.0, 0.0, 0.0), Vec(0.0, 0.0, 0.0)))


@part
def start_governor(config: GovernorConfig, state: Governor, pad: GovernedPad) -> None:
    """Begin a path, with what is known of a pad."""
    state.duration = config.duration
    start_path(config, state)
    know_pad(state, pad)


@part
def know_pad(state: Governor, pad: GovernedPad) -> None:
    """Count with what is known of a pad."""
    state.estimate, state.grip = pad.estimate, pad.grip


@part
def steady(config: GovernorConfig, state: Governor) -> None:
    """Let the moving average begin again where the path is now."""
    for i in range(config.window):
        state.ring[i, 0], state.ring[i, 1], state.ring[i, 2] = state.s, state.rate, 0.0
    state.ring_count = 0
    state.out_s, state.out_rate, state.out_u, state.out_time = state.s, state.rate, 0.0, state.time


# -- planning, in pieces


@part
def wants_points(state: Governor) -> bool:
    """Return whether the path is still being sampled."""
    return bool(state.phase == Phase.SAMPLING)


@part
def wanted_time(config: GovernorConfig, state: Governor) -> float:
    """Return the user's time of the point that is sampled next [s]."""
    return sample_time(config.mode, state.cursor, state.duration)


@part
def next_point(
    config: GovernorConfig,
    state: Governor,
    grid: PathGrid,
    held: Held,
    rotation: Mat,
    twist: Spatial,
    acceleration: Spatial,
) -> None:
    """Take the path's point at `wanted_time`; after the last the first backward pass begins.

    Args:
        config, state, grid: GOVERNOR_CONFIG, GOVERNOR, PATH_GRID.
        held: object on pad axes.
        rotation, twist, acceleration: of the path in the user's time {w}.
    """
    i, time = state.cursor, wanted_time(config, state)
    at = along(config, state.duration, time, rotation, twist, acceleration)
    weights = surface(spatial(config.slip_axes), config.radius)
    most_rate = math.sqrt(FASTEST) if config.mode == Governing.TIME_OPTIMAL else 1.0
    limits = most_rate, config.most_speed, config.most_turning
    take_point(grid, i, time, at, held, weights, vec(config.gravity), limits)
    heavy = math.sqrt(grid.points[i].cc)
    if i == 0 or heavy > state.weight_load:
        state.weight_load, state.heaviest_time = heavy, time
    state.cursor += 1
    if state.cursor == GRID_POINTS:
        state.end = grid.points[GRID_POINTS - 1].s
        begin_plan(state, planned_load(config, state, grid))


@part
def begin_plan(state: Governor, F: float) -> None:
    """Begin to plan for a load F [N], whatever was under way."""
    state.asked, state.search = F, Search.NO
    begin_pass(state, F)


@part
def begin_pass(state: Governor, F: float) -> None:
    """Begin a backward pass for a load F [N]."""
    state.phase, state.cursor, state.pass_load = Phase.BACKWARD, GRID_POINTS - 1, F


@part
def tried(config: GovernorConfig, state: Governor, F: float, weight_load: float) -> float:
    """Return a load [N], at least what a weight alone asks [N], as far as friction carried that at first."""
    needed = MORE_THAN_WEIGHT * weight_load / config.path_margin
    return float(max(F, min(needed, config.margin * state.estimate.first)))


@part
def with_weight(config: GovernorConfig, state: Governor, F: float) -> float:
    """Return a load [N], at least what the weight alone asks on the path, where that is to be tried.

    On the way there is nothing better than to go on slowly: a stop throws what hardly holds, and the weight is there
    at rest too. With unknown friction what carries the weight can only be found by trying, up to the configured limit.
    """
    if state.planned == 0 and config.estimate.friction != Friction.UNKNOWN:
        return F
    return tried(config, state, F, state.weight_load)


@part
def planned_load(config: GovernorConfig, state: Governor, grid: PathGrid) -> float:
    """Return the load that the path is to be planned for [N].

    What rests is carried. So before the path begins, a slip at less than the weight there counts as one at the weight:
    something has pushed the object, or several arms have pressed on each other.
    """
    F = config.most_grip * certain(config.estimate, state.estimate, config.margin)
    if state.planned == 0:
        F = tried(config, state, F, math.sqrt(grid.points[cell(grid, state.s)].cc) / config.estimate.kept)
    return with_weight(config, state, F)


@part
def plan(config: GovernorConfig, state: Governor, grid: PathGrid) -> None:
    """Do a cycle's share of the planning, and begin again where F^ has changed."""
    if state.phase == Phase.SAMPLING:
        return
    F = planned_load(config, state, grid)
    if state.asked > F:
        state.urgent = 1
        begin_plan(state, F)
    elif state.phase == Phase.READY and REPLAN * state.asked < F:
        begin_plan(state, F)
    if state.phase == Phase.BACKWARD:
        free_end = config.mode != Governing.TIME_OPTIMAL
        reserve = config.reserve if state.search == Search.NO else 0.0
        for _ in range(min(config.points_per_cycle, state.cursor + 1)):
            step_back(grid, state.cursor, config.path_margin * state.pass_load, reserve, free_end)
            state.cursor -= 1
        if state.cursor < 0:
            end_pass(config, state, grid)


@part
def end_pass(config: GovernorConfig, state: Governor, grid: PathGrid) -> None:
    """Take the plan if the pad can still stop under it; otherwise give up margin first, and the path's end last.

    The reserve is margin too. The least load in [asked, given_up * slipped_at] that stops on the path is looked for, by
    bisection.
    """
    late = state.planned == 1 and state.rate * state.rate > bound_next(grid, state.s)
    _, slipped_at = provisional(config.estimate, state.estimate)
    most = config.most_grip * (config.given_up * slipped_at)
    if late and state.search == Search.NO and (most > state.asked or config.reserve > 0.0):
        state.search, state.high_load = Search.CEILING, max(most, state.asked)
        begin_pass(state, state.high_load)
    elif late and state.estimate.suspected != 0 and (state.search == Search.NO or state.search == Search.CEILING):
        state.estimate.suspected, state.urgent = 0, 0  # it is too late for the observer's word alone
        begin_plan(state, planned_load(config, state, grid))
    elif state.search == Search.CEILING and late:  # nothing stops on the path: brake with what there is
        state.search = Search.LAST
        begin_pass(state, state.asked)
    elif state.search == Search.CEILING:
        state.search, state.search_pass, state.low_load = Search.BISECTION, 0, state.asked
        begin_pass(state, 0.5 * (state.low_load + state.high_load))
    elif state.search == Search.BISECTION:
        if late:
            state.low_load = state.pass_load
        else:
            state.high_load = state.pass_load
        state.search_pass += 1
        if state.search_pass < SEARCH_PASSES:
            begin_pass(state, 0.5 * (state.low_load + state.high_load))
        else:
            state.search = Search.LAST
            begin_pass(state, state.high_load)
    else:
        take_plan(config, state, grid)


@part
def take_plan(config: GovernorConfig, state: Governor, grid: PathGrid) -> None:
    """Use the pass that has just ended."""
    for i in range(GRID_POINTS):
        grid.points[i].K = grid.points[i].K_next
    state.phase, state.search, state.urgent, state.plan_load = Phase.READY, Search.NO, 0, state.pass_load
    carries = config.path_margin * state.plan_load
    state.infeasible = 1 if state.weight_load > carries else 0
    if state.planned == 0:
        state.planned = 1
        # The timing of a path that begins at rest need not.
        begins = state.s == 0.0 and config.mode != Governing.TIME_OPTIMAL
        if begins and at_rest(grid.points[0], carries):
            state.rate = math.sqrt(min(grid.points[0].K, grid.points[1].K))
            steady(config, state)


# -- running


@part
def allow(config: GovernorConfig, state: Governor) -> None:
    """Write which loads path and guard may ask now."""
    F, plan_load = state.grip * state.estimate.F_hat, state.plan_load * (state.grip / config.most_grip)
    state.usable = with_weight(config, state, state.grip * allowed(config.estimate, state.estimate, config.margin))
    state.ceiling = with_weight(config, state, state.grip * allowed(config.estimate, state.estimate, 1.0))
    if state.planned == 1 and state.urgent == 0 and plan_load > max(state.usable, config.margin * F):
        state.usable = plan_load  # margin was given up
        state.ceiling = max(state.ceiling, plan_load)


class Pad(NamedTuple):
    """The pad {w}: x, as seen from a point of the path [m]; attitude R; twist v; feedback: a_C - a_d, last cycle."""

    x: Vec
    R: Mat
    v: Spatial
    feedback: Spatial


@part
def run(
    config: GovernorConfig,
    state: Governor,
    grid: PathGrid,
    held: Held,
    point: Along,
    pad: Pad,
    most_rate: float,
    dt: float,
) -> None:
    """Do a cycle's planning and its step on the path: writes out_s, out_rate, out_u, out_time.

    Args:
        config, state, grid: GOVERNOR_CONFIG, GOVERNOR, PATH_GRID.
        held: object on pad axes.
        point: the path at state.time, from `along`.
        pad: where it is, as seen from that point of the path.
        most_rate: largest sdot that anything else admits; 0 = come to rest on the path.
        dt: control period [s].
    """
    plan(config, state, grid)
    allow(config, state)
    if pad.x.dot(pad.x) < BACK * BACK and (state.arrived == 1 or state.bound <= 1.0):
        state.overrun = 0
    watch_lead(config, state, point, bound(grid, state.s)[0], dt)
    if state.planned == 0 or state.arrived == 1:
        smooth(config, state, grid, 0.0)
        return
    if is_led(config, state):
        anchor(config, state, grid, point, pad.x, pad.v, dt)
        return
    u = step_on(config, state, bound(grid, state.s + dt * state.rate), held, point, pad, most_rate, dt)
    smooth(config, state, grid, u)
    state.s += dt * (state.rate + 0.5 * dt * u)
    state.rate = max(state.rate + dt * u, 0.0)
    if state.s >= state.end * (1.0 - ARRIVED_SHARE):
        state.s, state.rate, state.arrived = state.end, 0.0, 1
    state.time = time_at(config, state, grid, state.s)


@part
def range_or_least(uu: float, ub: float, bb: float, F: float) -> tuple[float, float, bool]:
    """Return the range of sddot whose load is within F; where there is none, the one of least load, and False."""
    low, high, any_u = range_of_u(uu, ub, bb, F)
    if not any_u:
        low = high = -ub / uu if uu > 0.0 else 0.0
    return low, high, any_u


@part
def step_on(
    config: GovernorConfig,
    state: Governor,
    ahead: tuple[float, float],
    held: Held,
    point: Along,
    pad: Pad,
    most_rate: float,
    dt: float,
) -> float:
    """Return sddot of this cycle; ahead: K and its slope where the path will be.

    The largest whose load, with that of the impedance's feedback, is allowed, after which sdot^2 is within K, and that
    without feedback leaves the reserve; braking may use it. While a smaller F^ is being planned for: the smallest.
    """
    weights, R_ee, w_ee = surface(spatial(config.slip_axes), config.radius), pad.R, pad.v.angular
    (K, slope), rate = ahead, state.rate
    a = rate * rate * point.curve + pad.feedback
    l_w = turning(held, weights, R_ee, w_ee)
    b = drawn(held, weights, R_ee, a) + l_w
    l_g = weight(held, weights, R_ee, vec(config.gravity))
    b = b + l_g
    l_u = drawn(held, weights, R_ee, point.tangent)
    uu, ub = l_u.dot(l_u), l_u.dot(b)
    low, high, any_u = range_or_least(uu, ub, b.dot(b), state.usable)
    state.strained = 0 if any_u else 1
    if config.reserve > 0.0:
        b_d = b - drawn(held, weights, R_ee, pad.feedback)
        F = left_for_motion(state.usable, size(l_g), config.reserve)
        _, most, _ = range_or_least(uu, l_u.dot(b_d), b_d.dot(b_d), F)
        high = max(min(most, high), low)
    # To catch up asks for no more than the path as planned, or what is carried; it helps nothing where weight is more.
    if config.mode == Governing.SLOW_DOWN and size(l_g) < state.grip * state.estimate.certified:
        planned = drawn(held, weights, R_ee, point.curve) + l_w + l_g
        F = max(state.grip * (state.estimate.certified + config.estimate.probe), size(planned))
        _, most, any_u = range_or_least(uu, ub, b.dot(b), F)
        high = max(min(max(most, 0.0) if any_u else 0.0, high), low)
    stop = -rate / dt
    state.bound = rate * rate / K if K > 0.0 else (0.0 if rate <= 0.0 else FASTEST)
    m = 0.5 * slope * dt
    d = 0.25 * m * m + K - m * rate
    fastest = max(0.5 * m + math.sqrt(d), 0.0) if d > 0.0 else 0.0
    want = (min(fastest, most_rate) - rate) / dt
    if state.urgent == 1:
        want = stop
    least, state.halted = low, 0
    if state.estimate.suspected != 0:  # no more than that is asked, unless it takes more to stop on the path
        F, _ = provisional(config.estimate, state.estimate)
        F = state.grip * F
        if config.led == 0:  # each of several arms takes for slip what the others do: no reason to stop for good
            F = with_weight(config, state, F)
        least, most, any_u = range_or_least(uu, ub, b.dot(b), min(F, state.usable))
        state.halted = 1 if not (any_u and most > 0.0) and rate == 0.0 and want > 0.0 else 0
        least, high = max(least, low), min(most, high)
        if state.urgent == 0:
            least = max(min(want, least), low)
    u = max(min(max(want, least), high), stop)
    u = min(u, max(want, 0.0))  # where the load asks for more than K admits, the guard has the last word
    if state.urgent == 0 and (rate * rate - OVER * K) * pace(config, point) > SLOWEST * SLOWEST:
        state.overrun = 1
    return u


@part
def pace(config: GovernorConfig, point: Along) -> float:
    """Return the square of the pad's speed over sdot, turning as a length."""
    p, w = point.tangent.linear, config.length * point.tangent.angular
    return p.dot(p) + w.dot(w)


@part
def smooth(config: GovernorConfig, state: Governor, grid: PathGrid, u: float) -> None:
    """Average s, sdot and sddot over the window alike: the mean of admissible accelerations is admissible."""
    place = state.ring_count % config.window
    state.ring[place, 0], state.ring[place, 1], state.ring[place, 2] = state.s, state.rate, u
    state.ring_count += 1
    s = rate = rate_rate = 0.0
    for i in range(config.window):
        s += state.ring[i, 0]
        rate += state.ring[i, 1]
        rate_rate += state.ring[i, 2]
    state.out_s, state.out_rate, state.out_u = s / config.window, rate / config.window, rate_rate / config.window
    state.out_time = time_at(config, state, grid, state.out_s) if state.planned == 1 else state.time


@part
def time_at(config: GovernorConfig, state: Governor, grid: PathGrid, s: float) -> float:
    """Return the user's time at s [s]; where the path has been run through, its end."""
    return float(state.duration) if s >= state.end else path_time(grid, s)


@part
def watch_lead(config: GovernorConfig, state: Governor, point: Along, K: float, dt: float) -> None:
    """Find a slip that does not end while the object leads a path that hardly moves, or goes beyond K [1/s^2].

    point, dt: as in `run`.
    """
    if state.arrived == 1 or config.led == 0:
        state.led_s, state.endless = 0.0, 0
    elif state.estimate.slipping == 0:
        state.led_s = max(state.led_s - dt, 0.0)
        if state.led_s == 0.0:
            state.endless = 0
    elif state.endless == 0:
        crawls = state.rate * state.rate * pace(config, point) < SLOWEST * SLOWEST
        late = state.rate * state.rate > OVER * K
        state.led_s = state.led_s + dt if crawls or late else 0.0
        state.endless = 1 if state.led_s > (LED_S if crawls else LED_LATE_S) else 0


@part
def is_led(config: GovernorConfig, state: Governor) -> bool:
    """Return whether the object slips and leads the path."""
    return state.estimate.slipping == 1 and config.led != 0 and state.endless == 0


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
    p, w = point.tangent.linear, config.length * point.tangent.angular
    square = pace(config, point) + config.floor * config.floor
    return (p.dot(v_ee.linear) + config.length * w.dot(v_ee.angular)) / square, p.dot(x_e) / square


@part
def anchor(
    config: GovernorConfig, state: Governor, grid: PathGrid, point: Along, x_e: Vec, v_ee: Spatial, dt: float
) -> None:
    """Let s follow the pad while the contact slips; arguments as in `run`."""
    rate, ahead = on_pad(config, point, x_e, v_ee)
    cap = grid.points[cell(grid, state.s)].cap
    state.rate = min(max(rate, 0.0), math.sqrt(cap))
    state.s += ahead + dt * state.rate
    state.s = min(max(state.s, 0.0), state.end * (1.0 - 2.0 * ARRIVED_SHARE))
    state.time = path_time(grid, state.s)
    steady(config, state)


# -- before and after the law


@part
def feel(config: GovernorConfig, pad: GovernedPad, h_ee: Spatial, now_ns: int) -> None:
    """Remember the measured load; to be called before the slip samples of this cycle are taken.

    Args:
        config, pad: GOVERNOR_CONFIG, PAD.
        h_ee: measured wrench {ee}.
        now_ns: stamp of this cycle's measurements [ns].
    """
    weights = surface(spatial(config.slip_axes), config.radius)
    pad.measured = size(weights * h_ee)
    remember(pad.loads, now_ns, pad.measured / pad.grip, pad.commanded / pad.grip)
    certify(config.estimate, pad.estimate, pad.loads, now_ns)


@part
def hold_back(
    config: GovernorConfig,
    ceiling: float,
    pad: GovernedPad,
    held: Held,
    R_ee: Mat,
    w_ee: Vec,
    a_C: Spatial,
    a_d: Spatial,
    slides: bool,
) -> float:
    """Return the guard's factor on a_C, and keep the feedback and the load that are commanded.

    Args:
        config: GOVERNOR_CONFIG.
        ceiling: load that the guard may ask [N].
        pad: PAD.
        held: object on pad axes.
        R_ee, w_ee: the pad's attitude and turning {w} [rad/s].
        a_C, a_d: control acceleration of the law, and the reference's in it {w}.
        slides: whether the object slides and is left to that: nothing is held back.

    Implements: ours: the load of the commanded acceleration never exceeds F^ unless it slides.
    """
    weights = surface(spatial(config.slip_axes), config.radius)
    l_a = drawn(held, weights, R_ee, a_C)
    l_0 = turning(held, weights, R_ee, w_ee) + weight(held, weights, R_ee, vec(config.gravity))
    k = 1.0
    if config.mode != Governing.OFF and not slides:
        alone = size(l_0)  # an object that holds shows that the limit is wrong, and one that slides needs no guard
        k = guard_factor(l_a, l_0, ceiling if alone <= ceiling else BRAKES * alone)
    pad.guard, pad.commanded = k, size(k * l_a + l_0)
    put_spatial(pad.feedback, a_C - a_d)
    return k
