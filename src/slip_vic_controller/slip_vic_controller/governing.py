"""The reference governor in the cycle: what it is told of grasp, path and slip, and the reference that it gives."""

from __future__ import annotations

import math
from typing import Any

from slip_core.compiled import part
from slip_core.records import REAL, layout
from slip_core.vectors import ZERO, Mat, Spatial, Vec, mat, spatial, vec
from slip_vic_controller.law.contact import contact_arm, pad_rotation
from slip_vic_controller.law.internal import sharing
from slip_vic_controller.reference import governor
from slip_vic_controller.reference.friction_estimate import provisional, slip_sample, suspect
from slip_vic_controller.reference.goals import (
    GoalPhase,
    Refusal,
    begin_goal,
    goal_at,
    refuse_goal,
    rest_at,
    screen_goal,
    standing,
)
from slip_vic_controller.reference.grip import follow_load, load_ahead
from slip_vic_controller.reference.load import ALONE, Held, Shared, load, size, surface
from slip_vic_controller.reference.path_grid import Along, Governing, along
from slip_vic_controller.reference.paths import Reference, reference_at
from slip_vic_controller.reference.stream import (
    at,
    drop_passed,
    plan_stream,
    rest_stream,
    stream_bound,
    take_queued,
    waiting,
)

GOVERNED = layout(
    path_s=REAL, path_rate=REAL, friction_limit=REAL, load_commanded=REAL, load_measured=REAL, load_ratio=REAL,
    guard=REAL, friction_events=REAL, given_up=REAL, margin=REAL, friction_share=REAL, slipping=REAL,
    grip_command=REAL, grip_force=REAL, stream_waits=REAL, goal=REAL, goal_phase=REAL, goal_progress=REAL,
)  # fmt: skip
"""What is published of the governor: where on the path and how fast; F^, loads commanded and measured [N], commanded
load over F^; the guard's factor on a_C; how often F^ was made smaller; whether the compensation is given up; margin:
load that may be asked over F^; friction_share: measured load over F^; slipping: 1 while the slip input says so; grip:
commanded, and as the gripper is taken to follow [N]; stream_waits: how much of a stream of references has been received
and is not run through yet [s]; number of the goal under way, its GoalPhase, and which share of its path is done."""
UNLIMITED = 1e3
"""A speed along the path that limits nothing."""
OBSERVED = 0.5
"""Share of the threshold that a slip sample must show where the observer has found slip: two witnesses."""
CATCH_UP = 1.5
"""How much faster than it came a stream may be run through where the timing is free."""
SAMPLES_PER_CYCLE = 10
"""Points of the path that are sampled in a cycle."""


@part
def held_by(mass: float, inertia: Mat, position: Vec, contact: Any, slip: Any) -> Held:
    """Return the object on the axes of the pad that holds it.

    Args:
        mass, inertia: [kg], [kg m2] {o}.
        position: of the contact on the object, o_x_p [m] {o}.
        contact, slip: CONTACT, SLIP.
    """
    pad = pad_rotation(contact, slip)
    return Held(mass, pad.T() @ (inertia @ pad), contact_arm(pad, position, contact, slip), ALONE)


@part
def held(c: Any, s: Any, gains: Any) -> Held:
    """Return the object as the own pad holds it."""
    grasped, position = gains.object, vec(gains.contact_position)
    own = held_by(grasped.mass, mat(grasped.inertia), position, c.law.contact[0], s.law.slips[0])
    if c.law.contacts == 1:
        return own
    with_others, rho = sharing(c.law, gains, s.law.slips), c.governor.radius
    arm = math.sqrt(with_others.longest * with_others.longest + rho * rho)
    shared = Shared(with_others.contacts, with_others.middle, with_others.inverse, arm, rho)
    return Held(own.mass, own.inertia, own.r, shared)


@part
def begin_governing(c: Any, s: Any, arm: Any, gains: Any) -> None:
    """Begin with the load of the object at rest; c, s: CONFIG and STATE of the cycle."""
    weights = surface(spatial(c.governor.slip_axes), c.governor.radius)
    nothing = Spatial(ZERO, ZERO)
    at_rest = load(held(c, s, gains), weights, mat(arm.rotation), ZERO, vec(c.governor.gravity), nothing)
    governor.start_governor(c.governor, s.governor, s.loads, size(at_rest))
    s.governor.grip = s.grip.actual / c.grip.told


