"""Goals and references with wild values: whatever was accepted, the arm can be enabled again."""

from __future__ import annotations

import contextlib
import itertools

import numpy as np
import pytest

from slip_core.errors import InputError
from slip_core.types import CartesianReference, PoseGoal
from slip_vic_controller.path.goals import GoalPhase, Refusal
from slip_vic_controller.safety.modes import Mode, Request
from test.support.made_up import MadeUp, N, law_at_work
from test.support.one_arm import OneArm

WILD = (np.nan, np.inf, -1e300, 1e200, 1e30, 1e6, 5e-324, -0.0)
TOGETHER = 8  # wild messages, one after another, before the law has to come back
STILL = {"joint": {"velocity": np.zeros(N)}, "slip": np.zeros(6)}
CALM = {"safety__fallback__evidence": 10.0, "safety__load__drop_speed": 10.0, "safety__inputs__frozen_s": 5.0}
"""An arm that stands still whatever its effort is taken for what it is."""


def recovers(made_up: MadeUp) -> bool:
    """Return whether reset and enable bring the law back, with good inputs and no further reference or goal."""
    session: OneArm = made_up.session
    for request in (Request.HOLD, Request.RESET_FAULT):
        session.request(request)
        made_up.run(5, **STILL)
    made_up.run(1100, **STILL)
    for _ in range(3):
        session.request(Request.ENABLE)
        made_up.run(5, **STILL)
    result = made_up.run(700, **STILL)
    finite = bool(np.isfinite(result.command.effort).all()) and len(result.command.effort) == N
    return result.mode == Mode.ACTIVE and finite


@pytest.mark.parametrize("mode", ["off", "time_optimal"])
def test_after_any_reference_the_law_comes_back_by_enable(mode: str) -> None:
    rng = np.random.default_rng(3)
    made_up = law_at_work(trajectory__kind="topic", governor__mode=mode, **CALM)
    for k, (part, value) in enumerate(itertools.product(("position", "twist", "acceleration", "stamp"), WILD)):
        arm = made_up.run(1, **STILL).arm
        pose, rotation = np.array(arm.position), np.array(arm.rotation)
        twist, acceleration, stamp_ns = np.zeros(6), np.zeros(6), made_up.stamp_ns
        for wild in (pose, twist, acceleration):
            if part == {id(pose): "position", id(twist): "twist", id(acceleration): "acceleration"}[id(wild)]:
                wild[rng.integers(len(wild))] = value
        if part == "stamp":
            stamp_ns = int(rng.choice([2**62, -(2**62), 1, 0]))
        for _ in range(3):
            with contextlib.suppress(InputError):  # what no arm can follow is refused
                made_up.session.set_reference(CartesianReference(pose, rotation, twist, acceleration, stamp_ns))
            made_up.run(5, **STILL)
        if k % TOGETHER < TOGETHER - 1:
            continue
        if mode == "off":  # followed at once, it stays in force: a good one has to come, as every other good input
            good = CartesianReference(np.array(arm.position), rotation, np.zeros(6), np.zeros(6), made_up.stamp_ns)
            made_up.session.set_reference(good)
        assert recovers(made_up), (part, value)


@pytest.mark.parametrize("mode", ["off", "slow_down"])
def test_after_any_goal_the_law_comes_back_by_reset_and_enable(mode: str) -> None:
    made_up = law_at_work(trajectory__kind="goal", governor__mode=mode, **CALM)
    for k, (value, duration_s) in enumerate(itertools.product(WILD, (1e-9, 1.0, 2.0**31))):
        arm = made_up.run(1, **STILL).arm
        pose, rotation = np.array(arm.position), np.array(arm.rotation)
        pose[1] += value
        made_up.session.set_goal(PoseGoal(pose, rotation, duration_s))
        made_up.run(60, **STILL)
        if k % TOGETHER == TOGETHER - 1:
            assert recovers(made_up), (value, duration_s)


def test_a_goal_farther_than_any_arm_reaches_is_refused() -> None:
    made_up = law_at_work(trajectory__kind="goal", governor__mode="slow_down", **CALM)
    made_up.session.set_goal(PoseGoal(np.array([0.0, 0.0, 11.0]), np.eye(3), 1.0))
    made_up.run(2, **STILL)
    goal = made_up.session.task.goal
    assert (goal.pending, goal.refused, goal.refusal, goal.phase) == (0, 1, Refusal.TOO_FAR, GoalPhase.RESTS)


@pytest.mark.parametrize("duration_s", [1e-9, 1e-3, 2.0, 2.0**31])
def test_goal_has_plan_in_first_cycle(duration_s: float) -> None:
    made_up = law_at_work(trajectory__kind="goal", governor__mode="slow_down", governor__friction_limit=50.0, **CALM)
    path, goal = made_up.session.task.governor, made_up.session.task.goal
    pose = np.array(made_up.run(1, **STILL).arm.position) + np.array([0.05, 0.1, 0.0])
    made_up.session.set_goal(PoseGoal(pose, np.eye(3), duration_s))
    made_up.run(1, **STILL)
    assert (path.planned, goal.phase) == (1, GoalPhase.MOVES)
