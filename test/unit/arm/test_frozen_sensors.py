"""Sensors that show nothing new: a driver that repeats itself or sends no numbers, an encoder that has died."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from slip_vic.scenarios.scenario import load
from slip_vic_controller.arm.estimator import JointEstimate, Trust, clear_findings, estimate_joints, remember_input
from slip_vic_controller.safety.conditions import Mode, Reason, Request
from test.support.call import blank, call
from test.support.watched_loop import WatchedLoop, with_joints
from test.unit.arm.test_estimator import MS, N, T, configuration

EVERY = slice(None)
MOVES_MS = {"paper_planar": 1400, "vertical_plane": 1100, "glass_transport": 800}
"""When it fails: while the arm moves."""
UNMEASURED = 0.05
"""Error of a velocity that has not been measured for 0.15 s, where the disturbance is known to 0.3 rad/s^2 [rad/s]."""


class Freezing(WatchedLoop):
    """A closed loop in which joints or the wrench repeat, from a moment on, what they read then, or joints nothing."""

    def __init__(self, drive: str, law: Any, name: str = "paper_planar", *assignments: str) -> None:
        super().__init__(load(name, law=law, drive=drive, sensor="event_1000", set=assignments))
        self.modes, self.kept = [""], None
        self.cycles(MOVES_MS[name])
        self.fastest = 0.0
        del self.modes[:-1]

    def cycles(self, count: int, joints: Any = None, *, finite: bool = True, wrench: bool = False) -> Any:
        """Return the last result; joints: that are frozen, or not finite; wrench: whether it is frozen."""

        def sensed(arm: Any) -> Any:
            kept = self.kept = (self.kept or arm) if joints is not None or wrench else None
            if joints is not None:
                q, qd = arm.joint.position.copy(), arm.joint.velocity.copy()
                q[joints], qd[joints] = kept.joint.position[joints], kept.joint.velocity[joints]
                q[joints] *= 1.0 if finite else np.nan
                arm = with_joints(arm, q, qd)
            pairs = zip(arm.wrenches, kept.wrenches, strict=True) if wrench else ()
            frozen = tuple(replace(now, wrench=before.wrench) for now, before in pairs)
            return arm._replace(wrenches=frozen) if wrench else arm

        for _ in range(count):
            result = self.cycle(sensed)
            said = f"{result.mode.name} {result.reason}".split(":")[0]
            if said != self.modes[-1]:
                self.modes.append(said)
        return result


@pytest.mark.parametrize(
    ("name", "drive", "law", "finite"),
    [
        ("paper_planar", "torque_joint", "vic", True), ("glass_transport", "motor_current", "governed", False),
        ("vertical_plane", "torque_joint", "governed", False), ("glass_transport", "torque_joint", "vic", False),
        ("paper_planar", "motor_current", "governed", True), ("vertical_plane", "velocity_500", "vic", True),
    ],
)  # fmt: skip
def test_unmeasured_arm_comes_to_rest(name: str, drive: str, law: str, finite: bool) -> None:
    """Frozen ones threw it to 17 to 95 rad/s within half a second, by efforts; those without numbers within one."""
    run = Freezing(drive, law, name)
    before = run.speed
    result = run.cycles(1500, EVERY, finite=finite)
    assert run.fastest < max(3.5, 1.5 * before)
    assert run.speed < 0.05
    assert result.mode in (Mode.HOLD, Mode.FAULT)
    what = "joint state is frozen" if finite else "joint state is not finite"
    assert [mode for mode in run.modes if what in mode] == [f"DEGRADED {what}", f"HOLD {what}"]
    assert len(run.modes) <= 5, run.modes


@pytest.mark.parametrize(
    ("joint", "drive"), [(0, "ideal"), (3, "torque_joint"), (0, "motor_current"), (3, "motor_current")]
)
def test_dead_encoder_names_joint(joint: int, drive: str) -> None:
    """The joint went on by its velocity, which was as dead as its position: 3 to 35 rad/s."""
    run = Freezing(drive, "governed")
    result = run.cycles(1500, joint)
    assert result.mode == Mode.FAULT
    name = run.loop.session.arms[0].controller.robot.joint_names[joint]
    assert result.reason == f"{name}: position and velocity are stuck while the joint moves"
    assert run.fastest < 1.0
    assert run.speed < 0.05
    assert len(result.command.numbers) == 0, "the drives hold what nothing measures"
    run.cycles(200)
    assert len(run.cycles(1).command.numbers) == 7
    run.loop.session.request(Request.RESET_FAULT)
    run.cycles(100)
    run.loop.session.request(Request.ENABLE)
    assert run.cycles(1500).mode.follows or run.modes[-1].startswith("HOLD")
    assert run.fastest < 1.5


@pytest.mark.parametrize("drive", ["ideal", "torque_joint", "velocity_500"])
def test_frozen_wrench_latches(drive: str) -> None:
    """The arm rested, so it was not seen any more, and the law began again: to and fro, a hundred times."""
    run = Freezing(drive, "governed", "paper_planar" if drive == "ideal" else "glass_transport")
    assert run.cycles(2500, wrench=True).reason == "wrench is frozen"
    assert run.modes[1:] == ["DEGRADED wrench is frozen", "HOLD wrench is frozen"]
    assert run.slip < 3e-4, "the path has come to rest before"
    run.loop.session.request(Request.ENABLE)
    run.cycles(2500, wrench=True)
    assert len([mode for mode in run.modes if mode == "DEGRADED wrench is frozen"]) == 2, run.modes
    assert run.cycles(1500).mode.follows
    assert run.slip < 3e-4


def sine(k: int) -> tuple[float, float, float]:
    t = k * T
    return 0.3 * math.sin(2.0 * t), 0.6 * math.cos(2.0 * t), -1.2 * math.sin(2.0 * t)


def sampled(frozen: range, joints: Any, steps: int, **values: Any) -> tuple[Any, Any, list[float]]:
    """Return configuration, state and errors of the velocity of joint 1 where joints read the same for some samples."""
    config, state, rng = configuration(**values), blank(JointEstimate), np.random.default_rng(3)
    kept, errors = np.zeros((2, N)), []
    for k in range(steps):
        q, v, a = sine(k)
        z = np.array([q + 2e-5 * rng.normal(size=N), v + 3e-3 * rng.normal(size=N)])
        if k == frozen.start:
            kept = z.copy()
        if k in frozen:
            z[:, joints] = kept[:, joints]
        call(estimate_joints, config, state, k * MS, *z, True)
        errors.append(abs(state.velocity[1] - v))
        call(remember_input, config, state, np.full(N, a))
    return config, state, errors


def test_model_bridges_frozen_joints() -> None:
    _, state, errors = sampled(range(300, 400), EVERY, 700)
    assert max(errors[50:]) < UNMEASURED
    assert state.found.reason == Reason.NONE
    assert not state.unmeasured.any()


def test_stuck_joint_recovers() -> None:
    _, state, errors = sampled(range(300, 450), 1, 450)
    assert (Reason(state.found.reason), state.found.which) == (Reason.STUCK, 1)
    assert [Trust(t) for t in state.trust[:N]] == [Trust.BOTH, Trust.NEITHER, Trust.BOTH]
    assert max(errors[50:]) < UNMEASURED
    _, state, errors = sampled(range(300, 450), 1, 700)
    assert [Trust(t) for t in state.trust[:N]] == [Trust.BOTH] * N
    assert max(errors[50:]) < UNMEASURED
    assert state.found.reason == Reason.STUCK, "until a user resets it"
    call(clear_findings, state)
    assert state.found.reason == Reason.NONE
