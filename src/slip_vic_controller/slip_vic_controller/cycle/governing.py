"""The reference governor in the cycle: its configuration of grasp, path and slip, and the reference that it gives."""

from __future__ import annotations

import math

from slip_core.compiled import part
from slip_core.vectors import NOTHING, mat, spatial, vec
from slip_vic_controller.cycle.sensing import held
from slip_vic_controller.governor import governor
from slip_vic_controller.governor.guard import hold_back
from slip_vic_controller.governor.layouts import FLOOR, PATH_MARGIN, Governor
from slip_vic_controller.governor.load import Held
from slip_vic_controller.governor.plan import GRID_POINTS, Governing, along, along_at, sample_time
from slip_vic_controller.governor.step import Bounds, Pad
from slip_vic_controller.path.goals import (
    GoalPhase,
    begin_goal,
    goal_at,
    goal_progress,
    judge_governed_goal,
    rest_at,
    screen_goal,
    take_governed_goal,
)
from slip_vic_controller.path.paths import Reference, put_reference, reference_at
from slip_vic_controller.path.stream import (
    at,
    drop_passed,
    plan_stream,
    rest_stream,
    stream_bound,
    take_queued,
    waiting,
)
from slip_vic_controller.state import ArmCycle, ControllerConfig, TaskState

CATCH_UP = 1.5
"""How much faster than received a stream may be followed where the timing is free."""


@part
def pad_now(c: ArmCycle) -> Reference:
    """Return the pose of the own pad, at rest."""
    return Reference(vec(c.inputs.arm.position), mat(c.inputs.arm.rotation), NOTHING, NOTHING)


@part
def rest_on_path(c: ArmCycle, held_still: bool) -> None:
    """Continue from rest where the path is; of a stream, where the first pad is.

    After a HOLD (held_still) a reference by topic is where the first pad is, until a new one comes. A goal is continued
    unless it is given up: after a reset, and where the law could not be evaluated on the way, so that the arm can be
    enabled again whatever the goal was.
    """
    config, task, here = c.config, c.task, pad_now(c)
    if config.follows_stream != 0:
        rest_stream(task.stream, here.position, here.rotation)
    task.governor.rate = 0.0
    governor.steady(config.governor, task.governor)
    if held_still:
        if task.reference_known != 0:
            put_reference(task.reference, here)
        if task.forgets != 0 and config.follows_goals != 0:
            rest_at(task.goal, here)
            governor.start_path(config.governor, task.governor)
        task.forgets = 0


@part
def yield_to(c: ArmCycle) -> None:
    """Move the path to the pad, so that nothing pulls the pad back while a hand moves it."""
    config, task, here = c.config, c.task, pad_now(c)
    if config.follows_goals != 0:
        rest_at(task.goal, here)
        governor.start_path(config.governor, task.governor)
    else:
        task.reference_known = 1
        put_reference(task.reference, here)


@part
def path_at(c: ArmCycle, time: float) -> Reference:
    """Return the trajectory as planned at its own time [s]: the built-in one, the stream, or the way to the goal."""
    if c.config.follows_stream != 0:
        return at(c.task.stream, time)
    if c.config.follows_goals != 0:
        return goal_at(c.task.goal, time)
    return reference_at(c.config.path, time, c.state.law.start_position, c.state.law.start_rotation)


@part
def screen(config: ControllerConfig, task: TaskState, at_work: bool) -> None:
    """Refuse the goal that waits where it cannot be begun."""
    if config.follows_goals != 0:
        screen_goal(config.governor, task.goal, goal_at(task.goal, task.governor.out_time), at_work)


@part
def follow_goal(task: TaskState, now_ns: int) -> Reference:
    """Return the reference towards the goal, not governed: a new one continues from the reference, with its motion."""
    goal, path = task.goal, task.governor
    path.out_time = (now_ns - task.start_ns) * 1e-9
    reference = goal_at(goal, path.out_time)
    if goal.pending != 0:
        begin_goal(goal, reference)
        goal.phase, task.start_ns = GoalPhase.MOVES.value, now_ns
        path.out_time, path.duration = 0.0, goal.path.knot[1]
    elif goal.phase == GoalPhase.MOVES and path.out_time >= path.duration:
        goal.phase = GoalPhase.REACHED.value
    return reference


@part
def rate_limit(path: Governor, path_speed: float) -> float:
    """Return the largest sdot for other reasons; 0 = come to rest."""
    return math.inf if path_speed >= 1.0 else path_speed * max(path.rate, FLOOR)


@part
def seen_from(c: ArmCycle, planned: Reference) -> Pad:
    """Return the first pad as seen from a point of its path."""
    arm, x = c.inputs.arm, vec(c.inputs.arm.position) - planned.position
    return Pad(x, mat(arm.rotation), spatial(arm.twist), spatial(c.state.pad.feedback))


@part
def step_on_path(c: ArmCycle, path_speed: float) -> None:
    """Do the path's cycle: planning, and the step on the path of the first pad; c: of the first arm.

    path_speed: how fast the path may be followed for other reasons; 1 = not limited, 0 = come to rest.
    """
    config, task, state = c.config, c.task, c.state
    dt = (state.joint.answers.stamp_ns - state.law.stamp_ns) * 1e-9
    dt = dt if dt > 0.0 else 1e-9 * config.period_ns
    grasped = held(config, state, c.outputs.gains)
    if config.follows_stream != 0:
        follow_stream(c, grasped, path_speed, dt)
    elif config.follows_goals != 0 and not take_governed_goal(config.governor, task.governor, task.goal):
        governor.allow(config.governor, task.governor)  # rests where it is
    else:
        follow_path(c, grasped, path_speed, dt)


