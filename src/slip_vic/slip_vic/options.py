"""Options that several commands take, each in one form. A mistyped name is answered before anything heavy is loaded."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import click

from slip_core.errors import UnknownName
from slip_core.files.resources import add_package
from slip_vic.presets import find_preset
from slip_vic.scenarios import find_scenario

ALL_LAWS: Final = ("classical", "vic", "governed", "leader_follower", "classical_internal", "printed", "shared")
"""The last four are of several arms."""


def names(text: str) -> tuple[str, ...]:
    """Return the names of a comma separated list."""
    return tuple(name.strip() for name in text.split(",") if name.strip())


def _scenario(context: click.Context, parameter: click.Parameter, value: str) -> str:
    find_scenario(value)
    return value


def _scenarios(context: click.Context, parameter: click.Parameter, value: str) -> tuple[str, ...]:
    for name in names(value):
        find_scenario(name)
    return names(value)


def _sensors(context: click.Context, parameter: click.Parameter, value: str) -> tuple[str, ...]:
    for name in names(value):
        find_preset("sensors", name)
    return names(value)


def _sensor(context: click.Context, parameter: click.Parameter, value: str) -> str:
    if value:
        find_preset("sensors", value)
    return value


def _drive(context: click.Context, parameter: click.Parameter, value: str) -> str:
    if value:
        find_preset("drives", value)
    return value


def _package(context: click.Context, parameter: click.Parameter, values: tuple[str, ...]) -> None:
    for text in values:
        add_package(text)


def URDF(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add ``--urdf`` and ``--package``."""
    return _URDF(PACKAGE(command))


def out_option(default: str | None, text: str, **more: Any) -> Callable[[Any], Any]:
    """Return the option ``-o/--out``; default: None where there is none; text: its help."""
    return click.option(
        "-o", "--out", type=click.Path(path_type=Path), default=default if default is None else Path(default),
        show_default=default is not None, help=text, **more,
    )  # fmt: skip


SCENARIO: Final = click.option(
    "--scenario", default="paper_planar", show_default=True, callback=_scenario, help="name or .yaml file"
)
SCENARIOS: Final = click.option(
    "--scenario",
    "scenarios",
    default="",
    callback=_scenarios,
    help="names or .yaml files, comma separated; default all",
)


def _laws(context: click.Context, parameter: click.Parameter, value: str) -> tuple[str, ...]:
    for name in names(value):
        if name not in ALL_LAWS:
            raise UnknownName("law", name, ALL_LAWS)
    return names(value)


LAWS_OPTION: Final = click.option(
    "--law", "laws", default="classical,vic,governed", show_default=True, callback=_laws, help="comma separated"
)
LAW: Final = click.option(
    "--law", type=click.Choice(ALL_LAWS), default="governed", show_default=True, help="control law"
)  # fmt: skip
SENSOR: Final = click.option("--sensor", default="", callback=_sensor, help="name or .yaml file of a slip sensor")
DRIVE: Final = click.option("--drive", default="", callback=_drive, help="name or .yaml file of the arm's drives")
SENSORS: Final = click.option(
    "--sensor", "sensors", default="", callback=_sensors, help="names or .yaml files, comma separated; default all"
)
ESTIMATOR: Final = click.option(
    "--estimator", type=click.Choice(["measured", "observer"]), help="slip: default what suits the sensor"
)
PARAMS: Final = click.option(
    "--params", type=click.Path(path_type=Path), help="parameter file of the controller, e.g. of bringup or tune"
)
ASSIGNMENTS: Final = click.option(
    "--set", "assignments", multiple=True, metavar="KEY=VALUE", help="override a parameter; repeatable"
)
PACKAGE: Final = click.option(
    "--package",
    multiple=True,
    metavar="NAME=DIR",
    expose_value=False,
    is_eager=True,
    callback=_package,
    help="folder behind package://NAME and $(find NAME) of a URDF or xacro file; repeatable",
)
_URDF: Final = click.option("--urdf", type=click.Path(path_type=Path), help="another arm: URDF or xacro file")
IN_PROCESS: Final = click.option(
    "--in-process", is_flag=True, help="bridge and controller in this process, without DDS: seconds, and no ROS"
)
SEED: Final = click.option(
    "--seed", type=click.IntRange(0), default=0, show_default=True, help="seed of the sensor noise"
)
