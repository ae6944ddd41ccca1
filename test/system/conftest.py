"""Runs that several tests read: each is made once in a session."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from slip_vic.run.launcher import Launcher, RunResult
from slip_vic.scenarios.scenario import Scenario, load
from test.support.command import slip_vic

DEMO_S = 4.0
REAL_TIME_S = 2.0
NOISY = (
    "bridge.duration_s=0.6",
    "controller.publish_effort_array=true",
    "bridge.sensors.slip.noise_linear=1e-3",
    "bridge.sensors.slip.rate_hz=120.0",
    "bridge.sensors.slip.latency_s=0.01",
    "bridge.sensors.wrench.noise_force=0.05",
    "bridge.sensors.joint.noise_position=1e-6",
)


@dataclass(frozen=True)
class Recording:
    """A run over DDS: what was run, where its bag is, what the launcher said of it."""

    scenario: Scenario
    bag: Path
    result: RunResult


def record(folder: Path, scenario: Scenario) -> Recording:
    """Run a scenario over DDS and record everything."""
    result = Launcher(scenario, bag=folder / "bag").run()
    assert result.lost == 0
    return Recording(scenario, folder / "bag", result)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """A browser; only one at a time can be open in a thread."""
    from test.support.browser import chromium

    with chromium() as started:
        yield started


@pytest.fixture(scope="session")
def noisy_run(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """A short lockstep run with noise, a slow sensor and every topic."""
    return record(tmp_path_factory.mktemp("noisy"), load("paper_planar", law="vic", seed=5, set=NOISY))


@pytest.fixture(scope="session")
def real_time_run(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """1 kHz in real time, as well as this machine can."""
    scenario = load("paper_planar", law="vic", mode="realtime", set=[f"bridge.duration_s={REAL_TIME_S}"])
    return record(tmp_path_factory.mktemp("real_time"), scenario)


@pytest.fixture(scope="session")
def demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The demo's output folder, with a bag of each controller, and what it printed.

    Of half its time: at rest after 2.2 s, all but the printed law are within 1 um of the goal.
    """
    out = tmp_path_factory.mktemp("demo") / "out"
    done = slip_vic("demo", "--out", out, "--set", f"bridge.duration_s={DEMO_S}")
    assert done.returncode == 0, done.stderr
    return out, done.stdout
