"""``slip-vic benchmark run | compare | verify | tune``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from slip_vic.options import out_option
from slip_vic.study.cli import shard, workers

if TYPE_CHECKING:
    from slip_vic.benchmark.suite import Grip
    from slip_vic.study.engines import EngineName


@click.group()
def benchmark() -> None:
    """Compare control laws, yours too, in the worlds of the suite carry-2026.1."""


@benchmark.command()
@click.argument("law")
@click.option("--worlds", type=click.IntRange(1), default=300, show_default="all", help="the first N of each track")
@click.option("--track", type=click.Choice(["capped", "free"]), help="of the grip; default: that of the law")
@click.option("--arms", type=click.Choice(["1", "2"]), help="only worlds with so many; default: both")
@out_option(None, "folder of this law; default out/benchmark/LAW")
@workers
@click.option("--shard", default="1/1", callback=shard, metavar="I/N", help="every N-th world from the I-th on")
def run(
    *, law: str, worlds: int, track: Grip | None, arms: str | None, out: Path | None, jobs: int,
    engine: EngineName, shard: tuple[int, int],
) -> None:  # fmt: skip
    """Run LAW (a name, module:Class or file.py:Class); a folder that has worlds already continues."""
    from slip_vic.benchmark.law import find_law
    from slip_vic.benchmark.result import run_law

    folder = out or Path("out") / "benchmark" / find_law(law).label
    click.echo(run_law(law, worlds, folder, engine, jobs, shard, track, (int(arms),) if arms else (1, 2)))


@benchmark.command()
@click.argument("folders", nargs=-1, required=True, type=click.Path(path_type=Path))
@out_option("out/benchmark", "folder")
def compare(folders: tuple[Path, ...], out: Path) -> None:
    """Compare results in the worlds that all of them have: table, compare.png, compare.html."""
    from rich.console import Console

    from slip_vic.benchmark.compare import compare as write
    from slip_vic.benchmark.compare import table_for

    lines, line = write(folders, out)
    console = Console()
    console.print(table_for(console, lines))
    click.echo(line)


@benchmark.command()
@click.argument("folder", type=click.Path(path_type=Path))
def verify(folder: Path) -> None:
    """Run ten worlds of a result again, drawn by its own digest; exit code 1 where one differs."""
    from slip_vic.benchmark.result import verify_result

    count, wrong = verify_result(folder)
    for line in wrong:
        click.echo(line, err=True)
    click.echo(f"{folder}: {count} worlds ran again, {'they differ' if wrong else 'all are equal'}")
    if wrong:
        raise click.exceptions.Exit(1)


@benchmark.command()
@click.argument("law")
@click.argument("attribute")
@click.argument("values", nargs=-1, required=True, type=float)
@click.option("--worlds", type=click.IntRange(1), default=6, show_default=True, help="how many, none of the suite")
def tune(law: str, attribute: str, values: tuple[float, ...], worlds: int) -> None:
    """Try values of an attribute of LAW in worlds that are not in the suite; the same budget for each law."""
    from slip_vic.benchmark.tune import tried

    for line in tried(law, attribute, values, worlds):
        click.echo(line)
