"""Commands of velocities and positions in the control cycle: what they are made of, their limits, and how they end."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from slip_core.arrays import Array
from slip_core.types import JointSample, SlipSample, WrenchSample
from slip_vic.run.in_process import ClosedLoop
from slip_vic.scenarios.scenario import load
from slip_vic_controller.arm.command import SHARE
from slip_vic_controller.config.controller import Controller
from slip_vic_controller.safety.conditions import Mode, Request
from slip_vic_controller.session.cycle_result import CycleResult
from test.support.one_arm import OneArm, one_arm

PERIOD, MS = 1e-3, 1_000_000
ACCELERATION = 10.0
ROUNDING = 1e-9
KINDS = {"velocity_500": "velocity", "position_250": "position"}


class Run:
    """A closed loop with what it commanded."""

    def __init__(self, name: str, drive: str, *assignments: str) -> None:
        self.loop = ClosedLoop(load(name, law="governed", drive=drive, seed=3, set=assignments))
        self.commands: list[Array] = []

    def cycles(self, count: int) -> CycleResult:
        for _ in range(count):
            result = self.loop.answer(self.loop.bridge.observe())[0]
            self.commands.append(result.command.numbers)
            self.loop.bridge.advance([result.command])
        return result


@pytest.mark.parametrize("drive", tuple(KINDS))
def test_commands_keep_limits(drive: str) -> None:
    run = Run("paper_planar", drive)
    result = run.cycles(700)
    assert result.command.interface == KINDS[drive]
    assert result.mode == Mode.ACTIVE
    moving = run.loop.bridge.simulation.observe(0).joint.velocity
    assert np.abs(moving).max() > 0.05
    run.loop.session.request(Request.HOLD)
    assert run.cycles(1500).mode == Mode.HOLD
    commands = np.array(run.commands)
    velocity = commands if drive == "velocity_500" else np.diff(commands, axis=0) / PERIOD
    assert np.abs(np.diff(velocity, axis=0)).max() <= ACCELERATION * PERIOD + ROUNDING
    assert not velocity[-1].any()
    assert np.abs(run.loop.bridge.simulation.observe(0).joint.velocity).max() < 1e-6


def test_command_integrates_acceleration() -> None:
    run = Run("paper_planar", "velocity_500")
    before, checked, n = run.cycles(600), 0, 7
    last = np.array(run.loop.session.arms[0].state.sent.acceleration[:n])
    for _ in range(100):
        outputs = run.loop.bridge.observe()
        result = run.loop.answer(outputs)[0]
        (wrench,) = outputs.arms[0].wrenches
        arm, R = result.arm, np.array(result.arm.rotation)
        h = np.concatenate((R @ wrench.wrench[:3], R @ wrench.wrench[3:]))
        M, bias, J = np.array(arm.M)[:n, :n], np.array(arm.bias)[:n], np.array(arm.J)[:, :n]
        qdd = np.linalg.solve(M, result.effort + J.T @ h - bias)
        made = (result.command.numbers - before.command.numbers) / PERIOD
        inside = (np.abs(qdd) < ACCELERATION) & (np.abs(qdd - last) < SHARE * ACCELERATION)
        np.testing.assert_allclose(made[inside], qdd[inside], rtol=1e-7, atol=1e-7)
        checked, last, before = checked + int(inside.sum()), made, result
        run.loop.bridge.advance([result.command])
    assert checked > 350


NO_TARE = "controller.tare.duration_s=0"


@pytest.fixture(scope="module")
def realtime() -> Controller:
    scenario = load("paper_planar", law="governed", mode="realtime", drive="velocity_500", set=(NO_TARE,))
    return one_arm(scenario.controller, scenario.urdf, lockstep=False)


HOME = np.array(load("paper_planar", law="vic").bridge.initial_position)


def feed(session: OneArm, k: int, velocity: float) -> Any:
    """Give one set of inputs at k ms of an arm whose first joint moves."""
    q, qd = HOME.copy(), np.zeros(7)
    q[0], qd[0] = q[0] + 1e-3 * k * velocity, velocity
    session.add_wrench(0, WrenchSample(k * MS, np.array([1e-3 * (k % 7), 0.0, 4.9, 0.0, 0.0, 0.0])), k * MS)
    session.add_slip(0, SlipSample(k * MS, np.zeros(6), valid=True), k * MS)
    session.add_joint(JointSample(k * MS, q, qd, np.zeros(7)), k * MS)
    return session.cycle(k * MS)


def test_watchdog_stops_the_command(realtime: Controller) -> None:
    session = OneArm(realtime)
    for k in range(1, 60):
        result = feed(session, k, 0.2)
    assert result.mode.follows
    session.state.sent.velocity[0] = 0.2
    speeds, now = [0.2], 59
    for _ in range(200):
        now += 5
        answered = session.watchdog(now * MS)
        if answered is not None:
            speeds.append(float(answered.command.numbers[0]))
    assert session.mode == Mode.HOLD
    assert speeds[-1] == 0.0
    assert (np.diff(speeds) <= 0.0).all()
    assert np.abs(np.diff(speeds)).max() <= ACCELERATION * 5 * PERIOD + ROUNDING


@pytest.mark.parametrize("pause_ms", [20, 40, 70])
@pytest.mark.parametrize("drive", tuple(KINDS))
def test_pause_keeps_step_limit(drive: str, pause_ms: int) -> None:
    """At 250 Hz, in motion at 1.5 rad/s, the joint state silent from the pause on: the watchdog's command."""
    slow = tuple(f"{node}.control_period_s=0.004" for node in ("controller", "bridge"))
    scenario = load("paper_planar", law="vic", mode="realtime", drive=drive, set=(NO_TARE, *slow))
    session = OneArm(one_arm(scenario.controller, scenario.urdf, lockstep=False))
    for k in range(1, 15):
        before = feed(session, 4 * k, 0.2)
    session.state.sent.velocity[0] = 1.5
    after = session.failed((56 + pause_ms) * MS)
    assert after.command.interface == KINDS[drive]
    first = 1.5 if drive == "velocity_500" else before.command.numbers[0]
    step = abs(after.command.numbers[0] - first)
    assert 0.0 < step <= 5 * PERIOD * (ACCELERATION if drive == "velocity_500" else 1.5) + ROUNDING
