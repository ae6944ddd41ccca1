"""Measurements over DDS: lockstep and free running, in processes of their own."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import psutil

from slip_vic.run.launcher import Launcher, RunResult
from slip_vic.run.processes import placed
from slip_vic.scenarios.scenario import Scenario, load
from test.campaigns.attacks.suite import MIB, START_S, stage, with_numbers
from test.campaigns.faults.plan import CONTROLLER

SCENARIO = "paper_planar"
AWAY_S = 2.0  # until a controller has ended and the bridge has noticed


def wake_ups(rate_hz: int, duration_s: float, fifo: int | None, floor: Path) -> dict[str, float]:
    """Return the timing of a process that only sleeps, on the controller's core: share in time, and lateness [s]."""
    command = [str(floor / "build" / "slip_vic_node"), "wake-ups", str(rate_hz), str(duration_s)]
    on = placed(command, sorted(os.sched_getaffinity(0))[-1:], fifo)
    timing: dict[str, float] = json.loads(subprocess.run(on, capture_output=True, text=True, check=True).stdout)
    return timing


def start(native: Path | None) -> dict[str, Any]:
    """Return the time from the start of a controller beside a running bridge to its first command, and its memory."""
    with stage(native=native) as on:
        on.wait(START_S, lambda: on.watch.monitor.commands > 0)
        os.kill(on.pid(CONTROLLER), signal.SIGTERM)
        on.wait(AWAY_S)
        before, began = on.watch.monitor.commands, time.monotonic()
        child = on.start_controller("again")
        on.wait(START_S, lambda: on.watch.monitor.commands > before)
        passed_s = time.monotonic() - began
        on.wait(AWAY_S)
        return {"start_s": passed_s, "memory_mib": psutil.Process(child.pid).memory_info().rss / MIB}


def lockstep_tick_s(scenario: Scenario, *, record: bool = False) -> float:
    """Return the mean time of a lockstep tick of the whole system [s]."""
    result = _run(scenario, record=record)
    return result.wall_time_s / result.ticks


def free_run(rate_hz: int, duration_s: float, fifo: int | None, native: Path | None) -> RunResult:
    """Run in real time at a rate, with the recorder; the result has the share of fresh ticks and the latencies.

    native: a built export whose node is the controller; None: the Python node.
    """
    scenario = load(
        SCENARIO,
        law="vic",
        mode="realtime",
        set=(f"control_period_s={1.0 / rate_hz!r}", f"bridge.duration_s={duration_s}"),
    )
    return _run(scenario, record=True, fifo=fifo, native=native)


def _run(scenario: Scenario, *, record: bool, fifo: int | None = None, native: Path | None = None) -> RunResult:
    with tempfile.TemporaryDirectory(prefix="slip_vic_bench_") as folder:
        bag = Path(folder) / "bag" if record else None
        exported = native and with_numbers(native, scenario, Path(folder) / "native")
        return Launcher(scenario, bag=bag, fifo=fifo, native=exported).run()
