"""How late efforts reach the joints: against simulated joints whose delay is known, and in the loop with the law."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from slip_core.params import build
from slip_core.records import new, record
from slip_vic.run.in_process import ClosedLoop
from slip_vic.scenarios import scenario_names
from slip_vic.study.lottery import GOVERNED, draw, with_drive
from slip_vic_controller.arm.config import estimator_config
from slip_vic_controller.arm.drive_delay import DRIVE_DELAY, SURE_S, forget_drive_delay, watch_drive_delay
from slip_vic_controller.arm.estimator import estimate_joints, remember_input
from slip_vic_controller.arm.joint_estimate import ESTIMATOR_CONFIG, JOINT_ESTIMATE, Finding
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.safety.modes import Mode
from slip_vic_controller.safety.reasons import finding_text
from test.campaigns.faults.dds_campaign import campaign_scenario
from test.campaigns.faults.plan import EFFORT, IDEAL, Fault, Plan
from test.support.call import call
from test.support.every import every
from test.support.late_efforts import FROM_S, LASTS_S, fate

N, NS = 3, 1e9
LIMIT = np.array([87.0, 50.0, 12.0])
INERTIA = np.array([[1.5, 0.3, 0.02], [0.3, 0.8, 0.05], [0.02, 0.05, 0.1]])
CLOSE_MS = 1.5


class Arm:
    """Joints that follow efforts `delay` periods later, and what watches them; more says what else is not as told."""

    def __init__(self, delay: int, *, heavier: float = 1.0, friction: float = 0.0, noise: float = 0.0, **values: Any):
        given = {name.replace("__", "."): value for name, value in values.items()}
        params = build(ControllerParams, given, "test")
        self.config = record(estimator_config(params, LIMIT), ESTIMATOR_CONFIG)
        self.estimate = record(new(JOINT_ESTIMATE), JOINT_ESTIMATE)
        self.state = record(new(DRIVE_DELAY), DRIVE_DELAY)
        self.delay, self.inertia, self.friction, self.noise = delay, heavier * INERTIA, friction, noise
        self.rng, self.period = np.random.default_rng(3), params.control_period_s
        self.k, self.q, self.v = 0, np.zeros(N), np.zeros(N)
        self.efforts = [np.zeros(N)] * (delay + 1)

    def swing(self, seconds: float, share: float) -> Any:
        """Move for a time by efforts of this share of the limits; return the finding."""
        for _ in range(round(seconds / self.period)):
            t = self.k * self.period
            measured = self.v + self.noise * self.rng.normal(size=N)
            call(estimate_joints, self.config, self.estimate, round(t * NS), self.q, measured, True)
            call(watch_drive_delay, self.config, self.state, self.estimate, INERTIA, self.efforts[-1], LIMIT)
            effort = share * LIMIT * np.sin(2.0 * np.pi * np.array([5.0, 7.0, 9.0]) * t)
            self.efforts.append(effort)
            call(remember_input, self.config, self.estimate, np.linalg.solve(INERTIA, effort))
            acts = self.efforts[-1 - self.delay] - self.friction * LIMIT * np.tanh(self.v / 1e-3)
            a = np.linalg.solve(self.inertia, acts)
            self.q, self.v = self.q + self.period * (self.v + 0.5 * self.period * a), self.v + self.period * a
            self.k += 1
        return Finding(self.estimate.finding)


@every("delay", (15, 16, 19, 24, 30))
@every("noise", (0.0, 2e-3))
def test_a_delay_is_found_and_how_long_it_is(delay: int, noise: float) -> None:
    arm = Arm(delay, noise=noise, joint_sensor__difference=1.0)
    assert arm.swing(1.0, 0.1) == Finding.EFFORTS_LATE
    assert arm.estimate.value == pytest.approx(delay, abs=CLOSE_MS if noise == 0.0 else 2.0 * CLOSE_MS)
    assert 1e3 * arm.state.found_s >= arm.estimate.value  # the longest; the finding is the first
    text = finding_text(Finding.EFFORTS_LATE, "j", arm.estimate.value, arm.estimate.limit)
    assert f"{arm.estimate.value:.0f} ms later than told" in text
    assert "drive.delay_s, which says 0 ms" in text


@every("period", (0.004, 0.01))
def test_periods_longer_than_a_block(period: float) -> None:
    arm = Arm(round(0.02 / period), control_period_s=period, joint_sensor__difference=1.0)
    assert arm.swing(2.0, 0.1) == Finding.EFFORTS_LATE
    assert arm.estimate.value == pytest.approx(20.0, abs=CLOSE_MS)


@every("delay", (0, 4, 12))
def test_a_delay_that_the_law_bears_is_none(delay: int) -> None:
    arm = Arm(delay, joint_sensor__difference=1.0)
    assert arm.swing(1.0, 0.04) == Finding.NONE
    assert arm.state.found_s == 0.0


def test_one_that_is_borne_is_found_where_the_arm_swings_with_it() -> None:
    arm = Arm(8, joint_sensor__difference=1.0)
    assert arm.swing(1.0, 0.3) == Finding.EFFORTS_LATE
    assert arm.estimate.value == pytest.approx(8.0, abs=CLOSE_MS)


@every("wrong", ({"heavier": 1.5}, {"heavier": 0.7}, {"friction": 0.05}, {"noise": 0.01}))
@every("share", (0.05, 0.5))
def test_what_else_the_model_leaves_out_is_no_delay(wrong: dict[str, float], share: float) -> None:
    arm = Arm(0, joint_sensor__difference=1.0, **wrong)
    assert arm.swing(2.0, share) == Finding.NONE


def test_an_arm_that_something_else_holds_follows_no_efforts() -> None:
    arm = Arm(0, heavier=1e6, joint_sensor__difference=1.0)
    assert arm.swing(2.0, 0.1) == Finding.NONE
    assert arm.state.unexplained == 0.0


def test_cycles_too_long_for_three_delays_are_not_watched() -> None:
    arm = Arm(1, control_period_s=0.02, joint_sensor__difference=1.0)
    assert arm.swing(2.0, 0.1) == Finding.NONE
    assert arm.state.started == 0


def test_what_is_told_is_not_found_again() -> None:
    told = {"drive.delay_s": 0.016, "joint_sensor.difference": 1.0}
    arm = Arm(16, **told)
    assert arm.config.drive_ticks == 16
    assert arm.swing(1.0, 0.3) == Finding.NONE
    arm = Arm(36, **told)
    assert arm.swing(1.0, 0.1) == Finding.EFFORTS_LATE
    assert (arm.estimate.value, arm.estimate.limit) == (pytest.approx(20.0, abs=CLOSE_MS), 16.0)


def test_an_arm_at_rest_shows_nothing_and_a_gap_begins_anew() -> None:
    arm = Arm(20, joint_sensor__difference=1.0)
    assert arm.swing(1.0, 0.0) == Finding.NONE
    arm.swing(0.05, 0.1)
    assert arm.state.blocks > 0
    arm.k += 100
    arm.swing(2e-3, 0.1)
    assert (arm.state.blocks, arm.state.periods) == (0, 1)


def test_it_must_last_and_is_forgotten_when_told_to() -> None:
    arm = Arm(20, joint_sensor__difference=1.0)
    arm.swing(0.5, 0.003)  # what is known of small efforts: no more than a hundredth of the limits is not explained
    assert arm.state.found_s == 0.0
    while arm.estimate.finding == Finding.NONE:
        arm.swing(1e-3, 0.1)
        assert arm.k < 2000
    assert arm.state.explained_s > SURE_S
    call(forget_drive_delay, arm.state)
    assert (arm.state.found_s, arm.state.explained_s, arm.state.blocks) == (0.0, 0.0, 0)
    assert not np.any(arm.state.product)


@every(("seed", "number"), ((616161, 1), (616161, 3), (616161, 25), (616161, 201), (595959, 86)))
def test_joints_of_worlds_that_once_looked_late_are_not(seed: int, number: int) -> None:
    """With all troubles: efforts that rise against friction (`motor_current`), and noise before joints that rest."""
    loop = ClosedLoop(with_drive(draw(number, seed), seed).load(GOVERNED))
    for _ in range(720):
        loop.bridge.advance([loop.control(loop.observe()).command])
    state = loop.session.arms[0].state
    assert state.mode.mode in (Mode.ACTIVE, Mode.DEGRADED)
    assert state.drive_delay.blocks > 20
    assert state.drive_delay.found_s == 0.0


@every("lag_ms", (16, 24))
@every("law", ("governed", "classical"))
@every("scenario", scenario_names(1))
def test_efforts_that_nobody_tells_are_late_end_in_a_fault_that_holds(scenario: str, law: Any, lag_ms: int) -> None:
    late = Fault("late", EFFORT, FROM_S, LASTS_S, 1e-3 * lag_ms)
    plan = Plan(0, 1, scenario, law != "classical", law, (late,), IDEAL)
    assert fate(plan, campaign_scenario(plan), 0.0) == "FAULT, held"
