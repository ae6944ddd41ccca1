"""Sensors that show nothing new: a driver that repeats itself or sends no numbers, an encoder that has died."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from slip_core.records import new, record
from slip_vic.scenarios.scenario import load_scenario
from slip_vic_controller.arm.disturbance import oppose_disturbance
from slip_vic_controller.arm.estimator import estimate_joints, remember_input
from slip_vic_controller.arm.joint_estimate import JOINT_ESTIMATE, Finding, Trust, clear_findings
from slip_vic_controller.arm.plausibility import BLIND_S, is_blind
from slip_vic_controller.safety.modes import Mode, Request
from test.support.call import call
from test.support.failing_sensors import MOVES_MS, wrench_frozen
from test.support.watched_loop import WatchedLoop, with_joints
from test.unit.arm.test_estimator import MS, N, T, configuration

EVERY = slice(None)
UNMEASURED = 0.05
"""Error of a velocity that has not been measured for 0.15 s, where the disturbance is known to 0.3 rad/s^2 [rad/s]."""


class Freezing(WatchedLoop):
    """A closed loop in which joints or the wrench repeat, from a moment on, what they read then, or joints nothing."""

    def __init__(self, drive: str, law: Any, name: str = "paper_planar", *assignments: str) -> None:
        super().__init__(load_scenario(name, law=law, drive=drive, sensor="event_1000", assignments=assignments))
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
            return wrench_frozen(arm, kept) if wrench else arm

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
def test_an_arm_whose_joint_states_show_nothing_comes_to_rest(name: str, drive: str, law: str, finite: bool) -> None:
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


@pytest.mark.parametrize("drive", ["ideal", "torque_joint", "velocity_500"])
def test_what_is_frozen_for_long_gets_no_command_and_goes_on_when_it_moves_again(drive: str) -> None:
    run = Freezing(drive, "governed", "glass_transport")
    assert len(run.cycles(400, EVERY).command.numbers) == 7
    assert len(run.cycles(700, EVERY).command.numbers) == 0
    run.loop.session.request(Request.ENABLE)
    result = run.cycles(200, EVERY)
    assert (result.mode, len(result.command.numbers)) == (Mode.HOLD, 0), "whoever enables it"
    assert run.cycles(2000).mode.follows


@pytest.mark.parametrize(
    ("joint", "drive"), [(0, "ideal"), (3, "torque_joint"), (0, "motor_current"), (3, "motor_current")]
)
def test_an_encoder_that_dies_is_a_fault_with_its_name_and_the_arm_rests(joint: int, drive: str) -> None:
    """The joint went on by its velocity, which was as dead as its position: 3 to 35 rad/s."""
    run = Freezing(drive, "governed")
    result = run.cycles(1500, joint)
    assert result.mode == Mode.FAULT
    name = run.loop.controller.controller.robot.joint_names[joint]
    assert result.reason == f"{name}: its position and velocity are stuck, though it moves"
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
def test_a_wrench_that_is_frozen_stays_so_until_it_changes_or_a_user_says_it_is_right(drive: str) -> None:
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
    config, state, rng = configuration(**values), record(new(JOINT_ESTIMATE), JOINT_ESTIMATE), np.random.default_rng(3)
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


def test_the_model_goes_on_where_all_joints_read_the_same() -> None:
    config, state, errors = sampled(range(300, 400), EVERY, 700)
    assert max(errors[50:]) < UNMEASURED
    assert state.finding == Finding.NONE
    assert not state.unmeasured.any()
    assert not call(is_blind, config, state)


def test_a_joint_that_reads_the_same_is_stuck_and_measured_again_when_it_does_not() -> None:
    _, state, errors = sampled(range(300, 450), 1, 450)
    assert (Finding(state.finding), state.joint) == (Finding.STUCK, 1)
    assert [Trust(t) for t in state.trust[:N]] == [Trust.BOTH, Trust.NEITHER, Trust.BOTH]
    assert max(errors[50:]) < UNMEASURED
    _, state, errors = sampled(range(300, 450), 1, 700)
    assert [Trust(t) for t in state.trust[:N]] == [Trust.BOTH] * N
    assert max(errors[50:]) < UNMEASURED
    assert state.finding == Finding.STUCK, "until a user resets it"
    call(clear_findings, state)
    assert state.finding == Finding.NONE


@pytest.mark.parametrize("joints", [1, EVERY])
def test_it_is_blind_after_half_a_second(joints: Any) -> None:
    periods = round(BLIND_S / T)
    for more, blind in ((0, False), (1, True)):
        config, state, _ = sampled(range(100, 2000), joints, 101 + periods + more)
        assert bool(call(is_blind, config, state)) is blind


def test_a_sensor_slower_than_the_cycle_repeats_itself_and_is_measured() -> None:
    """The same bits as ever while it does not repeat itself for longer than that."""
    config, state = configuration(joint_sensor__rate_hz=250.0), record(new(JOINT_ESTIMATE), JOINT_ESTIMATE)
    rng, z = np.random.default_rng(3), np.zeros((2, N))
    for k in range(400):
        if k % 4 == 0:
            q, v, _ = sine(k)
            z = np.array([q + 2e-5 * rng.normal(size=N), v + 3e-3 * rng.normal(size=N)])
        call(estimate_joints, config, state, k * MS, *z, True)
        call(remember_input, config, state, np.full(N, sine(k)[2]))
        assert state.unmeasured.max() < 4
    assert state.finding == Finding.NONE


def rested(quantum: float, frozen_from: int, *, turns: int) -> tuple[Any, int]:
    """Return the state, and the sample at which joint 1 is found, which rests and reads the same from a sample on.

    quantum: of positions, and its tenfold a second of velocities; noise is a fifth of that, or that of the sensor
    without one. turns: how often joint 1 moves to and fro before it rests.
    """
    config, rng = configuration(), np.random.default_rng(5)
    state, kept, found = record(new(JOINT_ESTIMATE), JOINT_ESTIMATE), np.zeros(2), -1
    for k in range(frozen_from + 400):
        t, q, v = k * T, np.zeros(N), np.zeros(N)
        q[:], v[:] = 0.2 * math.sin(3.0 * t), 0.6 * math.cos(3.0 * t)
        moves = k < frozen_from - 200 and turns > 0
        w = 2.0 * math.pi * turns / max((frozen_from - 200) * T, T)
        if moves:
            q[1], v[1] = 0.1 * (1.0 - math.cos(w * t)), 0.1 * w * math.sin(w * t)
        else:
            q[1] = v[1] = 0.0
        noise = (0.2 * quantum, 2.0 * quantum) if quantum else (2e-5, 3e-3)
        z = np.array([q + noise[0] * rng.normal(size=N), v + noise[1] * rng.normal(size=N)])
        if quantum:
            z = np.round(z / [[quantum], [10.0 * quantum]]) * [[quantum], [10.0 * quantum]]
        kept = z[:, 1].copy() if k == frozen_from else kept
        if k >= frozen_from:
            z[:, 1] = kept
        call(estimate_joints, config, state, k * MS, *z, True)
        call(remember_input, config, state, np.where(np.arange(N) == 1, 0.0, -9.0 * q))
        found = k - frozen_from if found < 0 and state.finding == Finding.STUCK else found
    return state, found


def test_an_encoder_with_noise_that_repeats_itself_at_rest_has_died() -> None:
    state, found = rested(0.0, 1000, turns=0)
    assert (found, state.joint) == (10, 1)
    state, found = rested(0.0, 1000, turns=3)
    assert (found, state.joint) == (10, 1)


@pytest.mark.parametrize("turns", [0, 1, 3])
def test_one_that_is_read_in_steps_may_repeat_itself_at_rest(turns: int) -> None:
    """It moves without a repetition, and then reads the same for ever: that shows nothing."""
    state, found = rested(1e-4, 2000, turns=turns)
    assert found < 0
    assert state.trust[1] == Trust.BOTH


def test_the_torque_of_a_joint_that_is_not_measured_stays_while_others_change() -> None:
    config, state = configuration(), record(new(JOINT_ESTIMATE), JOINT_ESTIMATE)
    M = np.array([[2.0, 1.5, 0.0], [1.5, 2.0, 0.0], [0.0, 0.0, 1.0]])
    state.d[:N] = 0.5, -0.5, 0.1
    for _k in range(20):
        call(oppose_disturbance, config, state, M, np.zeros(N), T, False, True, np.zeros(N))
        state.unmeasured[0] = 1
        state.d[1] += 0.05
    assert state.effort[0] == pytest.approx(0.25)
    assert M[0] @ state.d[:N] == pytest.approx(0.25 + M[0, 1] * 0.05)
