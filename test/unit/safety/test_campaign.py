"""The fault campaign in process: it holds, it is repeatable, and its monitors can fail."""

from __future__ import annotations

import json
import math
import signal
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from slip_core.records import record
from slip_core.types import EffortCommand
from slip_vic.presets import preset_names
from slip_vic.presets.models import load_sensor
from slip_vic_controller.state import CONFIG
from test.campaigns.cli import main as campaigns
from test.campaigns.faults import trial as trials
from test.campaigns.faults.campaign import Tally, Verdict, judge, plan_of, upper_bound_95
from test.campaigns.faults.cli import faults
from test.campaigns.faults.monitors import AnswerMonitor, CommandMonitor, JointMonitor, Promise, SafeStateMonitor
from test.campaigns.faults.plan import (
    CONTROLLER,
    DRIVES,
    EFFORT,
    JOINT,
    SLIP,
    TASKS,
    WRENCH,
    Fault,
    Plan,
    all_faults,
)
from test.campaigns.faults.trial import run_trial
from test.campaigns.faults.wire import Wire
from test.support.one_arm import OneArm, one_arm

SEED = 7
PROMISE = Promise(np.array([87.0, 12.0]), 1000.0, 0.005, 0.05, 0.004)
MS = 1_000_000
ZERO = np.zeros(2)


def test_promise_holds() -> None:
    """A part of every kind of fault; the campaign itself runs thousands."""
    faults = len(all_faults())
    for trial in range(0, faults, 5):
        verdict = judge(SEED, trial)
        assert verdict.violations == (), trial
        assert verdict.commands > 100, trial


def test_trial_is_repeatable() -> None:
    assert judge(SEED, 5) == judge(SEED, 5)


def break_controller(monkeypatch: pytest.MonkeyPatch, change: Callable[[Any], None]) -> None:
    """Let the campaign run a controller with a changed configuration, unlike its promise."""
    real = trials.prepared

    def broken(*setting: Any) -> Any:
        scenario, _ = real(*setting)
        other = one_arm(scenario.controller, scenario.urdf, lockstep=False)
        config = other.config.copy()
        change(record(config, CONFIG))
        other.config = config
        return scenario, other

    monkeypatch.setattr(trials, "prepared", broken)


def without_rate_limit(config: Any) -> None:
    config.motion.drive.rate = 1e9


