"""How a command ends when a run went wrong although no program failed."""

from __future__ import annotations

from collections.abc import Iterable

import click

ALLOW_FAULT = click.option(
    "--allow-fault", is_flag=True, help="exit with 0 although a run ended in FAULT or lost the object: an experiment"
)


def end_with(incidents: Iterable[str], allowed: bool) -> None:
    """Say what went wrong, a line each, and end with exit code 1 where anything did and that is not wanted."""
    lines = list(incidents)
    for line in lines:
        click.echo(line, err=True)
    if lines and not allowed:
        raise click.exceptions.Exit(1)
