"""``slip-vic arm``, ``slip-vic bringup`` and ``slip-vic identify``: an arm of one's own."""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from slip_bags.cli import echo
from slip_core.errors import InputError
from slip_core.topics import checked_namespace
from slip_vic.options import DOMAIN_ID, DRIVE, PACKAGE, SENSOR, listed, out_option

T = TypeVar("T")
AXIS = click.Choice(["x", "-x", "y", "-y", "z", "-z"])


@click.command()
@click.argument("urdf", type=click.Path(path_type=Path))
@PACKAGE
@click.option("--arg", "arguments", multiple=True, metavar="NAME:=VALUE", help="argument of a xacro file; repeatable")
@click.option("--ee", "link", default="", metavar="LINK", help="link at the hand; default: found")
@click.option("--approach", type=AXIS, default=None, help="axis of the link out of the hand; default: found")
@click.option("--normal", type=AXIS, default=None, help="axis of the link along which the jaws close; default: found")
@click.option("--reach", type=float, default=0.0, show_default=True, help="distance to the pad centre [m]")
@click.option("--lock", "locks", multiple=True, metavar="JOINT=VALUE", help="lock a joint at a position; repeatable")
@click.option(
    "--limit", "limits", multiple=True, metavar="JOINT=EFFORT,VELOCITY",
    help="limits [N m, rad/s] that the file lacks; one may be empty, JOINT may be *; repeatable",
)  # fmt: skip
@listed("--scenario", "paper_planar", "names, comma separated")
@click.option("--scale", type=click.FloatRange(0.01, 10.0), default=1.0, show_default=True, help="size of the path")
@DRIVE
@SENSOR
@click.option(
    "--driver",
    type=click.Choice(["ur", "franka", "xarm", "kinova", "generic"]),
    help="write controllers.yaml and launch files for this ros2_control driver, which also chooses --drive",
)
@out_option(None, "folder; default: named like the file, here")
def arm(
    *, urdf: Path, arguments: tuple[str, ...], link: str, approach: str | None, normal: str | None, reach: float,
    locks: tuple[str, ...], limits: tuple[str, ...], scenarios: tuple[str, ...], scale: float, drive: str, sensor: str,
    driver: str | None, out: Path | None,
) -> None:  # fmt: skip
    """Make a folder from an arm's URDF or xacro file: arm.urdf, scenarios, parameters for the real arm."""
    from slip_core.files.urdf_file import read_urdf
    from slip_vic.presets.models import DrivePreset, load_preset
    from slip_vic.setup.arm.driver import DRIVERS
    from slip_vic.setup.arm.write import Arm, way_table, write_arm

    known, called = DRIVERS[driver] if driver else None, f"URDF {urdf}"
    drive = drive or (known.drive if known else "")
    made = Arm(
        read_urdf(str(urdf), called, _pairs("--arg", arguments, ":=", str, "NAME:=VALUE, e.g. ur_type:=ur5e")),
        name=called,
        link=link,
        approach=approach or "",
        normal=normal or "",
        reach=reach,
        locked=_pairs("--lock", locks, "=", float, "JOINT=VALUE, e.g. torso_lift_joint=0.1"),
        limits=_pairs(
            "--limit", limits, "=", _limits, "JOINT=EFFORT,VELOCITY above 0 [N m, rad/s], e.g. '*=28,3.1', '*=,3.1'"
        ),
        by_effort=not drive or load_preset(DrivePreset, drive).drive.interface == "effort",
    )
    for line in made.said:
        echo(line)
    tasks: dict[str, dict[str, Any]] = {}
    for scenario in scenarios:
        if (name := Path(scenario).stem) in tasks:
            raise InputError(
                f"--scenario {scenario}", got=f"the name {name}", expected="another name for each scenario"
            )
        tasks[name], start, said = made.task(scenario, scale)
        echo(way_table(made, name, start))
        for line in said:
            echo(line)
    folder = out or Path(urdf.name.partition(".")[0])
    for path in write_arm(made, tasks, folder, urdf, drive, sensor, known):
        echo(path)
    given = {"scenario": f"{folder / next(iter(tasks))}.yaml", "drive": drive, "sensor": sensor, "out": folder / "demo"}
    words = [word for name, value in given.items() if value for word in (f"--{name}", str(value))]
    echo(f"next: {shlex.join(['slip-vic', 'demo', *words])}")