@part
def rest_on_path(c: Any, s: Any, arm: Any) -> None:
    """Go on from rest where the path is; of a stream, where the pad is."""
    if c.stream.on != 0:
        rest_stream(s.stream, vec(arm.position), mat(arm.rotation))
    s.governor.rate = 0.0
    governor.steady(c.governor, s.governor)


@part
def path_at(c: Any, s: Any, time: float) -> Reference:
    """Return the trajectory as planned at its own time [s]: the built-in one, or that of the goal."""
    if c.goals.on != 0:
        return goal_at(s.goal, time)
    return reference_at(c.path, time, s.law.start_position, s.law.start_rotation)


@part
def along_path(c: Any, s: Any, planned: Reference, time: float) -> Along:
    """Return a point of the path over s."""
    return along(c.governor, s.governor.duration, time, planned.rotation, planned.twist, planned.acceleration)


@part
def squeeze(c: Any, s: Any, dt: float) -> None:
    """Let the grip follow the path that is planned, and what the law and the wrench show of it now."""
    state = s.governor
    load = max(state.commanded, state.measured)
    if state.planned == 1:
        load = max(load, load_ahead(s.grid, state.time, c.grip.preview_s))
    F, _ = provisional(c.governor.estimate, state.estimate)
    follow_load(c.grip, s.grip, load, F, dt)
    state.grip = s.grip.actual / c.grip.told


@part
def take_governed_goal(c: Any, s: Any) -> bool:
    """Begin the goal that waits, once the pad is at rest; return whether there is a path to run through."""
    state, goal = s.governor, s.goal
    if goal.pending != 0:
        if goal.phase == GoalPhase.RESTS or (state.rate == 0.0 and state.out_rate == 0.0):
            begin_goal(goal, standing(path_at(c, s, state.out_time)))
            state.duration, goal.phase = goal.path.knot[1], GoalPhase.PLANS.value
            governor.start_path(c.governor, state)
        else:
            goal.phase = GoalPhase.STOPS.value
    return bool(goal.phase != GoalPhase.RESTS)


@part
def judge_governed_goal(c: Any, s: Any) -> None:
    """Refuse a goal that friction cannot carry the object to, and say when one is reached."""
    state, goal = s.governor, s.goal
    if goal.phase == GoalPhase.PLANS and state.planned != 0:
        goal.phase = GoalPhase.MOVES.value
        if state.infeasible != 0:
            carries = c.governor.path_margin * state.plan_load
            refuse_goal(goal, Refusal.TOO_HEAVY.value, state.heaviest_time, state.weight_load, carries)
            rest_at(goal, standing(goal_at(goal, 0.0)))
            governor.start_path(c.governor, state)
    elif goal.phase == GoalPhase.MOVES and state.arrived != 0 and state.out_rate == 0.0:
        goal.phase = GoalPhase.REACHED.value


@part
def goal_progress(c: Any, s: Any) -> float:
    """Return which share of the time of its path a goal has behind it."""
    goal = s.goal
    if goal.phase == GoalPhase.REACHED:
        return 1.0
    if goal.phase == GoalPhase.RESTS or goal.phase == GoalPhase.PLANS:
        return 0.0
    if c.governor.mode != Governing.OFF:
        return float(s.governor.out_time / s.governor.duration)
    return min(max(goal_time(s) / goal.path.knot[1], 0.0), 1.0)


@part
def goal_time(s: Any) -> float:
    """Return the time since the goal's path has begun, where no governor has it [s]."""
    return (s.joint.answers.stamp_ns - s.law.start_ns) * 1e-9


@part
def screen(c: Any, s: Any, at_work: bool) -> None:
    """Refuse the goal that waits where it cannot be begun."""
    if c.goals.on != 0 and s.goal.pending != 0:
        governed = c.governor.mode != Governing.OFF
        now = goal_at(s.goal, s.governor.out_time if governed else goal_time(s))
        screen_goal(c.goals, s.goal, now, at_work)