def test_missing_rate_limit_is_caught(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    break_controller(monkeypatch, without_rate_limit)
    trial = 466  # joint states with wrong numbers, in motion
    seeded = ["--first", str(trial), "--seed", str(SEED), "--workers", "1", "--out", str(tmp_path)]
    result = CliRunner().invoke(faults, ["--interface", "effort", "--trials", "1", *seeded])
    assert result.exit_code == 1, result.output
    assert f"--interface effort --seed {SEED} --first {trial} --trials 1" in result.output
    summary = json.loads((tmp_path / "faults.json").read_text())
    assert (summary["trials"], summary["violations"]) == (1, 1)
    assert "command steps" in summary["failed"][0]["violations"][0]


def test_interrupted_campaign_prints_its_findings(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A violation as soon as it is found, the summary and faults.json at the end; Ctrl-C comes in the second trial."""

    def interrupted(seed: int, trial: int, interface: str = "") -> Verdict:
        if trial > 466:
            assert "trial 466 (" in capsys.readouterr().err
            signal.raise_signal(signal.SIGINT)
        return judge(seed, trial, interface)

    break_controller(monkeypatch, without_rate_limit)
    monkeypatch.setattr("test.campaigns.faults.campaign.judge", interrupted)
    words = ["--interface", "effort", "--trials", "3", "--first", "466", "--seed", str(SEED), "--workers", "1"]
    monkeypatch.setattr("sys.argv", ["run", "faults", *words, "--out", str(tmp_path)])
    assert campaigns() == 2
    printed = capsys.readouterr()
    assert printed.err.strip() == "error: interrupted"
    assert "1 trials with violations" in printed.out
    assert f"again: ./run faults --interface effort --seed {SEED} --first 466 --trials 1" in printed.out
    assert json.loads((tmp_path / "faults.json").read_text())["trials"] == 1


def test_bad_numbers_are_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    class Broken(OneArm):
        """One number of one command is bad."""

        def cycle(self, now_ns: int | None = None) -> Any:
            result = super().cycle(now_ns)
            if result is not None and result.cycle == 100:
                result.numbers = np.array(result.numbers)
                result.numbers[3] = np.nan
            return result

    monkeypatch.setattr(trials, "OneArm", Broken)
    assert any("nan" in text for text in run_trial(plan_of(SEED, 0, "effort")).violations)


@pytest.mark.parametrize(
    ("commands", "what"),
    [
        ([(0, [0.0, 0.0]), (4, [4.1, 0.0])], "steps in 4.000 ms"),
        ([(0, [0.0, 0.0]), (40, [5.1, 0.0])], "steps in 40.000 ms"),  # no more than the longest step
        ([(0, [0.0, 0.0]), (60, [4.1, 0.0])], "from what the joints feel"),
        ([(0, [4.1, 0.0])], "from what the joints feel"),
        ([(0, [0.0, np.inf])], "inf"),
        ([(0, [0.0])], "1 numbers"),
        ([(t, [min(4.0 * t / 4, 90.0), 0.0]) for t in range(0, 100, 4)], "above the limits"),
    ],
)
def test_command_monitor_sees(commands: list[tuple[int, list[float]]], what: str) -> None:
    monitor = CommandMonitor(PROMISE)
    for t, effort in commands:
        monitor.take(t * MS, np.array(effort), lambda: (ZERO,), t)
    assert len(monitor.violations) >= 1
    assert what in monitor.violations[0]


def test_command_monitor_allows_the_fastest_command() -> None:
    monitor = CommandMonitor(PROMISE)
    for t in range(0, 80, 4):
        monitor.take(t * MS, np.array([4.0 + t, 0.0]), lambda: (ZERO,), t)
    monitor.take(0, np.zeros(0), tuple, 80)
    monitor.take(90 * MS, np.array([20.0, 1.0]), lambda: (np.array([19.0, 0.0]), ZERO), 90)
    assert monitor.violations == []


def test_command_monitor_after_a_pause() -> None:
    """Drives are met at the last command; with a new joint state, where they are measured."""
    for after, measured_ns, violations in ((20.0, 1, 0), (20.0, 2, 1), (0.0, 1, 1), (0.0, 2, 0), (10.0, 1, 1)):
        monitor = CommandMonitor(PROMISE)
        monitor.take(0, np.array([20.0, 0.0]), lambda: (np.array([20.0, 0.0]),), 1)
        monitor.take(100 * MS, np.array([after, 0.0]), lambda: (ZERO,), measured_ns)
        assert len(monitor.violations) == violations


def test_command_monitor_has_lower_limits() -> None:
    monitor = CommandMonitor(replace(PROMISE, least=np.array([1.0, -12.0])))
    for first, violations in ((1.0, 0), (0.9, 1), (87.1, 2)):
        monitor.inside(0, np.array([first, -12.0]))
        assert len(monitor.violations) == violations


@pytest.mark.parametrize("kind", ["gains", "parameter"])
def test_parameters_change_while_the_law_runs(kind: str) -> None:
    outcome = run_trial(Plan(0, 1, "paper_planar", False, "vic", (Fault(kind, CONTROLLER, 0.2, 0.01, 0.55),)))
    assert outcome.violations == []
    assert outcome.modes["ACTIVE"] > 100


def test_joint_monitor_sees_steps_and_unrest() -> None:
    monitor = JointMonitor(4.0)
    monitor.take(0.0, ZERO, ZERO, False)
    monitor.take(0.004, np.array([4.1, 0.0]), ZERO, False)
    assert "joint effort steps by 4.100" in monitor.violations[0]
    for t in range(1, 300):
        monitor.take(0.004 * t, np.array([4.1, 0.0]), np.array([0.0, 0.2]), False)
    assert "not at rest" in monitor.violations[1]


def test_safe_state_monitor_sees_missing_input() -> None:
    monitor = SafeStateMonitor({"wrench": 0.1}, 0.05)
    monitor.good("wrench", 1.0, 1.0)
    monitor.check(1.1, True)
    monitor.check(5.0, False)
    assert monitor.violations == []
    monitor.check(1.2, True)
    assert "after the last good wrench" in monitor.violations[0]


def test_safe_state_monitor_sees_missing_degradation() -> None:
    monitor = SafeStateMonitor({"slip": 0.5}, 0.05, {"slip": 0.1})
    monitor.good("slip", 0.9, 1.0)  # its age counts from when it was measured
    for now_s, degraded, complaints in ((1.01, False, 0), (1.1, True, 0), (1.1, False, 1), (1.6, True, 2)):
        monitor.check(now_s, True, degraded=degraded)
        assert len(monitor.violations) == complaints, now_s
    assert "law with all it needs at work 0.200 s after the last good slip" in monitor.violations[0]


def test_plans_draw_every_sensor_and_law() -> None:
    """And changes no fault that a seed has drawn before there were sensors."""
    plans = [plan_of(SEED, trial) for trial in range(300)]
    assert {plan.interface for plan in plans} == set(DRIVES)
    assert {plan.drive for plan in plans} == {drive for drives in DRIVES.values() for drive in drives}
    assert {plan.task for plan in plans} == set(TASKS)
    assert sum(any(plan.joints) for plan in plans) > 100
    assert 20 < sum(plan.wrench == "none" for plan in plans) < 80
    turns = {(plan.sensor, plan.controller, plan.observer) for plan in plans}
    assert len(turns) == len(preset_names("sensors")) * 3 * 2
    assert {plan.setting.split()[-1] for plan in plans} == set(preset_names("sensors"))
    first = Fault("freeze_message", JOINT, 0.06850165840927014, 0.2407900680298737, 0.12216958020121715)
    assert plans[5].faults[0] == first


def test_sensor_preset_is_in_both_nodes() -> None:
    for name in preset_names("sensors"):
        scenario, _ = trials.prepared("paper_planar", True, "vic", name)
        sensor = load_sensor(name).slip
        assert scenario.bridge.sensors.slip == sensor
        told = scenario.controller.slip_sensor
        assert (told.rate_hz, told.latency_s) == (sensor.rate_hz, sensor.latency_s)
        assert scenario.controller.slip_estimator == "observer"


def test_only_joint_state_age_counts_without_answer() -> None:
    for answered in (True, False):
        monitor = SafeStateMonitor({"joint_states": 0.05, "wrench": 0.05}, 0.05)
        for name, measured_s in (("wrench", 1.0), ("joint_states", 1.03)):
            monitor.good(name, measured_s, measured_s)
        monitor.check(1.08, True, answered)
        assert bool(monitor.violations) == answered
        monitor.check(1.12, True, answered)
        assert "after the last good joint_states" in monitor.violations[-1 if not answered else 1]


def test_age_of_a_late_joint_state() -> None:
    """One that was 30 ms on its way alone counts from its arrival, unless the wrench shows how late it is."""
    for wrenches_s, passed_s in (((0.99, 1.0, 1.004), 0.0), ((1.0, 1.052, 1.056), 0.11)):
        monitor = SafeStateMonitor({"joint_states": 0.05, "wrench": 0.05}, 0.05)
        monitor.good("joint_states", 0.996, 0.996)
        for measured_s in wrenches_s:
            monitor.good("wrench", measured_s, measured_s)
        monitor.good("joint_states", 1.0, 1.06)
        monitor.check(1.11, True)
        assert len(monitor.violations) == (passed_s > 0.0)
        assert all(f"{passed_s:.3f} s after the last good joint_states" in text for text in monitor.violations)
        monitor.check(1.2, True)
        assert any("after the last good joint_states" in text for text in monitor.violations)


def test_thrown_arm_rests_in_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its joints turn at 20 rad/s, the bridge holds it while commands are lost, and the controller after that."""
    bad = Fault("corrupt_values", EFFORT, 0.41380490251640956, 0.08457941546591131, 0.5539483726001245)
    lost = Fault("drop", EFFORT, 0.42543410724844954, 0.2808509989055661, 0.9037178607898289)
    ask = Fault("request", CONTROLLER, 0.15134483207648047, 0.011957284900918975, 0.169571585205049)
    plan = Plan(7649, 19, "glass_transport", True, "governed", (ask, bad, lost), "optical_flow_120")
    outcome = run_trial(plan)
    assert outcome.modes["FAULT"] > 300
    assert outcome.violations == []
    monkeypatch.setattr(trials, "REST_AFTER_S", 0.1)
    assert any("not at rest" in text for text in run_trial(plan).violations)


def test_paused_simulation_ages_no_sensor() -> None:
    monitor = SafeStateMonitor({JOINT: 0.1, WRENCH: 0.1}, 0.05)
    for name in (JOINT, WRENCH):
        monitor.good(name, 1.0, 1.0)
    monitor.stood_still(0.1, (WRENCH, SLIP))
    monitor.check(1.2, True)
    assert [text.split()[-1] for text in monitor.violations] == [JOINT]


@pytest.mark.parametrize(
    ("seed", "trial"),
    [
        (27182, 2446), (50501, 2262), (242424, 4274), (404040, 11919), (202020, 89), (71717, 56338), (262626, 1763),
    ],
)  # fmt: skip
def test_trials_that_failed_once(seed: int, trial: int) -> None:
    assert judge(seed, trial).violations == ()


def test_answer_monitor_sees_silence() -> None:
    monitor = AnswerMonitor(patience=2)
    for answered, good in ((False, True), (True, True), (False, True), (False, False), (False, True)):
        monitor.take(0.0, answered, good)
    assert monitor.violations == []
    monitor.take(0.1, False, True)
    assert "3 good joint states without an answer" in monitor.violations[0]


def test_message_without_numbers_can_be_damaged() -> None:
    """As a command is that gives no effort: a controller that still waits for a slow sensor gives such ones."""
    wire, stamps = Wire(EFFORT, ("a", "b"), "ee"), set()
    for seed in range(30):
        message = wire.message(EffortCommand(7, np.zeros(0)))
        damaged = wire.receive(wire.damaged(message, "corrupt_values", np.random.default_rng(seed)))
        assert len(damaged.effort) == 0
        stamps.add(damaged.stamp_ns)
    assert len(stamps) > 1


def test_bound_is_clopper_pearson() -> None:
    for count, failures in ((300, 0), (3000, 0), (300, 1), (3000, 7)):
        p = upper_bound_95(count, failures)
        so_few = sum(math.comb(count, k) * p**k * (1.0 - p) ** (count - k) for k in range(failures + 1))
        assert so_few == pytest.approx(0.05, rel=1e-9)
    assert upper_bound_95(0, 0) == upper_bound_95(3, 3) == 1.0


def test_summary_has_recovery_times() -> None:
    verdicts = [Verdict(i, ("drop wrench",), (), r, 10, {"ACTIVE": 5}) for i, r in enumerate((0.1, 0.3, 0.2, None))]
    both = Verdict(4, ("drop wrench", "grip"), ("step",), 9.0, 10, {"HOLD": 5})
    row = Tally(1, verdicts=[*verdicts, both]).summary()["by_fault"]["drop wrench"]
    assert (row["trials"], row["violations"], row["recovered"]) == (5, 1, 4)
    assert (row["recovery_median_s"], row["recovery_max_s"]) == (0.2, 0.3)
