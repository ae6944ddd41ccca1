"""Options that several commands take, each in one form, and how a command ends where a run went wrong."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import click

from slip_bags.cli import echo
from slip_core.files.resources import add_package

Choice = dict[str, Any]
"""The scenario that a command line chooses: arguments of `slip_vic.load`."""
Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


def names(text: str) -> tuple[str, ...]:
    """Return the names of a comma separated list."""
    return tuple(name.strip() for name in text.split(",") if name.strip())


def listed(flag: str, default: str, words: str) -> Decorator:
    """Return an option of comma separated names; the command gets a tuple, under the plural."""
    return click.option(
        flag, f"{flag.removeprefix('--')}s", default=default, show_default=bool(default), help=words,
        callback=lambda _context, _parameter, value: names(value),
    )  # fmt: skip


def _package(context: click.Context, parameter: click.Parameter, values: tuple[str, ...]) -> None:
    for text in values:
        add_package(text)


def out_option(default: str | None, text: str, **more: Any) -> Decorator:
    """Return the option ``-o/--out``; default: None where there is none; text: its help."""
    return click.option(
        "-o", "--out", type=click.Path(path_type=Path), default=default if default is None else Path(default),
        show_default=default is not None, help=text, **more,
    )  # fmt: skip


SCENARIO: Final = click.option("--scenario", default="paper_planar", show_default=True, help="name or .yaml file")
SCENARIOS: Final = listed("--scenario", "", "names or .yaml files, comma separated; default all")
SENSOR: Final = click.option("--sensor", default="", help="name or .yaml file of a slip sensor")
DRIVE: Final = click.option("--drive", default="", help="name or .yaml file of the arm's drives")
ASSIGNMENTS: Final = click.option("--set", multiple=True, metavar="KEY=VALUE", help="override a parameter; repeatable")
PACKAGE: Final = click.option(
    "--package", multiple=True, metavar="NAME=DIR", expose_value=False, is_eager=True, callback=_package,
    help="folder behind package://NAME and $(find NAME) of a URDF or xacro file; repeatable",
)  # fmt: skip


_OF_CHOICE: Final[Mapping[str, Decorator]] = {
    "scenario": SCENARIO,
    "law": click.option(
        "--law", default="governed", show_default=True, help="classical, vic, governed, governed_follow or printed"
    ),
    "mode": click.option("--mode", type=click.Choice(["lockstep", "realtime"]), default="lockstep", show_default=True),
    "seed": click.option(
        "--seed", type=click.IntRange(0), default=0, show_default=True, help="seed of the sensor noise"
    ),
    "sensor": SENSOR,
    "drive": DRIVE,
    "gripper": click.option("--gripper", default="", help="name or .yaml file of a gripper"),
    "parameters": click.option(
        "--params", "parameters", type=click.Path(path_type=Path),
        help="parameter file of the controller, e.g. of bringup or tune",
    ),
    "set": ASSIGNMENTS,
}  # fmt: skip


def choosing(*parts: str) -> Decorator:
    """Add the options of these parts of a `Choice`, which the command gets as one argument, and ``--package``."""

    def add(command: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(command)
        def with_choice(**given: Any) -> Any:
            return command(choice={part: given.pop(part) for part in parts}, **given)

        found: Callable[..., Any] = PACKAGE(with_choice)
        for part in reversed(parts):
            found = _OF_CHOICE[part](found)
        return found

    return add


DOMAIN_ID: Final = click.option(
    "--domain-id", type=click.IntRange(0, 232), envvar="ROS_DOMAIN_ID", show_envvar=True,
    help="ROS domain id, 0 to 101 is safe; default for a run: a free one",
)  # fmt: skip


def end_with(incidents: Iterable[str]) -> None:
    """Report what went wrong, a line each, and end with exit code 1 where anything did."""
    lines = list(incidents)
    for line in lines:
        echo(line, err=True)
    if lines:
        raise click.exceptions.Exit(1)
