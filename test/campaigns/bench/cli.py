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
@click.option(
    "--native",
    type=click.Path(path_type=Path),
    help="a built slip-vic export: measure its node, a node without a law and bare wake-ups too, in turn",
)
def bench(out: Path, quick: bool, native: Path | None) -> None:
    """Measure what a control cycle costs on this machine: table and bench.json; about five minutes."""
    from test.campaigns.bench.measure import QUICK, Effort, run_bench
    from test.campaigns.bench.report import print_results, write_results

    with Console(stderr=True).status("measuring") as status:
        result = run_bench(QUICK if quick else Effort(), status.update, native)
    numbers = write_results(out, result)
    print_results(result)
    click.echo(f"numbers: {numbers}")