def _pairs(option: str, texts: tuple[str, ...], separator: str, read: Callable[[str], T], form: str) -> dict[str, T]:
    """Read the values of a repeatable option by their names.

    Raises:
        InputError: without a name, or a value that `read` does not take.
    """
    found = {}
    for text in texts:
        name, _, value = text.rpartition(separator)
        try:
            found[name] = read(value)
        except ValueError:
            name = ""
        if not name:
            raise InputError(option, got=text, expected=form)
    return found


def _limits(text: str) -> dict[str, float]:
    """Read EFFORT,VELOCITY, of which one may be empty.

    Raises:
        ValueError: no number above 0.
    """
    words = zip(("effort", "velocity"), text.split(","), strict=False)
    found = {key: float(word) for key, word in words if word.strip()}
    if not found or not all(0.0 < value < math.inf for value in found.values()):
        raise ValueError(text)
    return found


@click.command()
@click.option("--namespace", callback=checked_namespace, default="", help="ROS namespace of the controller")
@DOMAIN_ID
@click.option("--simulated", is_flag=True, help="simulated arm: push without a person")
@out_option("bringup.yaml", "parameter file")
def bringup(namespace: str, domain_id: int | None, simulated: bool, out: Path) -> None:
    """Bring up a controller and its drivers step by step, from topics and signs to a first governed motion.

    Both must run; the controller with trajectory.kind goal, governor.mode slow_down, governor.friction unknown and
    safety.auto_enable false. Each step shows measured and expected values. If a step fails, the exit code is 1, with
    the fix in one line. Measured sensor parameters are written to --out: load them after the controller's own file, or
    pass them to `slip-vic check --params` and `slip-vic run --params`.
    """
    from slip_vic.scenarios.parameter_files import write_files

    write_files(out.parent, {})  # here, not after the walk
    from slip_msgs_py.node_main import ros_node
    from slip_sim_bridge.params import BridgeParams
    from slip_vic.setup.bringup.hands import Hands, Person, Simulated
    from slip_vic.setup.bringup.heard import BRIDGE
    from slip_vic.setup.bringup.ros_system import RosSystem
    from slip_vic.setup.bringup.walk import Walk

    with ros_node("slip_vic_bringup", domain=domain_id) as node:
        system = RosSystem(node, namespace)
        hands: Hands = Person(system)
        if simulated:
            hands = Simulated(system, system.parameters(BridgeParams, BRIDGE))
        walk = Walk(system, hands)
        for verdict in walk.steps():
            echo(str(verdict), err=not verdict.holds)
            if not verdict.holds:
                raise click.exceptions.Exit(1)
    write_files(out.parent, {out.name: walk.parameter_file()})
    echo(f"{out}: noise, rate and latency as measured")


@click.command()
@click.argument("bag", type=click.Path(path_type=Path))
@click.option("--ee-frame", default="ee", show_default=True, help="link of the URDF that the wrench is measured at")
@out_option(None, "write a drive file for --drive with these numbers")
def identify(bag: Path, ee_frame: str, out: Path | None) -> None:
    """Find noise, quantum, friction and offset of each joint in a recorded slow motion.

    The bag needs joint states with efforts and the arm's URDF; a wrench in their namespace is subtracted. Each joint
    has to move slowly in both directions: docs/drives.md. Slip velocities of a slipping object are compared in
    direction and rate with the wrench and the stamps.
    """
    from slip_vic.scenarios.parameter_files import write_files
    from slip_vic.setup.identify import COLUMNS, preset, read_motion, slip_mistake
    from slip_vic.setup.identify import identify as found_in

    motion = read_motion(bag)
    numbers = found_in(motion, ee_frame)
    echo(numbers.rename(columns=COLUMNS).to_string(float_format="{:.3g}".format, na_rep="-"))
    if words := slip_mistake(motion):
        echo(words)
    if out is not None:
        write_files(out.parent, {out.name: preset(numbers, f"slip-vic identify {bag}")})
        echo(out)
