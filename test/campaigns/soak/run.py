"""A long run in real time over DDS with the recorder, and samples of its processes."""

from __future__ import annotations

import contextlib
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

import psutil

from slip_vic.run.launcher import Launcher, RunResult
from slip_vic.scenarios.scenario import Scenario, load
from test.campaigns.soak.growth import Sample, sample_process

SAMPLES: Final = 360
SHORTEST_S: Final = 0.5


def soak_scenario(name: str, minutes: float, rate_hz: float) -> Scenario:
    """Return a scenario of that length: a lemniscate round after round, with the observer."""
    period_s, seconds = 1.0 / rate_hz, 60.0 * minutes
    return load(
        name, law="vic",
        mode="realtime",
        set=(
            f"controller.control_period_s={period_s}", f"bridge.control_period_s={period_s}",
            "controller.slip_estimator=observer", "bridge.grip.force=2.0", "controller.trajectory.kind=lemniscate",
            "controller.trajectory.radius=0.06", f"controller.trajectory.duration_s={seconds + 60.0}",
            f"bridge.duration_s={seconds}",
        ),
    )  # fmt: skip


def run_soak(
    scenario: Scenario, minutes: float, on_time: Callable[[float], None]
) -> tuple[RunResult, dict[str, list[Sample]]]:
    """Run to the end; return the run's result and the samples of every process.

    Raises:
        ProtocolError: a process ended before its time.
    """
    series: dict[str, list[Sample]] = {}
    every_s, start, newest = max(60.0 * minutes / SAMPLES, SHORTEST_S), time.monotonic(), 0.0

    def on_progress(sim_time_s: float) -> None:
        nonlocal newest
        on_time(sim_time_s)
        t = time.monotonic() - start
        if t < newest + every_s:
            return
        newest = t
        for process in (psutil.Process(), *psutil.Process().children()):
            with contextlib.suppress(psutil.NoSuchProcess):
                series.setdefault(_name(process), []).append(sample_process(process, t))

    with tempfile.TemporaryDirectory(prefix="slip_vic_soak_") as folder:
        result = Launcher(scenario, bag=Path(folder) / "bag").run(on_progress)
    return result, {name: samples for name, samples in series.items() if len(samples) > 1}


def _name(process: psutil.Process) -> str:
    words = process.cmdline()
    if process.pid == psutil.Process().pid:
        return "soak"
    if "record" in words:
        return "recorder"
    return "bridge" if any("slip_sim_bridge" in word for word in words) else "controller"
