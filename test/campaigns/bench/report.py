"""The bench's output: tables for people, ``bench.json`` for programs."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
from rich.console import Console
from rich.table import Table

from test.campaigns.bench.measure import METRICS, BenchResult


def write_results(out: Path, result: BenchResult) -> Path:
    """Write ``bench.json`` into `out` and return its path."""
    out.mkdir(parents=True, exist_ok=True)
    tables = {name: getattr(result, name).to_dict("index") for name in ("metrics", "free_running")}
    (out / "bench.json").write_text(json.dumps(result._asdict() | tables, indent=2) + "\n", encoding="utf-8")
    return out / "bench.json"


def print_results(console: Console, result: BenchResult) -> None:
    """Print both tables and the machine."""
    metrics = result.metrics.map("{:.4g}".format)
    metrics["unit"], metrics["meaning"] = ([getattr(one, key) for one in METRICS] for key in ("unit", "note"))
    console.print(_shown(metrics, "over the rounds, ratios formed within each round"))
    title = "real time, bridge and controller on one core, recorder on the others; rate in Hz"
    console.print(_shown(result.free_running.map("{:.4g}".format), title))
    found = result.machine
    console.print(
        f"machine: {found['processor']}, {found['cores']} cores, kernel {found['kernel']} "
        f"({found['preemption']}), SCHED_FIFO {'permitted' if found['fifo_permitted'] else 'not permitted'}\n"
        f"noise: equal work varied by {100.0 * result.noise:.0f} % between rounds",
        soft_wrap=True,
    )


def _shown(frame: pd.DataFrame, title: str) -> Table:
    table = Table("", *frame.columns, title=title)
    for name, row in frame.iterrows():
        table.add_row(str(name), *row)
    return table