@part
def follow_goal(c: Any, s: Any) -> Reference:
    """Return the reference towards the goal, as asked for: a new goal goes on from where the reference is and moves."""
    goal, law = s.goal, s.law
    reference = goal_at(goal, goal_time(s))
    if goal.pending != 0:
        begin_goal(goal, reference)
        goal.phase, law.start_ns = GoalPhase.MOVES.value, s.joint.answers.stamp_ns
    elif goal.phase == GoalPhase.MOVES and goal_time(s) >= goal.path.knot[1]:
        goal.phase = GoalPhase.REACHED.value
    return reference


@part
def rate_limit(c: Any, state: Any, path_speed: float) -> float:
    """Return the largest sdot for other reasons; 0 = come to rest."""
    return UNLIMITED if path_speed >= 1.0 else path_speed * max(state.rate, c.governor.floor)


@part
def follow_stream(c: Any, s: Any, arm: Any, grasped: Held, path_speed: float, dt: float) -> None:
    """Do a governed stream's cycle: what has been received, how fast it may be run through, and the step on it."""
    state, stream, config = s.governor, s.stream, c.governor
    governor.allow(config, state)
    if take_queued(c.stream, stream, state, s.joint.answers.stamp_ns):
        governor.steady(config, state)
    if stream.count == 0:
        state.rate = 0.0
        return
    drop_passed(stream, state.out_time)
    weights = surface(spatial(config.slip_axes), config.radius)
    limits = CATCH_UP if config.mode == Governing.TIME_OPTIMAL else 1.0, config.most_speed, config.most_turning
    plan_stream(stream, grasped, weights, vec(config.gravity), limits, config.path_margin * state.usable)
    now = at(stream, state.time)
    point = Along(now.rotation, now.twist, now.acceleration, 1.0, 0.0)
    pad, u = governor.Pad(vec(arm.position) - now.position, mat(arm.rotation), spatial(arm.twist)), 0.0
    if state.estimate.slipping != 0:
        rate, ahead = governor.on_pad(config, point, pad.x, pad.v)
        state.rate = min(max(rate, 0.0), 1.0)
        last = stream.points[stream.count - 1].time
        state.time = min(max(state.time + ahead + dt * state.rate, stream.points[0].time), max(last, state.time))
    else:
        ahead_K = stream_bound(stream, state.time + dt * state.rate)
        state.overrun = 0
        most_rate = min(rate_limit(c, state, path_speed), limits[0])
        u = governor.step_on(config, state, ahead_K, grasped, point, pad, most_rate, dt)
        state.time += dt * (state.rate + 0.5 * dt * u)
        state.rate = max(state.rate + dt * u, 0.0)
    state.s = state.time
    governor.smooth(config, state, s.grid, u)
    state.out_time = state.out_s


@part
def slip_speed(config: Any, twist: Any) -> float:
    """Return |S v_s| of a slip twist on the slip axes, turning as a speed at the torsional radius [m/s]."""
    v = spatial(config.slip_axes) * spatial(twist)
    turning = config.radius * v.angular.norm()
    return math.sqrt(v.linear.dot(v.linear) + turning * turning)


