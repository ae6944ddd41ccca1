"""``slip-vic study``, ``check``, ``tune`` and ``benchmark``."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

from slip_core.errors import require_extra
from slip_vic.options import (
    ASSIGNMENTS,
    DRIVES,
    LAWS_OPTION,
    SCENARIO,
    SCENARIOS,
    SENSOR,
    SENSORS,
    URDF,
    Choice,
    Decorator,
    choosing,
    end_with,
    names,
    out_option,
)

if TYPE_CHECKING:
    from slip_vic.experiments.engines import EngineName


JOBS = click.option(
    "--jobs", type=click.IntRange(1), default=os.cpu_count() or 1, help="parallel processes; default one per core"
)
ENGINE = click.option(
    "--engine", type=click.Choice(["pool", "ray"]), default="pool", show_default=True,
    help="pool: processes of this machine; ray: the cluster at RAY_ADDRESS, else one on this machine",
)  # fmt: skip


def _mismatches(context: click.Context, parameter: click.Parameter, text: str) -> tuple[str, ...]:
    if text != "all":
        return names(text)
    from slip_vic.experiments.world import MISMATCHES

    return MISMATCHES


def mismatches_option(default: str) -> Decorator:
    """Return the option ``--mismatch``."""
    return click.option(
        "--mismatch", "mismatches", default=default, show_default=True, callback=_mismatches,
        help="errors of the configuration: names, comma separated, or all",
    )  # fmt: skip


@click.command()
@SCENARIOS
@SENSORS
@LAWS_OPTION
@mismatches_option("none")
@click.option("--seeds", type=click.IntRange(1), default=5, show_default=True, help="how many, from 0 on")
@out_option("study", "folder; one that has rows continues")
@JOBS
@ENGINE
@DRIVES
@ASSIGNMENTS
@URDF
@click.option(
    "--lottery", "drawn", type=click.IntRange(0), default=0,
    help="draw so many random worlds instead, with drives, joints and sensors with all troubles at once",
)  # fmt: skip
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="of the lottery")
def study(
    *, scenarios: tuple[str, ...], sensors: tuple[str, ...], laws: tuple[str, ...], mismatches: tuple[str, ...],
    seeds: int, out: Path, jobs: int, engine: EngineName,
    drives: tuple[str, ...], assignments: tuple[str, ...], urdf: Path | None, drawn: int, seed: int,
) -> None:  # fmt: skip
    """Run scenario x drive x sensor x mismatch under laws over seeds: table, rows.csv, rows.png.

    A law is one of the controller, or yours: module:Class or file.py:Class; `vic?slip_estimator=measured` changes a
    parameter of the controller. Names every run that did not end well in a line, and ends with exit code 1 where there
    is one.
    """
    from slip_vic.experiments.draw import drawn_worlds
    from slip_vic.experiments.runner import bad_ones, run_study, under_laws
    from slip_vic.experiments.world import combined
    from slip_vic.presets import preset_names
    from slip_vic.scenarios import scenario_names
    from slip_vic.scenarios.scenario import drive_assignments

    if drawn:
        given = click.get_current_context().get_parameter_source
        if wrong := [
            name for name in ("sensors", "mismatches", "seeds", "urdf") if given(name) is ParameterSource.COMMANDLINE
        ]:
            raise click.UsageError(f"--lottery draws its worlds itself and takes no --{', --'.join(wrong)}")
        worlds = list(drawn_worlds(drawn, seed, scenarios, "".join(drives[:1]), assignments))
    else:
        chosen = scenarios or tuple(scenario_names(1))
        arm = () if urdf is None else (f"robot_description_file={json.dumps(str(urdf))}",)
        settings = (*arm, *assignments)
        by_drive = {drive: drive_assignments(drive, chosen[0], settings) if drive else () for drive in drives or ("",)}
        worlds = combined(
            chosen, sensors or tuple(preset_names("sensors")), mismatches, range(seeds), by_drive,
            settings,
        )  # fmt: skip
        for world in {world.scenario: world for world in worlds}.values():
            world.load("classical").check()
    end_with(bad_ones(run_study(under_laws(worlds, laws), out, engine, jobs)))


@click.command()
@choosing("scenario", "parameters", "sensor", "drive", "gripper", "law", "assignments", "urdf")
@mismatches_option("all")
def check(*, choice: Choice, mismatches: tuple[str, ...]) -> None:
    """Check what will hold before anything moves: gains, arm, path, and worlds that differ from the configured one.

    Bound on k_s, Propositions 1 to 3, M_D over the inertia of the wrist; whether the arm can start where the scenario
    has it and follow its path; then simulations in this process. Exit code 2 where gains or path are refused, 1 where
    the object does not arrive in a simulated world.
    """
    from rich.console import Console

    from slip_vic.experiments.check import gain_lines, hindered, judged, run_worlds
    from slip_vic.experiments.tables import tables_of
    from slip_vic.run.prepare import prepare
    from slip_vic.scenarios.scenario import load_scenario

    loaded = load_scenario(**choice)
    prepare()
    report = judged(loaded)
    for line in gain_lines(report):
        click.echo(line)
    if not report.hold:
        raise click.exceptions.Exit(2)
    loaded.check()
    with Console(stderr=True).status("path") as status:
        rows = list(run_worlds(choice, mismatches, lambda name: status.update(f"simulates {name}")))
    if rows[0]["outcome"] == "refused":
        click.echo(f"refused: {rows[0]['reason']}", err=True)
        raise click.exceptions.Exit(2)
    click.echo("\n\n".join(tables_of(rows)))
    failed = {row["mismatch"]: why for row in rows if (why := hindered(row))}
    click.echo(f"holds in {len(rows) - len(failed)} of {len(rows)} simulated worlds")
    end_with(f"{mismatch}: {why}" for mismatch, why in failed.items())


@click.command()
@SCENARIO
@SENSOR
@click.option("--law", type=click.Choice(["vic", "governed"]), default="vic", show_default=True, help="control law")
@mismatches_option("none,mass+,mass-,friction+,friction-")
@click.option(
    "--seeds", type=click.IntRange(1), default=2, show_default=True, help="that the search sees; as many more try it"
)
@click.option("--trials", type=click.IntRange(2), default=40, show_default=True, help="sets that are tried")
@out_option("tune", "folder; one that has rows continues")
@JOBS
@ENGINE
@ASSIGNMENTS
def tune(
    *, scenario: str, sensor: str, law: str, mismatches: tuple[str, ...], seeds: int, trials: int, out: Path, jobs: int,
    engine: EngineName, assignments: tuple[str, ...],
) -> None:  # fmt: skip
    """Search gains for less slip with a sensor: rows.csv, controller.yaml."""
    require_extra("optuna", "slip-vic tune", "tune")
    from slip_vic.experiments.tune import run_tune
    from slip_vic.experiments.world import World

    base = World(scenario, sensor, settings=assignments)
    click.echo(run_tune(base, law, mismatches, seeds, trials, out, engine, jobs))


@click.group()
def benchmark() -> None:
    """Compare control laws, yours too, in the worlds of the suite carry-2026.2."""


@benchmark.command()
@click.argument("law")
@click.option("--worlds", type=click.IntRange(1), default=300, show_default="all", help="the first N of each track")
@click.option("--arms", type=click.Choice(["1", "2"]), help="only worlds with so many; default: both")
@out_option(None, "folder of this law; default out/benchmark/LAW")
@JOBS
@ENGINE
def run(*, law: str, worlds: int, arms: str | None, out: Path | None, jobs: int, engine: EngineName) -> None:
    """Run LAW (a name, module:Class or file.py:Class); a folder that has worlds already continues."""
    from slip_vic.experiments import suite
    from slip_vic.experiments.law import find_law
    from slip_vic.experiments.runner import run_study, under_laws

    found = find_law(law)
    folder = out or Path("out") / "benchmark" / found.label
    chosen = suite.suite(found, worlds, (int(arms),) if arms else (1, 2))
    run_study(under_laws(chosen, (law,)), folder, engine, jobs, {"suite": suite.DIGEST})


@benchmark.command()
@click.argument("folders", nargs=-1, required=True, type=click.Path(path_type=Path))
@out_option("out/benchmark", "folder of the picture")
def compare(folders: tuple[Path, ...], out: Path) -> None:
    """Compare results in the worlds that all of them have: table, rows.png."""
    from slip_vic.experiments.runner import show
    from slip_vic.experiments.suite import compared
    from slip_vic.run.lock import own_folder

    rows = compared(folders)
    with own_folder(out):
        show(rows, out)


@benchmark.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--law", default="", help="of the result, where it is none of this suite: its code runs")
def verify(folder: Path, law: str) -> None:
    """Run ten worlds of a result again, drawn by its own digest; exit code 1 where one differs."""
    from slip_vic.experiments.suite import verify_result

    count, wrong = verify_result(folder, law)
    click.echo(f"{folder}: {count} worlds ran again, {'they differ' if wrong else 'all are equal'}")
    end_with(wrong)
