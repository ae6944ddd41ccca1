"""``./run bench``."""

from __future__ import annotations

from pathlib import Path

import click
from rich.console import Console


@click.command()
@click.option(
    "-o", "--out", type=click.Path(path_type=Path), default=Path("out"), show_default=True, help="output folder"
)
@click.option("--quick", is_flag=True, help="about half a minute, for a first look; numbers are rough")
@click.option("--rounds", type=click.IntRange(1), help="rounds of everything side by side")
@click.option("--free-s", type=click.FloatRange(0.1), help="length of each real-time run [s]")
def bench(out: Path, quick: bool, rounds: int | None, free_s: float | None) -> None:
    """Measure what a control cycle costs on this machine: table and bench.json; about five minutes."""
    from dataclasses import replace

    from test.campaigns.bench.measure import QUICK, Effort, run_bench
    from test.campaigns.bench.report import print_results, write_results

    effort = QUICK if quick else Effort()
    effort = replace(effort, rounds=rounds or effort.rounds, free_s=free_s or effort.free_s)
    with Console(stderr=True).status("measuring") as status:
        result = run_bench(effort, status.update)
    numbers = write_results(out, result)
    console = Console()
    print_results(console, result)
    console.print(f"numbers: {numbers}", soft_wrap=True)
