"""``slip-vic report`` and ``slip-vic watch``."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import click

from slip_core.errors import InputError


@click.command()
@click.argument("bags", metavar="BAG [BAG...]", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("-o", "--output", type=click.Path(path_type=Path), default=Path("report.html"), show_default=True)
@click.option("--title", default="", help="default: the scenario")
def report(bags: tuple[Path, ...], output: Path, title: str) -> None:
    """Write one self-contained web page of recorded runs: 3D replay, linked plots, table."""
    from slip_bringup.web.page import write_page

    labels = [path.name if path.is_dir() else path.stem for path in bags]
    if len(set(labels)) != len(labels):
        labels = [str(path) for path in bags]
    if len(set(labels)) != len(labels):
        raise InputError("report", got="the same bag twice", expected="different bags")
    command = shlex.join(["slip-vic", *sys.argv[1:]])
    write_page(output, dict(zip(labels, bags, strict=True)), command=command, title=title)
    click.echo(f"{output}: {output.stat().st_size / 1e6:.2f} MB")
