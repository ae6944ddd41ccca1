"""The bench's output: tables for people, ``bench.json`` for programs, and one picture."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt  # the backend must be chosen first: no display is needed
from rich.console import Console
from rich.table import Table

from slip_core.errors import InputError
from test.campaigns.bench.measure import BenchResult

BARS = "#1f6fb2"
SECOND = "#c44e52"


def write_results(out: Path, result: BenchResult) -> tuple[Path, Path]:
    """Write ``bench.json`` and ``bench.png`` into `out` and return their paths.

    Raises:
        InputError: where the folder cannot be written.
    """
    numbers, picture = out / "bench.json", out / "bench.png"
    try:
        out.mkdir(parents=True, exist_ok=True)
        numbers.write_text(json.dumps(result.as_dict(), indent=2) + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"output folder {out}", got=error, expected="a folder that can be written") from None
    _picture(picture, result)
    return numbers, picture


def print_results(console: Console, result: BenchResult) -> None:
    """Print all tables."""
    console.print(_metrics_table(result))
    console.print(_free_running_table(result))
    console.print(_profile_table(result))
    noise, found = result.noise, result.machine
    console.print(
        f"machine: {found['processor']}, {found['cores']} cores, kernel {found['kernel']} "
        f"({found['preemption']}), SCHED_FIFO {'permitted' if found['fifo_permitted'] else 'not permitted'}\n"
        f"noise: the same work varied by {100.0 * noise['calibration_spread']:.0f} % between rounds; "
        f"stalls took up to {100.0 * noise['stalled_share']:.1f} % of the time",
        soft_wrap=True,
    )
    for note in result.notes:
        console.print(f"note: {note}", soft_wrap=True)


def _metrics_table(result: BenchResult) -> Table:
    table = Table(title="medians over the rounds, ratios formed within each round")
    for heading in ("", "median", "lowest", "highest", "", "meaning"):
        table.add_column(heading, justify="right" if heading in ("median", "lowest", "highest") else "left")
    for metric in result.metrics.values():
        values = [f"{value:.4g}" for value in (metric.median, metric.low, metric.high)]
        table.add_row(metric.name, *values, metric.unit, metric.note)
    return table


def _free_running_table(result: BenchResult) -> Table:
    table = Table(title="real time, bridge and controller on one core, recorder on the others")
    columns = ("rate", "fresh %", "missed", "lost bag", "p50 ms", "p99 ms", "p99.9 ms", "max ms", "x real time")
    for heading in columns:
        table.add_column(heading, justify="right")
    for name, run in result.free_running.items():
        if "_" not in name:
            continue
        latencies = [f"{run[f'latency_{key}_ms']:.3f}" for key in ("p50", "p99", "p999", "max")]
        table.add_row(
            name.replace("_", " Hz, "),
            f"{100.0 * run['fresh']:.2f}",
            f"{run['lost']:.0f}",
            f"{run['recorder_lost']:.0f}",
            *latencies,
            f"{run['real_time_factor']:.3f}",
        )
    return table


def _profile_table(result: BenchResult) -> Table:
    table = Table(title="where a lockstep tick goes")
    table.add_column("")
    table.add_column("us", justify="right")
    table.add_column("share", justify="right")
    whole = sum(result.profile_us.values())
    for name, value in result.profile_us.items():
        table.add_row(name, f"{value:.0f}", f"{100.0 * value / whole:.0f} %")
    for kind, times in result.scaling_us.items():
        table.add_row(f"control step by {kind}", ", ".join(f"{n}: {value:.0f}" for n, value in times.items()), "")
    for name, mib in result.memory_mib.items():
        table.add_row(f"memory of the {name} [MiB]", f"{mib:.0f}", "")
    return table


def _picture(path: Path, result: BenchResult) -> None:
    figure, axes = plt.subplots(2, 2, figsize=(14, 9), constrained_layout=True)
    _bars(
        axes[0, 0], {n: m for n, m in result.metrics.items() if not m.unit}, "ratios (bars: lowest and highest round)"
    )
    profile = dict(reversed(result.profile_us.items()))
    axes[0, 1].barh(list(profile), list(profile.values()), color=BARS)
    axes[0, 1].set_title("where a lockstep tick goes [us]")
    runs = {name: run for name, run in result.free_running.items() if "_" in name}
    labels = [name.replace("_", " Hz\n") for name in runs]
    axes[1, 0].bar(labels, [100.0 * run["fresh"] for run in runs.values()], color=BARS)
    axes[1, 0].set_ylim(0.0, 105.0)
    axes[1, 0].set_title("real time: ticks with a fresh command [%]")
    for key, colour in (("p50", BARS), ("p99", SECOND)):
        axes[1, 1].plot(labels, [run[f"latency_{key}_ms"] for run in runs.values()], "o-", color=colour, label=key)
    axes[1, 1].set_ylim(bottom=0.0)
    axes[1, 1].legend()
    axes[1, 1].set_title("real time: state to command [ms]")
    for axis in axes.flat:
        axis.grid(alpha=0.3)
    figure.savefig(path, dpi=90)
    plt.close(figure)


def _bars(axis: Any, metrics: dict[str, Any], title: str) -> None:
    names = list(reversed(metrics))
    medians = [metrics[name].median for name in names]
    spread = [
        [max(0.0, metrics[name].median - metrics[name].low) for name in names],
        [max(0.0, metrics[name].high - metrics[name].median) for name in names],
    ]
    axis.barh(names, medians, xerr=spread, color=BARS, ecolor=SECOND)
    axis.set_title(title)
