"""``slip-vic bag verify``."""

from __future__ import annotations

from pathlib import Path

import click


@click.command()
@click.argument("bag_path", metavar="BAG", type=click.Path(path_type=Path))
def verify(bag_path: Path) -> None:
    """Run the controller again on the recorded inputs and compare every effort bit by bit.

    Exit code 0: identical. 1: not, with the first difference. 2: this bag cannot be verified.
    """
    from rich.console import Console

    from slip_bags.reader import Bag
    from slip_vic.replay.run_data import read_run
    from slip_vic.replay.verify import other_software, verify_run

    with Bag(bag_path) as opened:
        runs = read_run(opened)
        notes = other_software(opened.custom_data)
    with Console(stderr=True).status("replaying"):
        verdict = verify_run(runs)
    click.echo(verdict.text())
    if not verdict.identical:
        for note in notes:
            click.echo(f"note: {note}")
        raise click.exceptions.Exit(1)
