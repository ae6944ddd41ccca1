"""``./run soak``."""

from __future__ import annotations

import sys
from pathlib import Path

import click
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from slip_vic.options import SCENARIO


@click.command()
@click.option("--minutes", type=click.FloatRange(0.1), default=60.0, show_default=True, help="real time")
@click.option("--rate", type=click.FloatRange(10.0, 2000.0), default=500.0, show_default=True, help="control rate [Hz]")
@SCENARIO
@click.option("-o", "--out", type=click.Path(path_type=Path), default=Path("out/soak"), show_default=True)
def soak(minutes: float, rate: float, scenario: str, out: Path) -> None:
    """Run for long in real time over DDS and watch memory and open files of every process.

    Exit code 1 where something grows: the slope is the median over all pairs of samples after the warm-up.
    """
    from slip_vic.run.progress import run_progress
    from test.campaigns.soak.growth import Limits
    from test.campaigns.soak.run import run_soak, soak_scenario, write_result

    loaded = soak_scenario(scenario, minutes, rate)
    loaded.check()
    with run_progress(Console(stderr=True)) as add_bar:
        result = run_soak(loaded, minutes, add_bar(f"soak at {rate:g} Hz", 60.0 * minutes))
    limits = Limits()
    path = write_result(out, result, limits)
    table = Table("process", "memory [MiB]", "slope [MiB/h]", "open files", "threads", "grows", box=SIMPLE_HEAD)
    for name, growth in result.growth().items():
        memory, files, threads = growth.memory_mib, growth.files, growth.threads
        table.add_row(
            name,
            f"{memory.first:.1f} / {memory.last:.1f}",
            f"{memory.per_hour:+.2f}",
            f"{files.first:.0f} / {files.last:.0f}",
            f"{threads.first:.0f} / {threads.last:.0f}",
            ", ".join(growth.grows(limits)) or "no",
        )
    Console().print(table)
    done = result.said.get("bridge", {})
    if done:
        click.echo(
            f"{done['ticks']} ticks, {done['sim_time_s']:.1f} s simulated in {done['wall_time_s']:.1f} s; "
            f"law at work in {100.0 * result.law_share():.0f} % of the cycles"
        )
    if result.objects_lost:
        click.echo(f"{result.objects_lost} objects lost, and put back by an operator")
    if result.faults:
        click.echo(f"{len(result.faults)} faults that an operator reset, the last one: {result.faults[-1]}")
    for line in result.warnings:
        click.echo(f"warning: {line}", err=True)
    click.echo(f"results: {path}")
    if any(growth.grows(limits) for growth in result.growth().values()):
        sys.exit(1)
