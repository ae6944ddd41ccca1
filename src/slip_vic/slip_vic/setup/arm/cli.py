"""``slip-vic arm``."""

from __future__ import annotations

from pathlib import Path

import click

from slip_vic.options import DRIVE, PACKAGE, names, out_option

AXIS = click.Choice(["x", "-x", "y", "-y", "z", "-z"])


@click.command()
@click.argument("urdf", type=click.Path(path_type=Path))
@PACKAGE
@click.option("--ee", "link", default="", metavar="LINK", help="link at the hand; default: found")
@click.option("--approach", type=AXIS, default=None, help="its axis out of the hand; default: found")
@click.option("--normal", type=AXIS, default=None, help="its axis along which the jaws close; default: found")
@click.option("--reach", type=float, default=0.0, show_default=True, help="from it to the pad centre [m]")
@click.option("--gripper-width", "width", type=click.FloatRange(0.0), help="opening of sliding fingers [m]; default 0")
@click.option("--lock", "locks", multiple=True, metavar="JOINT=VALUE", help="keep a joint there; repeatable")
@click.option("--scenario", "scenarios", default="paper_planar", show_default=True, help="names, comma separated")
@click.option("--scale", type=click.FloatRange(0.01, 10.0), default=1.0, show_default=True, help="size of the path")
@DRIVE
@out_option(None, "folder; default: named like the file, here")
def arm(
    *,
    urdf: Path,
    link: str,
    approach: str | None,
    normal: str | None,
    reach: float,
    width: float | None,
    locks: tuple[str, ...],
    scenarios: str,
    scale: float,
    drive: str,
    out: Path | None,
) -> None:
    """Make a folder that runs from an arm's URDF or xacro file: arm.urdf, scenarios, parameters for the real arm."""
    from rich.console import Console

    from slip_vic.setup.arm.write import Arm, read_arm, way_table, write_arm

    made = Arm(
        read_arm(urdf),
        link=link,
        approach=approach or "",
        normal=normal or "",
        reach=reach,
        width=width,
        locked=dict(map(_position, locks)),
    )
    for line in made.said:
        click.echo(line)
    tasks = {}
    for scenario in names(scenarios):
        name = Path(scenario).stem
        tasks[name], start = made.task(scenario, scale)
        Console().print(way_table(made, name, start))
    folder = out or Path(urdf.name.partition(".")[0])
    for path in write_arm(made, tasks, folder, urdf, drive):
        click.echo(path)
    of_drive = f" --drive {drive}" if drive else ""
    click.echo(f"next: slip-vic demo --scenario {folder / next(iter(tasks))}.yaml{of_drive} --out {folder / 'demo'}")


def _position(text: str) -> tuple[str, float]:
    """Read JOINT=VALUE.

    Raises:
        InputError: another form.
    """
    from slip_core.errors import InputError

    name, _, value = text.rpartition("=")
    try:
        return name, float(value)
    except ValueError:
        raise InputError("--lock", got=text, expected="JOINT=VALUE, e.g. torso_lift_joint=0.1") from None
