"""``slip-vic retime``."""

from __future__ import annotations

from pathlib import Path

import click

from slip_vic.options import Choice, choosing, out_option


@click.command()
@click.argument("path", type=click.Path(path_type=Path))
@choosing("scenario", "parameters", "assignments", "urdf")
@out_option("out/retime", "folder")
def retime(*, path: Path, choice: Choice, out: Path) -> None:
    """Give a path the timing that the grasp's friction admits, for any controller to follow.

    PATH is a CSV file with one column per joint [rad] or the pad's pose: x, y, z [m], qx, qy, qz, qw. With a column
    `time` [s] the timing is never faster than given, without as fast as friction admits. Arm, object, grip and friction
    are those of the scenario. Written are a smooth path through the points with its new timing, and a certificate:
    load, and largest distance from the straight lines between the points. A pose given twice is a wait, and stays one.
    """
    from slip_vic.retime.command import run_retime

    for line in run_retime(path, choice, out):
        click.echo(line)
