"""``./run frozen run`` and ``./run frozen compare``."""

from __future__ import annotations

from pathlib import Path

import click

from slip_vic.experiments.cli import JOBS
from slip_vic.options import end_with, names


@click.group()
def frozen() -> None:
    """Run this checkout in the frozen worlds, and say whether it does worse than the code they were frozen with."""


@frozen.command()
@click.option("--set", "prefix", default="", help="sets whose names begin so, e.g. one_arm_20261201; default all four")
@click.option("--law", "laws", default="classical,vic,governed,governed_follow", show_default=True)
@JOBS
@click.option(
    "-o", "--out", type=click.Path(path_type=Path), required=True, help="CSV file; one that has rows continues"
)
def run(*, prefix: str, laws: str, jobs: int, out: Path) -> None:
    """Run the frozen worlds under laws of the controller."""
    from slip_core.errors import UnknownName
    from slip_vic.experiments.engines import PoolEngine
    from slip_vic.experiments.runner import fill, under_laws
    from slip_vic.scenarios.scenario import LAWS
    from test.campaigns.frozen.worlds import worlds_of

    for law in names(laws):
        if law not in LAWS:
            raise UnknownName("law", law, LAWS)
    with PoolEngine(jobs) as workers:
        rows, there = fill(out, "frozen", under_laws(worlds_of(prefix), names(laws)), workers)
    click.echo(f"{there} of {len(rows)} runs were there already; {out}")


@frozen.command()
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path, exists=True))
def compare(files: tuple[Path, ...]) -> None:
    """Compare the rows of FILES with the frozen ones; exit code 1 where a law does worse."""
    from slip_vic.experiments.rows import read_rows
    from test.campaigns.frozen.compare import compare as compared
    from test.campaigns.frozen.compare import table_of, verdict
    from test.campaigns.frozen.worlds import base_rows

    rows = [row for file in files for row in read_rows(file)]
    lines = compared(base_rows(), rows)
    compared_runs = sum(line.worlds for line in lines if not line.name.endswith(", all"))
    click.echo(table_of(lines))
    worse = verdict(lines)
    click.echo(f"{compared_runs} of {len(rows)} runs have a frozen row; verdict: {'WORSE' if worse else 'not worse'}")
    end_with(worse)