@part
def follow_stream(c: ArmCycle, grasped: Held, path_speed: float, dt: float) -> None:
    """Take the samples of a governed stream, find how fast it may be followed, and take the step on it."""
    config, task, state = c.config, c.task, c.state
    path, stream, limits_of = task.governor, task.stream, config.governor
    governor.allow(limits_of, path)
    catch_up = CATCH_UP if limits_of.mode == Governing.TIME_OPTIMAL else 1.0
    limits = catch_up, limits_of.most_speed, limits_of.most_turning
    if take_queued(stream, path, grasped, limits, limits_of.preview_s, state.joint.answers.stamp_ns):
        governor.steady(limits_of, path)
    if stream.count == 0:
        path.rate = 0.0
        return
    drop_passed(stream, path.out_time)
    plan_stream(stream, PATH_MARGIN * path.usable, limits_of.reserve, limits_of.preview_s)
    now, K, ahead = at(stream, path.s), stream_bound(stream, path.s)[0], stream_bound(stream, path.s + dt * path.rate)
    most_rate, last = min(rate_limit(path, path_speed), catch_up), stream.points[stream.count - 1].time
    bounds = Bounds(K, ahead[0], ahead[1], most_rate, 1.0, stream.points[0].time, max(last, path.s))
    governor.follow(limits_of, path, bounds, grasped, along_at(now, 1.0, 0.0), seen_from(c, now), dt)
    path.time, path.out_time = path.s, path.out_s


@part
def follow_path(c: ArmCycle, grasped: Held, path_speed: float, dt: float) -> None:
    """Plan the built-in path or that of a goal, and take the step on it; c: of the first arm."""
    config, task, state, path = c.config, c.task, c.state, c.task.governor
    if config.follows_goals != 0 and task.goal.pending != 0:
        path_speed = 0.0
    if path.planned == 0:
        for i in range(GRID_POINTS):
            there = path_at(c, sample_time(config.governor.mode, i, path.duration))
            governor.sample_point(config.governor, path, task.grid, i, grasped, there)
    if (state.joint.answers.stamp_ns - task.start_ns) * 1e-9 < config.start_s:  # the trajectory rests first
        governor.plan(config.governor, path, task.grid)
        return
    planned = path_at(c, path.time)
    point, limit = along(config.governor, path.duration, path.time, planned), rate_limit(path, path_speed)
    governor.run(config.governor, path, task.grid, grasped, point, seen_from(c, planned), limit, dt)
    if config.follows_goals != 0:
        judge_governed_goal(config.governor, path, task.goal)


@part
def governed_reference(c: ArmCycle) -> Reference:
    """Return the reference of a pad where the governor has the path, which is that of the first pad."""
    config, path = c.config, c.task.governor
    planned = path_at(c, path.out_time)
    if c.lead:
        point = along(config.governor, path.duration, path.out_time, planned)
        path.out_speed, path.out_bend = point.speed, point.bend
    else:
        point = along_at(planned, path.out_speed, path.out_bend)
    twist, acceleration = governor.governed(config.governor, path, point)
    return Reference(planned.position, planned.rotation, twist, acceleration)


@part
def guard(c: ArmCycle, grasped: Held) -> float:
    """Return the factor on a_C with which friction carries the object, and store it for the next cycle."""
    config, outputs, arm, path = c.config, c.outputs, c.inputs.arm, c.task.governor
    a_C, a_d, v_ee = spatial(outputs.law.a_C), spatial(outputs.law.a_d), spatial(arm.twist)
    R, pad = mat(arm.rotation), c.state.pad
    # Without compensation the impedance drags at an object that has overrun its path, the more the farther it is off.
    slides = pad.contact.slipping != 0 and (config.governor.led == 0 or path.overrun == 0)
    if config.law.contacts > 1:
        # Yielding to the internal wrench moves no object; and one arm that holds back alone would pull at it.
        gains = outputs.gains.gains
        a_C = a_C - gains.kappa * (R @ spatial(outputs.law.h_int)) / spatial(gains.M_D)
    factor = hold_back(config.governor, path.ceiling, pad, grasped, R, v_ee.angular, a_C, a_d, slides)
    if config.law.contacts > 1:
        pad.guard = factor = 1.0
    return factor


@part
def put_governed(c: ArmCycle) -> None:
    """Write the governor's published numbers."""
    config, task, state, out = c.config, c.task, c.state, c.outputs.governor
    path, pad = task.governor, state.pad
    out.path_s, out.path_rate, out.guard = path.out_s, path.out_rate, pad.guard
    F = pad.grip * path.contact.F_median
    out.friction_limit, out.friction_events = F, float(pad.friction.events)
    out.load_commanded, out.load_measured = pad.commanded, pad.measured
    out.given_up = 1.0 if state.law.given_up.left_s > 0.0 else 0.0
    out.limit, out.load_ratio, out.friction_share, out.margin = float(path.limit), 0.0, 0.0, 0.0
    if F > 0.0:
        out.load_ratio, out.friction_share, out.margin = pad.commanded / F, pad.measured / F, path.usable / F
    out.stream_waits = waiting(task.stream, path.out_time) if config.follows_stream != 0 else 0.0
    out.goal, out.goal_phase = float(task.goal.number), float(task.goal.phase)
    out.goal_progress = goal_progress(path, task.goal) if config.follows_goals != 0 else 0.0
    out.slipping = float(path.contact.slipping)
    out.grip_command, out.grip_force = state.grip.command, state.grip.actual
