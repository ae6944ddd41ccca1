"""Goals and references with wild values: whatever was accepted, the arm can be enabled again."""

from __future__ import annotations

import contextlib
import itertools

import numpy as np
import pytest

from slip_core.errors import InputError
from slip_core.types import CartesianReference, PoseGoal
from slip_vic_controller.safety.conditions import Mode, Reason, Request
from test.support.made_up import MadeUp, N, law_at_work
from test.support.one_arm import OneArm

WILD = (np.nan, np.inf, -1e300, 1e200, 1e30, 1e6, 5e-324, -0.0)
TOGETHER = 8  # wild messages, one after another, before the law has to come back
STILL = {"joint": {"velocity": np.zeros(N)}, "slip": np.zeros(6)}
CALM = {"safety__load__drop_speed": 10.0, "safety__inputs__frozen_s": 5.0}
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
    finite = bool(np.isfinite(result.command.numbers).all()) and len(result.command.numbers) == N
    runs = result.mode == Mode.ACTIVE or result.record.mode.reason.reason == Reason.HAND  # the wrench is made up
    return runs and finite


@pytest.mark.parametrize("mode", ["off", "time_optimal"])
def test_recovers_after_any_reference(mode: str) -> None:
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
def test_recovers_after_any_goal(mode: str) -> None:
    made_up = law_at_work(trajectory__kind="goal", governor__mode=mode, **CALM)
    for k, (value, duration_s) in enumerate(itertools.product(WILD, (1e-9, 1.0, 2.0**31))):
        arm = made_up.run(1, **STILL).arm
        pose, rotation = np.array(arm.position), np.array(arm.rotation)
        pose[1] += value
        made_up.session.set_goal(PoseGoal(pose, rotation, duration_s))
        made_up.run(60, **STILL)
        if k % TOGETHER == TOGETHER - 1:
            assert recovers(made_up), (value, duration_s)
