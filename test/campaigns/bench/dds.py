"""Measurements over DDS: lockstep and free running, in processes of their own."""

from __future__ import annotations

import tempfile
from pathlib import Path

from slip_vic.run.launcher import Launcher, RunResult
from slip_vic.scenarios.scenario import Scenario, load

SCENARIO = "paper_planar"


def lockstep_tick_s(scenario: Scenario, *, record: bool = False) -> float:
    """Return the mean time of a lockstep tick of the whole system [s]."""
    result = _run(scenario, record=record)
    return result.wall_time_s / result.ticks


def free_run(rate_hz: int, duration_s: float, fifo: int | None) -> RunResult:
    """Run in real time at a rate, with the recorder; the result has the share of fresh ticks and the latencies."""
    scenario = load(
        SCENARIO,
        law="vic",
        mode="realtime",
        set=(f"control_period_s={1.0 / rate_hz!r}", f"bridge.duration_s={duration_s}"),
    )
    return _run(scenario, record=True, fifo=fifo)


def _run(scenario: Scenario, *, record: bool, fifo: int | None = None) -> RunResult:
    with tempfile.TemporaryDirectory(prefix="slip_vic_bench_") as folder:
        bag = Path(folder) / "bag" if record else None
        return Launcher(scenario, bag=bag, fifo=fifo).run()
