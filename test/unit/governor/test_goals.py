"""A goal begun in motion: the path leaves with the motion that there is, and ends at rest at the goal in time."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial
from scipy.spatial.transform import Rotation

from slip_core.types import PoseGoal
from slip_core.vectors import Spatial, mat, spatial, vec
from slip_vic_controller.path.goals import Goal, GoalPhase, begin_goal, goal_at, goal_progress, rest_at
from slip_vic_controller.path.paths import Reference
from test.support.call import blank, call
from test.support.made_up import MadeUp, law_at_work

DURATION_S = 1.7
ROUNDING = 1e-12


def test_goal_reached_from_any_motion() -> None:
    rng = np.random.default_rng(2)
    position, velocity, acceleration, way = rng.normal(size=(4, 6))
    rotation, turn = (Rotation.from_rotvec(each) for each in (position[3:], 0.5 * way[3:]))
    goal = blank(Goal)
    goal.received, goal.pending, goal.duration = 3, 1, DURATION_S
    goal.to_position = position[:3] + way[:3]
    goal.to_rotation = (turn * rotation).as_matrix()
    twist, second = (Spatial(vec(each[:3]), vec(each[3:])) for each in (velocity, acceleration))
    begin_goal(goal, Reference(vec(position[:3]), mat(rotation.as_matrix()), twist, second))
    assert (goal.number, goal.pending) == (3, 0)
    wanted = np.concatenate((way[:3], 0.5 * way[3:]))
    for i in range(6):
        curve = Polynomial(goal.path.polynomial[0, i])
        begin = [curve.deriv(k)(0.0) if k else curve(0.0) for k in range(3)]
        end = [curve.deriv(k)(DURATION_S) if k else curve(DURATION_S) for k in range(3)]
        np.testing.assert_allclose(begin, [0.0, velocity[i], acceleration[i]], atol=ROUNDING)
        np.testing.assert_allclose(end, [wanted[i], 0.0, 0.0], atol=100 * ROUNDING)
    np.testing.assert_allclose(goal.path.end[:6], wanted, atol=ROUNDING)


def at_work(mode: str) -> MadeUp:
    """Return a controller of goals; an arm that stays where it is is no finding here."""
    calm = {"load__drop_speed": 1e3, "limits__error_linear": 100.0}
    return law_at_work(
        trajectory__kind="goal", governor__mode=mode, governor__friction_limit=50.0,
        **{f"safety__{name}": value for name, value in calm.items()},
    )  # fmt: skip


def give(made_up: MadeUp, way: np.ndarray, ms: int) -> np.ndarray:
    """Give a goal that is so far from the pad [m]; return its position."""
    result = made_up.cycle(slip=np.zeros(6))
    pose = result.record.reference
    made_up.session.set_goal(PoseGoal(np.array(pose.position) + way, np.array(pose.rotation), ms * 1e-3))
    return np.array(pose.position)


def test_ungoverned_goal_is_quintic() -> None:
    made_up, way, ms = at_work("off"), np.array([0.0, 0.004, -0.002]), 40
    began = give(made_up, way, ms)
    goal = made_up.session.task.goal
    for k in range(ms + 5):  # it begins in the first of these cycles
        result = made_up.cycle(slip=np.zeros(6))
        x = min(k / ms, 1.0)
        value, rate = x**3 * (10.0 - 15.0 * x + 6.0 * x * x), 30.0 * x * x * (1.0 - x) ** 2
        np.testing.assert_allclose(result.record.reference.position, began + value * way, atol=ROUNDING)
        np.testing.assert_allclose(result.record.reference.twist[:3], 1e3 / ms * rate * way, atol=1e-9)
        assert goal.phase == (GoalPhase.MOVES if k < ms else GoalPhase.REACHED)
        assert abs(result.scalars()["goal_progress"] - x) < 1e-9


def test_governed_goal_progress() -> None:
    made_up = at_work("slow_down")
    task = made_up.session.task
    task.governor.duration, task.goal.path.knot[1] = 4.0, 4.0
    for time, phase, expected in (
        (0.0, GoalPhase.PLANS, 0.0), (1.0, GoalPhase.MOVES, 0.25), (3.0, GoalPhase.STOPS, 0.75),
        (3.0, GoalPhase.PLANS, 0.0), (4.0, GoalPhase.REACHED, 1.0), (1.0, GoalPhase.RESTS, 0.0),
        (1.0, GoalPhase.REACHED, 1.0),
    ):  # fmt: skip
        task.governor.out_time, task.goal.phase = time, phase
        assert call(goal_progress, task.governor, task.goal) == expected, (time, phase)


def test_resting_goal_keeps_pose() -> None:
    goal, turned = blank(Goal), Rotation.from_rotvec((0.1, -0.2, 0.3)).as_matrix()
    goal.position[:] = 9.0
    moving = spatial(np.ones(6))
    rest_at(goal, Reference(vec((0.1, 0.2, 0.3)), mat(turned), moving, moving))
    assert goal.phase == GoalPhase.RESTS
    for time in (0.0, 0.5, 7.0):
        there = goal_at(goal, time)
        assert (there.position.x, there.position.y, there.position.z) == (0.1, 0.2, 0.3)
        assert (there.twist.linear.norm(), there.acceleration.angular.norm()) == (0.0, 0.0)
    np.testing.assert_array_equal(goal.rotation, turned)
