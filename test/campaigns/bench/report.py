"""The bench's output: tables for people, ``bench.json`` for programs."""

from __future__ import annotations

import json
from pathlib import Path

import click

from test.campaigns.bench.measure import METRICS, BenchResult


def write_results(out: Path, result: BenchResult) -> Path:
    """Write ``bench.json`` into `out` and return its path."""
    out.mkdir(parents=True, exist_ok=True)
    tables = {name: getattr(result, name).to_dict("index") for name in ("metrics", "free_running", "starts")}
    (out / "bench.json").write_text(json.dumps(result._asdict() | tables, indent=2) + "\n", encoding="utf-8")
    return out / "bench.json"


def print_results(result: BenchResult) -> None:
    """Print both tables and the machine."""
    metrics = result.metrics.map("{:.4g}".format)
    metrics["unit"], metrics["meaning"] = ([getattr(one, key) for one in METRICS] for key in ("unit", "note"))
    found = result.machine
    click.echo(
        f"over the rounds, ratios formed within each round\n{metrics.to_string()}\n\n"
        "real time, bridge and controller on one core, recorder on the others; rate in Hz\n"
        f"{result.free_running.map('{:.4g}'.format).to_string()}\n\n"
        f"from the start beside a running bridge to the first command\n{result.starts.to_string()}\n\n"
        f"machine: {found['processor']}, {found['cores']} cores, kernel {found['kernel']} "
        f"({found['preemption']}), SCHED_FIFO {'permitted' if found['fifo_permitted'] else 'not permitted'}\n"
        f"noise: equal work varied by {100.0 * result.noise:.0f} % between rounds"
    )
