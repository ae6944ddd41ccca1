"""Goals by users: a pose and a duration become a quintic from where the reference is.

Under the governor the pad first comes to rest on its path, as friction admits, and the new path is planned from there,
so there is always a motion that friction carries. Without a governor the quintic begins with the velocity and
acceleration of the reference.
"""

from __future__ import annotations

from enum import IntEnum, unique

from slip_core.compiled import part
from slip_core.records import Mat3, Real, Record, Vec3, Whole
from slip_core.vectors import Spatial, mat, put, put_mat, put_spatial, vec
from slip_vic_controller.governor.governor import start_path
from slip_vic_controller.governor.layouts import PATH_MARGIN, Governor, GovernorConfig
from slip_vic_controller.governor.plan import Governing
from slip_vic_controller.law.rotation import logarithm
from slip_vic_controller.path.paths import Path, PathKind, Reference, put_quintic, reference_at, rising, standing


@unique
class GoalPhase(IntEnum):
    """State of the goal that was taken last."""

    RESTS = 0
    STOPS = 1
    PLANS = 2
    MOVES = 3
    REACHED = 4


@unique
class Refusal(IntEnum):
    """Why a goal is refused."""

    NO = 0
    NOT_AT_WORK = 1
    TOO_HEAVY = 2
    TOO_FAST = 3
    TURNS_TOO_FAST = 4
    TOO_FAR = 5


class Goal(Record):
    """The newest goal, and the motion towards the one under way; {w}."""

    received: Whole  # number of goals received, and of the newest
    pending: Whole  # whether it waits to begin
    number: Whole  # of the one under way
    phase: Whole  # its GoalPhase
    refused: Whole  # number of the last that was refused
    refusal: Whole  # why: Refusal
    where: Real  # s; on its path
    value: Real
    limit: Real
    to_position: Vec3  # m; of the newest goal
    to_rotation: Mat3
    duration: Real  # s
    position: Vec3  # m; where the motion begins
    rotation: Mat3
    path: Path  # relative to that pose


FARTHEST = 10.0
"""Distance to a goal beyond the reach of any arm: an error of a unit or a frame [m]."""


@part
def goal_at(goal: Goal, time: float) -> Reference:
    """Return the motion towards a GOAL at a time of its path [s]."""
    return reference_at(goal.path, time, goal.position, goal.rotation)


@part
def rest_at(goal: Goal, reference: Reference) -> None:
    """Rest at the pose of a reference."""
    put(goal.position, reference.position)
    put_mat(goal.rotation, reference.rotation)
    goal.path.kind, goal.phase, goal.path.knot[1] = PathKind.HOLD.value, GoalPhase.RESTS.value, 1.0


@part
def begin_goal(goal: Goal, now: Reference) -> None:
    """Begin the goal that waits, from a reference and with its motion."""
    put(goal.position, now.position)
    put_mat(goal.rotation, now.rotation)
    way = Spatial(
        vec(goal.to_position) - now.position, logarithm(mat(goal.to_rotation) @ mat(goal.rotation).T())
    )  # fmt: skip
    path, h = goal.path, float(goal.duration)
    path.kind, path.segments, path.knot[0], path.knot[1] = PathKind.POLYNOMIALS.value, 1, 0.0, h
    for i in range(3):
        moves = 0.0, now.twist.linear[i], now.acceleration.linear[i]
        turns = 0.0, now.twist.angular[i], now.acceleration.angular[i]
        put_quintic(path.polynomial[0, i], h, moves, (way.linear[i], 0.0, 0.0))
        put_quintic(path.polynomial[0, 3 + i], h, turns, (way.angular[i], 0.0, 0.0))
    put_spatial(path.end, way)
    goal.number, goal.pending = goal.received, 0


@part
def screen_goal(limits: GovernorConfig, goal: Goal, now: Reference, at_work: bool) -> None:
    """Refuse a goal that waits and cannot be begun; now: where the reference is.

    The governor slows down what is too fast; without it such a goal is refused.
    """
    if goal.pending == 0:
        return
    way, turn = (vec(goal.to_position) - now.position).norm(), mat(goal.to_rotation) @ now.rotation.T()
    peak = rising(0.5)[2] / goal.duration  # of a quintic from rest to rest
    speed, turning = peak * way, peak * logarithm(turn).norm()
    why, value, limit, kept = Refusal.NO.value, 0.0, 0.0, limits.mode != Governing.OFF
    if not at_work:
        why = Refusal.NOT_AT_WORK.value
    elif not way <= FARTHEST:
        why, value, limit = Refusal.TOO_FAR.value, way, FARTHEST
    elif not kept and speed > limits.most_speed:
        why, value, limit = Refusal.TOO_FAST.value, speed, float(limits.most_speed)
    elif not kept and turning > limits.most_turning:
        why, value, limit = Refusal.TURNS_TOO_FAST.value, turning, float(limits.most_turning)
    if why != Refusal.NO:
        goal.pending, goal.refused, goal.refusal = 0, goal.received, why
        goal.where, goal.value, goal.limit = 0.0, value, limit


# -- governed ------------------------------------------------------------------------------------------


@part
def take_governed_goal(limits: GovernorConfig, path: Governor, goal: Goal) -> bool:
    """Begin the goal that waits, once the pad is at rest; return whether there is a path to follow."""
    if goal.pending != 0:
        if goal.phase == GoalPhase.RESTS or (path.rate == 0.0 and path.out_rate == 0.0):
            begin_goal(goal, standing(goal_at(goal, path.out_time)))
            path.duration, goal.phase = goal.path.knot[1], GoalPhase.PLANS.value
            start_path(limits, path)
        else:
            goal.phase = GoalPhase.STOPS.value
    return bool(goal.phase != GoalPhase.RESTS)


@part
def judge_governed_goal(limits: GovernorConfig, path: Governor, goal: Goal) -> None:
    """Refuse a goal whose path is too heavy for friction, and mark the one that is reached."""
    if goal.phase == GoalPhase.PLANS and path.planned != 0:
        goal.phase = GoalPhase.MOVES.value
        if path.infeasible != 0:
            goal.refused, goal.refusal, goal.where = goal.number, Refusal.TOO_HEAVY.value, path.heaviest_time
            goal.value, goal.limit = path.weight_load, PATH_MARGIN * path.plan_load
            rest_at(goal, standing(goal_at(goal, 0.0)))
            start_path(limits, path)
    elif goal.phase == GoalPhase.MOVES and path.arrived != 0 and path.out_rate == 0.0:
        goal.phase = GoalPhase.REACHED.value


@part
def goal_progress(path: Governor, goal: Goal) -> float:
    """Return which share of the time of its path has passed."""
    if goal.phase == GoalPhase.STOPS or goal.phase == GoalPhase.MOVES:
        return min(max(path.out_time / path.duration, 0.0), 1.0)
    return 1.0 if goal.phase == GoalPhase.REACHED else 0.0
