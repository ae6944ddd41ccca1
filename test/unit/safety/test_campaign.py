"""The fault campaign in process: it holds, it is repeatable, and its monitors can fail."""

from __future__ import annotations

import json
import math
import signal
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from rclpy.serialization import serialize_message
from std_msgs.msg import Int64MultiArray

from slip_bags.reader import Bag
from slip_core.records import record
from slip_core.types import EffortCommand, JointSample
from slip_vic.presets import preset_names
from slip_vic.presets.models import load_sensor
from slip_vic_controller.arm.robot import Robot
from slip_vic_controller.safety.modes import Mode
from slip_vic_controller.state import CONFIG
from test.campaigns.cli import main as campaigns
from test.campaigns.faults import trial as trials
from test.campaigns.faults.campaign import Tally, Verdict, judge, plan_of, upper_bound_95
from test.campaigns.faults.cli import faults
from test.campaigns.faults.dds_campaign import campaign_scenario
from test.campaigns.faults.dds_session import SILENT_S, START_S, StartUp
from test.campaigns.faults.dds_watch import Watch, Watches
from test.campaigns.faults.monitors import CommandMonitor, JointMonitor, Promise, SafeStateMonitor
from test.campaigns.faults.plan import (
    BRIDGE,
    CONTROLLER,
    DRIVES,
    EFFORT,
    JOINT,
    SLIP,
    TASKS,
    TOPICS,
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


def test_a_trial_can_be_run_again() -> None:
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


def test_a_limiter_without_rate_limit_is_caught_and_leaves_its_bag(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def without_rate_limit(config: Any) -> None:
        config.motion.drive.rate = 1e9

    break_controller(monkeypatch, without_rate_limit)
    trial = 466  # joint states with wrong numbers, in motion
    seeded = ["--first", str(trial), "--seed", str(SEED), "--workers", "1", "--out", str(tmp_path)]
    words = ["--interface", "effort", "--trials", "1", *seeded]
    result = CliRunner().invoke(faults, words)
    assert result.exit_code == 1, result.output
    assert f"--interface effort --seed {SEED} --first {trial} --trials 1" in result.output
    summary = json.loads((tmp_path / "faults.json").read_text())
    assert (summary["trials"], summary["violations"]) == (1, 1)
    assert "command steps" in summary["failed"][0]["violations"][0]
    with Bag(tmp_path / f"trial_{SEED}_{trial}") as bag:
        assert bag.topics["/effort_command"].message_count > 100
        assert bag.custom_data["violations"]


def test_an_interrupted_campaign_prints_what_it_has_found(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A violation as soon as it is found, the summary and faults.json at the end; Ctrl-C comes in the second trial."""

    def without_rate_limit(config: Any) -> None:
        config.motion.drive.rate = 1e9

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


def test_a_controller_that_lets_bad_numbers_through_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
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


def test_command_monitor_lets_the_fastest_allowed_pass() -> None:
    monitor = CommandMonitor(PROMISE)
    for t in range(0, 80, 4):
        monitor.take(t * MS, np.array([4.0 + t, 0.0]), lambda: (ZERO,), t)
    monitor.take(0, np.zeros(0), tuple, 80)
    monitor.take(90 * MS, np.array([20.0, 1.0]), lambda: (np.array([19.0, 0.0]), ZERO), 90)
    assert monitor.violations == []


def test_command_monitor_after_a_pause_without_a_new_joint_state() -> None:
    """Drives are met at the last command; with a new joint state, where they are measured."""
    for after, measured_ns, violations in ((20.0, 1, 0), (20.0, 2, 1), (0.0, 1, 1), (0.0, 2, 0), (10.0, 1, 1)):
        monitor = CommandMonitor(PROMISE)
        monitor.take(0, np.array([20.0, 0.0]), lambda: (np.array([20.0, 0.0]),), 1)
        monitor.take(100 * MS, np.array([after, 0.0]), lambda: (ZERO,), measured_ns)
        assert len(monitor.violations) == violations


def test_command_monitor_knows_ranges_that_are_not_symmetric() -> None:
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


def watch_of_the_campaign() -> tuple[Watch, dict[str, Wire]]:
    params = campaign_scenario().controller
    wires = {name: Wire(name, params.joint_names, params.ee_frame) for name in TOPICS}
    robot = Robot(campaign_scenario().urdf, params.ee_frame, params.joint_names, params.gravity)
    return Watch(wires, params, robot, 0.004, 1000.0, 0.03), wires


def test_the_arm_need_not_rest_where_bridge_and_controller_hold_it_in_turn() -> None:
    """The bridge takes no command that answers an old state; each of them begins from the motion that it finds."""
    moving, nothing = np.full(7, 0.2), np.zeros(7)
    for late_ticks, complaints in ((1, 1), (10, 0)):
        watch, wires = watch_of_the_campaign()
        for tick in range(10, 400):
            answered = tick - (late_ticks if tick // 20 % 2 else 1)
            command = EffortCommand(answered * 4 * MS, nothing)
            watch.forwarded(EFFORT, serialize_message(wires[EFFORT].message(command)), 0, True)
            state = JointSample(tick * 4 * MS, nothing, moving, nothing)
            watch.bridge_state(serialize_message(wires[JOINT].message(state)), tick * 0.004)
        assert ["not at rest" in text for text in watch.violations()] == [True] * complaints, late_ticks


def test_rest_is_judged_by_the_mode_of_its_time_though_the_ledger_comes_late() -> None:
    """Found by the campaign with two arms: the law was at work again, and its first motion came before the ledger."""
    nothing = np.zeros(7)
    for resumes_at, complaints in ((320, 0), (360, 1)):
        watch, wires = watch_of_the_campaign()
        for tick in range(1, 400):
            stamp_ns, late = tick * 4 * MS, tick - 30
            answer = EffortCommand(stamp_ns - 4 * MS, nothing)
            watch.forwarded(EFFORT, serialize_message(wires[EFFORT].message(answer)), 0, True)
            state = JointSample(stamp_ns, nothing, np.full(7, 0.2 if tick > 320 else 0.0), nothing)
            watch.bridge_state(serialize_message(wires[JOINT].message(state)), tick * 0.004)
            mode = Mode.ACTIVE if late >= resumes_at else Mode.HOLD
            watch.ledger(ledger_of(late, late * 4 * MS, late * 4 * MS, mode))
        assert ["not at rest" in text for text in watch.violations()] == [True] * complaints, resumes_at


def ledger_of(cycle: int, stamp_ns: int, clock_ns: int, mode: Mode) -> bytes:
    row = [cycle, 0, stamp_ns, *divmod(clock_ns, 1_000_000_000), int(mode), 0, 0]
    data: bytes = serialize_message(Int64MultiArray(data=row))
    return data


@pytest.mark.parametrize(("cycles_apart", "complaints"), [(1, 0), (6, 2)])
def test_an_arm_that_goes_on_while_the_other_one_holds_is_seen_by_the_ledgers(
    cycles_apart: int, complaints: int
) -> None:
    watches = Watches({f"{side}/": watch_of_the_campaign()[0] for side in ("left", "right")}, 0.004)
    for cycle in range(20):
        apart = 5 <= cycle < 5 + cycles_apart
        for side, mode in (("left/", Mode.ACTIVE), ("right/", Mode.HOLD if apart else Mode.ACTIVE)):
            watches.arms[side].ledger(ledger_of(cycle, cycle * 4 * MS, cycle * 4 * MS, mode))
        assert watches.mode == (Mode.HOLD if apart else Mode.ACTIVE)
    found = watches.violations()
    assert ["the left/ arm follows" in text for text in found] == [True] * complaints
    assert watches.violations() == []


@pytest.mark.parametrize(("noticed", "complaints"), [(False, 1), (True, 0)])
def test_a_law_that_goes_on_with_what_waited_while_the_machine_stood_still_is_no_violation(
    noticed: bool, complaints: int
) -> None:
    watch, wires = watch_of_the_campaign()
    state = serialize_message(wires[JOINT].message(JointSample(4 * MS, np.zeros(7), np.zeros(7), np.zeros(7))))
    sent_s = time.monotonic()
    watch.forwarded(JOINT, state, round(1e9 * sent_s), True)
    if noticed:
        watch.stood_still(0.9)
    watch.ledger(ledger_of(1, 4 * MS, round(1e9 * (sent_s + 0.9)), Mode.ACTIVE))
    assert len(watch.violations()) == complaints


def test_commands_that_answer_the_same_joint_state_are_judged_where_none_of_them_is_lost() -> None:
    """Without joint states several of them have the same stamp, and belong to their ledgers by their order alone."""
    sent = [(4, 1000, 0.0), (8, 1004, 4.0), (8, 1004.1, 4.1), (8, 1009, 9.0), (12, 1014, 9.0), (16, 1018, 9.0)]
    steeper = [*sent[:3], (8, 1009, 9.2), *sent[4:]]
    for commands, lost, complaints in ((sent, None, 0), (sent, 2, 0), (steeper, None, 1)):
        watch, wires = watch_of_the_campaign()
        for cycle, (stamp_ms, clock_ms, effort) in enumerate(commands):
            command = EffortCommand(stamp_ms * MS, np.full(7, effort))
            if cycle != lost:
                watch.command(serialize_message(wires[EFFORT].message(command)))
            watch.ledger(ledger_of(cycle, stamp_ms * MS, round(clock_ms * MS), Mode.HOLD))
        assert len(watch.violations()) == complaints, (commands, lost)
        assert watch.commands.commands >= len(commands) - 1 - 3 * (lost is not None)
        assert watch.mode == Mode.HOLD


def test_safe_state_monitor_sees_a_law_without_input() -> None:
    monitor = SafeStateMonitor({"wrench": 0.1}, 0.05)
    monitor.good("wrench", 1.0, 1.0)
    monitor.check(1.1, True)
    monitor.check(5.0, False)
    assert monitor.violations == []
    monitor.check(1.2, True)
    assert "after the last good wrench" in monitor.violations[0]


def test_safe_state_monitor_sees_a_law_that_goes_on_with_all_it_needs() -> None:
    monitor = SafeStateMonitor({"slip": 0.5}, 0.05, {"slip": 0.1})
    monitor.good("slip", 0.9, 1.0)  # its age counts from when it was measured
    for now_s, degraded, complaints in ((1.01, False, 0), (1.1, True, 0), (1.1, False, 1), (1.6, True, 2)):
        monitor.check(now_s, True, degraded=degraded)
        assert len(monitor.violations) == complaints, now_s
    assert "law with all it needs at work 0.200 s after the last good slip" in monitor.violations[0]


def test_every_sensor_has_its_turn_with_every_controller() -> None:
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


def test_a_sensor_is_the_preset_in_bridge_and_controller() -> None:
    for name in preset_names("sensors"):
        scenario, _ = trials.prepared("paper_planar", True, "vic", name)
        sensor = load_sensor(name).slip
        assert scenario.bridge.sensors.slip == sensor
        told = scenario.controller.slip_sensor
        assert (told.rate_hz, told.latency_s) == (sensor.rate_hz, sensor.latency_s)
        assert scenario.controller.slip_estimator == "observer"


def test_a_message_that_is_repeated_is_as_old_as_it_is() -> None:
    """Also for a controller that starts meanwhile and takes it for its first one."""
    freeze = Fault("freeze_message", WRENCH, 0.44, 0.2, 0.8)
    kill = Fault("kill", CONTROLLER, 0.2, 0.042, 0.3)
    for planned in ((kill, freeze), (freeze,)):
        outcome = run_trial(Plan(0, 1, "paper_planar", False, "vic", planned))
        assert outcome.violations == []
        assert outcome.modes["DEGRADED"] > 10


def test_without_joint_states_no_command_is_given_and_no_other_age_counts() -> None:
    for answered in (True, False):
        monitor = SafeStateMonitor({"joint_states": 0.05, "wrench": 0.05}, 0.05)
        for name, measured_s in (("wrench", 1.0), ("joint_states", 1.03)):
            monitor.good(name, measured_s, measured_s)
        monitor.check(1.08, True, answered)
        assert bool(monitor.violations) == answered
        monitor.check(1.12, True, answered)
        assert "after the last good joint_states" in monitor.violations[-1 if not answered else 1]


def test_a_late_joint_state_is_as_old_as_the_controller_can_know() -> None:
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


def test_where_the_simulation_stood_still_nothing_has_aged() -> None:
    stop = Fault("stop", BRIDGE, 0.1824685103156638, 0.045375090056341806, 0.8239836050619626)
    frame = Fault("wrong_frame", SLIP, 0.22211506490320043, 0.1158226774888418, 0.7799515160739481)
    wrong = Fault("corrupt_values", JOINT, 0.222932560909884, 0.007280500333756684, 0.9133325203935808)
    assert run_trial(Plan(33181, 29, "paper_planar", True, "vic", (stop, frame, wrong), "vision_25")).violations == []
    monitor = SafeStateMonitor({JOINT: 0.1, WRENCH: 0.1}, 0.05)
    for name in (JOINT, WRENCH):
        monitor.good(name, 1.0, 1.0)
    monitor.stood_still(0.1, (WRENCH, SLIP))
    monitor.check(1.2, True)
    assert [text.split()[-1] for text in monitor.violations] == [JOINT]


def test_a_message_without_numbers_can_be_damaged() -> None:
    """As a command is that gives no effort: a controller that still waits for a slow sensor gives such ones."""
    wire, stamps = Wire(EFFORT, ("a", "b"), "ee"), set()
    for seed in range(30):
        message = wire.message(EffortCommand(7, np.zeros(0)))
        damaged = wire.receive(wire.damaged(message, "corrupt_values", np.random.default_rng(seed)))
        assert len(damaged.effort) == 0
        stamps.add(damaged.stamp_ns)
    assert len(stamps) > 1


def test_bound_is_that_of_clopper_and_pearson() -> None:
    for count, failures in ((300, 0), (3000, 0), (300, 1), (3000, 7)):
        p = upper_bound_95(count, failures)
        so_few = sum(math.comb(count, k) * p**k * (1.0 - p) ** (count - k) for k in range(failures + 1))
        assert so_few == pytest.approx(0.05, rel=1e-9)
    assert upper_bound_95(0, 0) == upper_bound_95(3, 3) == 1.0


def test_summary_says_how_long_recovery_took() -> None:
    verdicts = [Verdict(i, ("drop wrench",), (), r, 10, {"ACTIVE": 5}) for i, r in enumerate((0.1, 0.3, 0.2, None))]
    both = Verdict(4, ("drop wrench", "grip"), ("step",), 9.0, 10, {"HOLD": 5})
    row = Tally(1, False, verdicts=[*verdicts, both]).summary()["by_fault"]["drop wrench"]
    assert (row["trials"], row["violations"], row["recovered"]) == (5, 1, 4)
    assert (row["recovery_median_s"], row["recovery_max_s"]) == (0.2, 0.3)


def test_a_node_that_starts_slowly_is_not_taken_for_a_deaf_one() -> None:
    """Or each new start would be ended before it is over, for ever."""
    start, never = StartUp(), -math.inf
    start.begin(100.0)
    assert not start.deaf(100.0 + 0.9 * START_S, up=False, heard_s=never)  # longer than a deaf one may be silent
    up_s = start.last_s
    assert up_s == 100.0 + 0.9 * START_S
    assert not start.deaf(up_s + 0.9 * SILENT_S, up=True, heard_s=never)
    assert not start.deaf(up_s + 1.9 * SILENT_S, up=True, heard_s=up_s + SILENT_S)
    assert start.deaf(up_s + 1.1 * SILENT_S, up=True, heard_s=never)
    start.begin(300.0)
    assert start.deaf(300.0 + 1.1 * START_S, up=False, heard_s=never)
