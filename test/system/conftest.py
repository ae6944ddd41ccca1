"""Runs that several tests read: each is made once in a session."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from slip_vic.run.launcher import Launcher, RunResult
from slip_vic.run.processes import child_environment
from slip_vic.scenarios.scenario import Scenario, load_scenario

DEMO_S, DEMO_DEADLINE_S = 4.0, 600.0
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


def noisy_scenario(seed: int) -> Scenario:
    """A short run with noise, a slow sensor and every topic of a lockstep run."""
    return load_scenario("paper_planar", seed=seed, assignments=NOISY)


@pytest.fixture(scope="session")
def noisy_run(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """Lockstep, seed 5, every topic."""
    return record(tmp_path_factory.mktemp("noisy"), noisy_scenario(5))


@pytest.fixture(scope="session")
def real_time_run(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """1 kHz in real time, as well as this machine can."""
    scenario = load_scenario("paper_planar", mode="realtime", assignments=[f"bridge.duration_s={REAL_TIME_S}"])
    return record(tmp_path_factory.mktemp("real_time"), scenario)


@pytest.fixture(scope="session")
def demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The demo's output folder, with a bag of each controller, and what it printed.

    Of half its time: at rest after 2.2 s, all but the printed law are within 1 um of the goal.
    """
    out = tmp_path_factory.mktemp("demo") / "out"
    environment = child_environment(0)
    del environment["ROS_DOMAIN_ID"], environment["SLIP_VIC_EVENTS"]
    command = [sys.executable, "-m", "slip_vic.cli", "demo", "--out", str(out)]
    command += ["--set", f"bridge.duration_s={DEMO_S}"]
    done = subprocess.run(
        command, capture_output=True, text=True, env=environment, timeout=DEMO_DEADLINE_S, check=False
    )
    assert done.returncode == 0, done.stderr
    return out, done.stdout
