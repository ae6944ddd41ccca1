"""Options that several commands take, each in one form, and how a command ends where a run went wrong.

A mistyped name is answered before anything heavy is loaded.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import click

from slip_core.files.resources import add_package
from slip_vic.presets import find_preset

ALL_LAWS: Final = ("classical", "vic", "governed", "governed_follow", "printed")
Choice = dict[str, Any]
"""The scenario that a command line chooses: arguments of `load_scenario`."""
Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


def names(text: str) -> tuple[str, ...]:
    """Return the names of a comma separated list."""
    return tuple(name.strip() for name in text.split(",") if name.strip())


def _law(name: str) -> None:
    """Check a law; a foreign one, or one with a changed parameter, where that is loaded anyway."""
    base = name.partition("?")[0]
    if base in ALL_LAWS:
        return
    from slip_vic.experiments.law import find_law

    find_law(name)


def _checked(find: Callable[[str], object], *, many: bool) -> Callable[[click.Context, click.Parameter, str], Any]:
    """Return the callback of an option with a name, or comma separated ones, that `find` must know; or none."""

    def check(context: click.Context, parameter: click.Parameter, value: str) -> Any:
        found = names(value) if many else tuple(filter(None, [value]))
        for name in found:
            find(name)
        return found if many else value

    return check


def _preset(kind: str, words: str, *, many: bool = False, **more: Any) -> Decorator:
    """Return the option of a preset, or several."""
    flag, find = f"--{kind}", functools.partial(find_preset, f"{kind}s")
    dest = f"{kind}s" if many else kind
    return click.option(flag, dest, **{"default": "", "callback": _checked(find, many=many), "help": words, **more})


def _package(context: click.Context, parameter: click.Parameter, values: tuple[str, ...]) -> None:
    for text in values:
        add_package(text)


def out_option(default: str | None, text: str, **more: Any) -> Decorator:
    """Return the option ``-o/--out``; default: None where there is none; text: its help."""
    return click.option(
        "-o", "--out", type=click.Path(path_type=Path), default=default if default is None else Path(default),
        show_default=default is not None, help=text, **more,
    )  # fmt: skip


SCENARIO: Final = _preset("scenario", "name or .yaml file", default="paper_planar", show_default=True)
SCENARIOS: Final = _preset("scenario", "names or .yaml files, comma separated; default all", many=True)
SENSOR: Final = _preset("sensor", "name or .yaml file of a slip sensor")
SENSORS: Final = _preset("sensor", "names or .yaml files, comma separated; default all", many=True)
DRIVE: Final = _preset("drive", "name or .yaml file of the arm's drives")
GRIPPER: Final = _preset("gripper", "name or .yaml file of a gripper")
DRIVES: Final = _preset("drive", "names or .yaml files, comma separated", many=True)
LAWS_OPTION: Final = click.option(
    "--law", "laws", default="classical,vic,governed", show_default=True, callback=_checked(_law, many=True),
    help="comma separated",
)  # fmt: skip
ASSIGNMENTS: Final = click.option(
    "--set", "assignments", multiple=True, metavar="KEY=VALUE", help="override a parameter; repeatable"
)
PACKAGE: Final = click.option(
    "--package", multiple=True, metavar="NAME=DIR", expose_value=False, is_eager=True, callback=_package,
    help="folder behind package://NAME and $(find NAME) of a URDF or xacro file; repeatable",
)  # fmt: skip


def URDF(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add ``--urdf`` and ``--package``."""
    urdf = click.option("--urdf", type=click.Path(path_type=Path), help="another arm: URDF or xacro file")
    return urdf(PACKAGE(command))


_OF_CHOICE: Final[Mapping[str, Decorator]] = {
    "scenario": SCENARIO,
    "law": click.option(
        "--law", type=click.Choice(ALL_LAWS), default="governed", show_default=True, help="control law"
    ),
    "mode": click.option("--mode", type=click.Choice(["lockstep", "realtime"]), default="lockstep", show_default=True),
    "seed": click.option(
        "--seed", type=click.IntRange(0), default=0, show_default=True, help="seed of the sensor noise"
    ),
    "sensor": SENSOR,
    "drive": DRIVE,
    "gripper": GRIPPER,
    "parameters": click.option(
        "--params",
        "parameters",
        type=click.Path(path_type=Path),
        help="parameter file of the controller, e.g. of bringup or tune",
    ),
    "assignments": ASSIGNMENTS,
    "urdf": URDF,
}


def choosing(*parts: str) -> Decorator:
    """Add the options of these parts of a `Choice`; the command gets them as one argument, `choice`."""

    def add(command: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(command)
        def with_choice(**given: Any) -> Any:
            return command(choice={part: given.pop(part) for part in parts}, **given)

        found: Callable[..., Any] = with_choice
        for part in reversed(parts):
            found = _OF_CHOICE[part](found)
        return found

    return add


IN_PROCESS: Final = click.option(
    "--in-process", is_flag=True, help="bridge and controller in this process, without DDS: seconds, and no ROS"
)
DOMAIN_ID: Final = click.option("--domain-id", type=int, help="ROS domain id; default ROS_DOMAIN_ID, else a free one")


def end_with(incidents: Iterable[str]) -> None:
    """Report what went wrong, a line each, and end with exit code 1 where anything did."""
    lines = list(incidents)
    for line in lines:
        click.echo(line, err=True)
    if lines:
        raise click.exceptions.Exit(1)
