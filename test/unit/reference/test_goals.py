"""A goal begun in motion: the path leaves with the motion that there is, and ends at rest at the goal."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial
from scipy.spatial.transform import Rotation

from slip_core.records import new, record
from slip_core.vectors import Spatial, mat, vec
from slip_vic_controller.reference.goals import GOAL, begin_goal
from slip_vic_controller.reference.paths import Reference

DURATION_S = 1.7
ROUNDING = 1e-12


def test_a_goal_is_reached_at_rest_from_any_motion() -> None:
    rng = np.random.default_rng(2)
    position, velocity, acceleration, way = rng.normal(size=(4, 6))
    rotation, turn = (Rotation.from_rotvec(each) for each in (position[3:], 0.5 * way[3:]))
    goal = record(new(GOAL), GOAL)
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
