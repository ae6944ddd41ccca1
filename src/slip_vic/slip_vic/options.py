"""Options that several commands take, each said once."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import click

SCENARIO: Final = click.option("--scenario", default="paper_planar", show_default=True, help="name or .yaml file")
CONTROLLER: Final = click.option(
    "--controller", type=click.Choice(["vic", "classical", "governed"]), default="governed", show_default=True,
    help="control law",
)  # fmt: skip
PARAMS: Final = click.option(
    "--params", type=click.Path(path_type=Path), help="parameter file of the controller, e.g. of bringup or tune"
)
ASSIGNMENTS: Final = click.option(
    "--set", "assignments", multiple=True, metavar="KEY=VALUE", help="override a parameter; repeatable"
)
URDF: Final = click.option("--urdf", type=click.Path(path_type=Path), help="another arm")
