"""``slip-vic identify``."""

from __future__ import annotations

from pathlib import Path

import click

from slip_vic.options import out_option


@click.command()
@click.argument("bag", type=click.Path(path_type=Path))
@click.option("--ee-frame", default="ee", show_default=True, help="link of the URDF that the wrench is measured at")
@out_option(None, "write a drive file for --drive with these numbers")
def identify(bag: Path, ee_frame: str, out: Path | None) -> None:
    """Find noise, quantum, friction and offset of each joint in a recorded slow motion.

    The bag needs joint states with efforts and the arm's URDF; a wrench is taken off where there is one. Each joint has
    to move both ways, slowly: docs/drives.md.
    """
    from rich.console import Console

    from slip_vic.scenarios.parameter_files import write_files
    from slip_vic.setup.identify import identify as found_in
    from slip_vic.setup.identify import preset, read_motion, table

    numbers = found_in(*read_motion(bag, ee_frame))
    Console().print(table(numbers))
    if out is not None:
        write_files(out.parent, {out.name: preset(numbers, f"slip-vic identify {bag}")})
        click.echo(str(out))
