"""Measurements over DDS: ping-pong, lockstep, free running; each in processes of its own, started by exec."""

from __future__ import annotations

import json
import shutil
import signal
import statistics
import subprocess
import tempfile
from pathlib import Path

from slip_core.errors import ProtocolError
from slip_msgs_py.realtime import ProcessOptions
from slip_vic.run.domain import domain_id
from slip_vic.run.launcher import Launcher, RunResult
from slip_vic.run.processes import child_environment, python_module
from slip_vic.scenarios.scenario import Scenario, load_scenario

TIMEOUT_S = 120.0
SCENARIO = "paper_planar"


def round_trip_s(rounds: int) -> float:
    """Return R0, the mean time of a round trip of `pingpong` [s].

    Raises:
        ProtocolError: where a side failed, with its last line.
    """

    def command(side: str) -> list[str]:
        return python_module("test.campaigns.bench.pingpong", side, str(rounds))

    nothing = subprocess.DEVNULL
    with domain_id() as domain:
        environment = child_environment(domain)
        partner = subprocess.Popen(command("answer"), env=environment, stdout=nothing, stderr=nothing)
        try:
            done = subprocess.run(
                command("ask"), env=environment, capture_output=True, text=True, timeout=TIMEOUT_S, check=False
            )
        finally:
            partner.send_signal(signal.SIGINT)
            partner.wait(TIMEOUT_S)
    if done.returncode != 0:
        raise ProtocolError(f"ping-pong: {(done.stderr.strip().splitlines() or ['no output'])[-1]}")
    return statistics.fmean(json.loads(done.stdout))


def lockstep_scenario(duration_s: float) -> Scenario:
    """Return the scenario of the lockstep figures."""
    return load_scenario(SCENARIO, assignments=(f"bridge.duration_s={duration_s}",))


def lockstep_tick_s(scenario: Scenario, *, record: bool = False) -> float:
    """Return the mean time of a lockstep tick of the whole system [s]."""
    result = _run(scenario, record=record)
    return result.wall_time_s / result.ticks


def free_run(rate_hz: int, duration_s: float, process: ProcessOptions) -> RunResult:
    """Run in real time at a rate, with the recorder; the result has the share of fresh ticks and the latencies."""
    scenario = load_scenario(
        SCENARIO,
        mode="realtime",
        assignments=(f"control_period_s={1.0 / rate_hz!r}", f"bridge.duration_s={duration_s}"),
    )
    return _run(scenario, record=True, process=process)


def _run(scenario: Scenario, *, record: bool, process: ProcessOptions | None = None) -> RunResult:
    folder = Path(tempfile.mkdtemp(prefix="slip_vic_bench_"))
    try:
        return Launcher(
            scenario,
            bag=folder / "bag" if record else None,
            process=process or ProcessOptions(),
        ).run()
    finally:
        shutil.rmtree(folder, ignore_errors=True)
