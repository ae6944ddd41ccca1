"""The fault campaign in process: it holds, it is repeatable, and its monitors can fail."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from slip_core.records import record
from slip_vic_controller.state import CONFIG
from test.campaigns.faults import trial as trials
from test.campaigns.faults.campaign import judge
from test.campaigns.faults.cli import faults
from test.campaigns.faults.monitors import CommandMonitor, Promise, SafeStateMonitor
from test.campaigns.faults.plan import all_faults, make_plan
from test.campaigns.faults.trial import run_trial
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
    config.command.effort_rate = 1e9


def test_missing_rate_limit_is_caught(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    break_controller(monkeypatch, without_rate_limit)
    trial = 19  # a wrench with wrong numbers, in motion
    seeded = ["--first", str(trial), "--seed", str(SEED), "--workers", "1", "--out", str(tmp_path)]
    result = CliRunner().invoke(faults, ["--interface", "effort", "--trials", "1", *seeded])
    assert result.exit_code == 1, result.output
    assert f"--interface effort --seed {SEED} --first {trial} --trials 1" in result.output
    summary = json.loads((tmp_path / "faults.json").read_text())
    assert (summary["trials"], summary["violations"]) == (1, 1)
    assert "command steps" in summary["failed"][0]["violations"][0]


def test_bad_numbers_are_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    class Broken(OneArm):
        """One number of one command is bad."""

        def cycle(self, now_ns: int | None = None) -> Any:
            result = super().cycle(now_ns)
            if result is not None and result.ledger[0] == 100:
                result.numbers = np.array(result.numbers)
                result.numbers[3] = np.nan
            return result

    monkeypatch.setattr(trials, "OneArm", Broken)
    assert any("nan" in text for text in run_trial(make_plan(SEED, 0, "effort")).violations)


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


def test_safe_state_monitor_sees_missing_input() -> None:
    monitor = SafeStateMonitor({"wrench": 0.1}, 0.05)
    monitor.good("wrench", 1.0, 1.0)
    monitor.check(1.1, True)
    monitor.check(5.0, False)
    assert monitor.violations == []
    monitor.check(1.2, True)
    assert "after the last good wrench" in monitor.violations[0]
