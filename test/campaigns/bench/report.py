"""The bench's output: tables for people, ``bench.json`` for programs."""

from __future__ import annotations

import json
from pathlib import Path

from rich.console import Console
from rich.table import Table

from slip_core.errors import InputError
from test.campaigns.bench.measure import BenchResult


def write_results(out: Path, result: BenchResult) -> Path:
    """Write ``bench.json`` into `out` and return its path.

    Raises:
        InputError: where the folder cannot be written.
    """
    numbers = out / "bench.json"
    try:
        out.mkdir(parents=True, exist_ok=True)
        numbers.write_text(json.dumps(result.as_dict(), indent=2) + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"output folder {out}", got=error, expected="a folder that can be written") from None
    return numbers


def print_results(console: Console, result: BenchResult) -> None:
    """Print both tables, the machine and the notes."""
    metrics = Table(title="medians over the rounds, ratios formed within each round")
    for heading in ("", "median", "lowest", "highest", "", "meaning"):
        metrics.add_column(heading, justify="right" if heading in ("median", "lowest", "highest") else "left")
    for metric in result.metrics.values():
        values = [f"{value:.4g}" for value in (metric.median, metric.low, metric.high)]
        metrics.add_row(metric.name, *values, metric.unit, metric.note)
    free = Table(title="real time, bridge and controller on one core, recorder on the others")
    for heading in ("rate", "fresh %", "missed", "lost bag", "p50 ms", "p99 ms", "p99.9 ms", "max ms", "x real time"):
        free.add_column(heading, justify="right")
    for name, run in result.free_running.items():
        if "_" in name:
            shares = f"{100.0 * run['fresh']:.2f}", f"{run['lost']:.0f}", f"{run['recorder_lost']:.0f}"
            latencies = [f"{run[f'latency_{key}_ms']:.3f}" for key in ("p50", "p99", "p999", "max")]
            free.add_row(name.replace("_", " Hz, "), *shares, *latencies, f"{run['real_time_factor']:.3f}")
    console.print(metrics)
    console.print(free)
    found = result.machine
    console.print(
        f"machine: {found['processor']}, {found['cores']} cores, kernel {found['kernel']} "
        f"({found['preemption']}), SCHED_FIFO {'permitted' if found['fifo_permitted'] else 'not permitted'}\n"
        f"noise: equal work varied by {100.0 * result.noise:.0f} % between rounds",
        soft_wrap=True,
    )
    for note in result.notes:
        console.print(f"note: {note}", soft_wrap=True)