@part
def govern(c: Any, s: Any, arm: Any, o: Any, grasped: Held, dt: float, path_speed: float) -> None:
    """Do the governor's cycle: loads, slip samples, planning, and the step on the path.

    Args:
        c, s, o: CONFIG, STATE and OUTPUTS of the cycle.
        arm: ARM.
        grasped: the object, from `held`.
        dt: since the cycle before [s].
        path_speed: how fast the path may be run through for other reasons; 1 = not limited, 0 = come to rest.
    """
    if c.grip.follow != 0:
        squeeze(c, s, dt)
    state, stamp_ns = s.governor, s.joint.answers.stamp_ns
    found = bool(c.cycle.has_observer != 0 and s.observer.sliding != 0)
    share = OBSERVED if found else 1.0
    governor.feel(c.governor, state, s.loads, spatial(o.samples[0].wrench), stamp_ns)
    for k in range(s.queue.count):
        sample = s.queue.samples[k]
        speed = slip_speed(c.governor, sample.twist)
        slip_sample(c.governor.estimate, state.estimate, s.loads, sample.stamp_ns, speed / share, found)
    if c.cycle.has_observer != 0:
        speed = slip_speed(c.governor, s.observer.twist)
        heavy = 0.0 if c.grip.follow != 0 else state.weight_load
        suspect(c.governor.estimate, state.estimate, s.loads, stamp_ns, found, speed, heavy)
    if state.led != 0:  # another arm on the same object has taken the step on the path
        return
    if c.stream.on != 0:
        follow_stream(c, s, arm, grasped, path_speed, dt if dt > 0.0 else 1e-9 * c.cycle.period_ns)
        return
    if c.goals.on != 0 and not take_governed_goal(c, s):
        governor.allow(c.governor, state)  # rests where it is
        return
    if c.goals.on != 0 and s.goal.pending != 0:
        path_speed = 0.0
    for _ in range(SAMPLES_PER_CYCLE):
        if governor.wants_points(state):
            planned = path_at(c, s, governor.wanted_time(c.governor, state))
            governor.next_point(
                c.governor, state, s.grid, grasped, planned.rotation, planned.twist, planned.acceleration
            )
    if (stamp_ns - s.law.start_ns) * 1e-9 < c.cycle.start_s:  # the trajectory rests first
        governor.plan(c.governor, state, s.grid)
        return
    planned = path_at(c, s, state.time)
    pad = governor.Pad(vec(arm.position) - planned.position, mat(arm.rotation), spatial(arm.twist))
    point, most_rate = along_path(c, s, planned, state.time), rate_limit(c, state, path_speed)
    dt = dt if dt > 0.0 else 1e-9 * c.cycle.period_ns
    governor.run(c.governor, state, s.grid, grasped, point, pad, most_rate, dt)
    if c.goals.on != 0:
        judge_governed_goal(c, s)


@part
def governed_reference(c: Any, s: Any) -> Reference:
    """Return the reference where the governor has it."""
    state = s.governor
    planned = at(s.stream, state.out_time) if c.stream.on != 0 else path_at(c, s, state.out_time)
    twist, acceleration = governor.governed(state, along_path(c, s, planned, state.out_time))
    return Reference(planned.position, planned.rotation, twist, acceleration)


@part
def guard(c: Any, s: Any, arm: Any, o: Any, grasped: Held) -> float:
    """Return the factor on a_C with which friction carries the object, and keep what the next cycle needs of it."""
    a_C, a_d, v_ee = spatial(o.law.a_C), spatial(o.law.a_d), spatial(arm.twist)
    if c.law.contacts > 1:
        # What gives way to the internal wrench moves no object; and one arm that holds back alone would pull at it.
        gains = o.gains.gains
        a_C = a_C - gains.kappa * (mat(arm.rotation) @ spatial(o.law.h_int)) / spatial(gains.M_D)
        governor.hold_back(c.governor, s.governor, grasped, mat(arm.rotation), v_ee.angular, a_C, a_d)
        s.governor.guard = 1.0
        return 1.0
    return governor.hold_back(c.governor, s.governor, grasped, mat(arm.rotation), v_ee.angular, a_C, a_d)


@part
def put_governed(c: Any, s: Any, out: Any) -> None:
    """Write what is published of the governor to a GOVERNED."""
    state = s.governor
    out.path_s, out.path_rate, out.guard = state.out_s, state.out_rate, state.guard
    F = state.grip * state.estimate.F_hat
    out.friction_limit, out.friction_events = F, float(state.estimate.events)
    out.load_commanded, out.load_measured = state.commanded, state.measured
    out.given_up = float(s.law.given_up.given_up)
    out.load_ratio, out.friction_share, out.margin = 0.0, 0.0, 0.0
    if F > 0.0:
        out.load_ratio, out.friction_share, out.margin = state.commanded / F, state.measured / F, state.usable / F
    out.stream_waits = waiting(s.stream, state.out_time) if c.stream.on != 0 else 0.0
    out.goal, out.goal_phase = float(s.goal.number), float(s.goal.phase)
    out.goal_progress = goal_progress(c, s) if c.goals.on != 0 else 0.0
    out.slipping = float(state.estimate.slipping)
    out.grip_command, out.grip_force = s.grip.command, s.grip.actual
