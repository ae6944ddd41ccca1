"""Measurements over DDS: ping-pong, lockstep, free running; each in processes of its own, started by exec."""

from __future__ import annotations

import json
import shutil
import signal
import statistics
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

from slip_core.errors import ProtocolError
from slip_msgs_py.realtime import ProcessOptions
from slip_vic.run.domain import domain_id
from slip_vic.run.launcher import Launcher, RunResult
from slip_vic.run.processes import child_environment, python_module
from slip_vic.scenarios.scenario import Scenario, load_scenario

WARM_UP = 100
TIMEOUT_S = 120.0
SCENARIO = "paper_planar"


@dataclass(frozen=True, slots=True)
class PingPong:
    """One kind of ping-pong: the module of both sides and its words."""

    module: str
    words: tuple[str, ...] = ()
    side_first: bool = True

    def command(self, side: str, *more: str) -> list[str]:
        """Return the command of one side."""
        words = (side, *more, *self.words) if self.side_first else (*self.words, side, *more)
        return python_module(self.module, *words)


R0 = PingPong("test.campaigns.bench.pingpong", ("--path", "default"))
RAW = PingPong("test.campaigns.bench.pingpong", ("--path", "raw"))
RAW_BEST_EFFORT = PingPong("test.campaigns.bench.pingpong", ("--path", "raw", "--best-effort"))


def c_floor(library: Path) -> PingPong:
    """Return the ping-pong in C."""
    return PingPong("test.campaigns.bench.cfloor", (str(library),), side_first=False)


def round_trip_s(kind: PingPong, rounds: int) -> float:
    """Return the mean time of a round trip [s].

    Raises:
        ProtocolError: where a side failed, with its last line.
    """
    options = kind.side_first
    counts = ["--rounds", str(rounds), "--warm-up", str(WARM_UP)] if options else [str(rounds), str(WARM_UP)]
    with domain_id() as domain:
        environment = child_environment(domain)
        partner = subprocess.Popen(
            kind.command("answer"), env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        try:
            done = subprocess.run(
                kind.command("ask", *counts),
                env=environment,
                capture_output=True,
                text=True,
                timeout=TIMEOUT_S,
                check=False,
            )
        finally:
            partner.send_signal(signal.SIGINT)
            partner.wait(TIMEOUT_S)
    if done.returncode != 0:
        raise ProtocolError(f"ping-pong {kind.module}: {(done.stderr.strip().splitlines() or ['no output'])[-1]}")
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
