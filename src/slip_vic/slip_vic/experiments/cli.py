"""``slip-vic study``, ``merge``, ``check``, ``tune`` and ``benchmark``."""

from __future__ import annotations

import os
import re
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

from slip_core.errors import UnknownName, require_extra
from slip_vic.options import (
    ALLOW_FAULT,
    ASSIGNMENTS,
    DRIVES,
    LAWS_OPTION,
    SCENARIO,
    SCENARIOS,
    SENSOR,
    SENSORS,
    URDF,
    Choice,
    choosing,
    end_with,
    names,
    out_option,
)

if TYPE_CHECKING:
    from slip_vic.experiments.engines import EngineName
    from slip_vic.experiments.world import Track
    from slip_vic.scenarios.scenario import Estimator, Law


ESTIMATORS = ("measured", "observer")


def shard(context: click.Context, parameter: click.Parameter, text: str) -> tuple[int, int]:
    """Read I/N."""
    found = re.fullmatch(r"(\d+)/(\d+)", text)
    if found is None or not 1 <= int(found[1]) <= int(found[2]):
        raise click.BadParameter(f"{text} is not i/n with i from 1 to n")
    return int(found[1]), int(found[2])


def workers(command: click.decorators.FC) -> click.decorators.FC:
    """Add the options that say on which workers a command runs its cases."""
    jobs = click.option(
        "--jobs", type=click.IntRange(1), default=os.cpu_count() or 1, help="parallel processes; default one per core"
    )
    engine = click.option(
        "--engine", type=click.Choice(["pool", "ray"]), default="pool", show_default=True,
        help="pool: processes of this machine; ray: the cluster at RAY_ADDRESS, else one on this machine",
    )  # fmt: skip
    return engine(jobs(command))


@click.command()
@SCENARIOS
@SENSORS
@LAWS_OPTION
@click.option("--estimator", "estimators", default="observer", show_default=True, help="measured, observer, or both")
@click.option("--mismatch", "mismatches", default="none", show_default=True, help="names, comma separated, or all")
@click.option("--seeds", type=click.IntRange(1), default=5, show_default=True, help="how many seeds")
@click.option("--first", type=click.IntRange(0), default=0, show_default=True, help="the first seed")
@out_option("study", "folder")
@workers
@click.option("--shard", default="1/1", callback=shard, metavar="I/N", help="every N-th world from the I-th on")
@click.option("--resume", "go_on", is_flag=True, help="continue the study in --out")
@DRIVES
@ASSIGNMENTS
@URDF
@click.option(
    "--lottery",
    "drawn",
    type=click.IntRange(0),
    default=0,
    help="draw so many random worlds instead, without --drive with drives, joints and all troubles at once",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="of the lottery")
@ALLOW_FAULT
def study(
    *, scenarios: tuple[str, ...], sensors: tuple[str, ...], laws: tuple[str, ...], estimators: str, mismatches: str,
    seeds: int, first: int, out: Path, jobs: int, engine: EngineName, shard: tuple[int, int], go_on: bool,
    drives: tuple[str, ...], assignments: tuple[str, ...], urdf: Path | None, drawn: int, seed: int, allow_fault: bool,
) -> None:  # fmt: skip
    """Run scenario x drive x sensor x mismatch under laws over seeds: study.csv, study.png; continues where it stopped.

    A law is one of the controller, or yours: module:Class or file.py:Class. Names every run that did not end well in a
    line, and ends with exit code 1 where there is one.
    """
    from slip_vic.experiments.draw import drawn_worlds
    from slip_vic.experiments.rows import Asked
    from slip_vic.experiments.study import resume, run_study
    from slip_vic.experiments.world import MISMATCHES, combined
    from slip_vic.presets import preset_names
    from slip_vic.scenarios import scenario_names
    from slip_vic.scenarios.scenario import drive_assignments, urdf_assignment

    if go_on:
        done = resume(out, engine, jobs)
    elif drawn:
        given = _given({"drawn", "seed", "scenarios", "laws", "assignments", "out", "jobs", "engine", "shard", "drives",
                        "allow_fault"})  # fmt: skip
        drive = drives[0] if "drives" in given and drives else ""
        scenario = (*scenarios, *scenario_names(1))[0]
        settings = (*drive_assignments(drive, scenario, assignments), *assignments) if drive else assignments
        worlds = tuple(drawn_worlds(drawn, seed, scenarios, drives=not drive, assignments=settings))
        done = run_study([Asked(worlds[shard[0] - 1 :: shard[1]], laws)], out, engine, jobs, check=False)
    else:
        wrong = MISMATCHES if mismatches == "all" else names(mismatches)
        chosen = scenarios or tuple(scenario_names(1))
        settings = (*urdf_assignment(urdf), *assignments)
        by_drive = {drive: drive_assignments(drive, chosen[0], settings) if drive else () for drive in drives or ("",)}
        all_worlds = combined(
            chosen, sensors or tuple(preset_names("sensors")), wrong, range(first, first + seeds), by_drive, settings
        )
        wanted = tuple(_with_estimators(laws, names(estimators)))
        done = run_study([Asked(tuple(all_worlds[shard[0] - 1 :: shard[1]]), wanted)], out, engine, jobs)
    click.echo(done.line)
    end_with(done.bad, allow_fault)


def _with_estimators(laws: tuple[str, ...], estimators: tuple[str, ...]) -> Iterator[str]:
    """Yield each law with each estimator of the slip velocity; the observer is what laws have without a remark."""
    for name in estimators:
        if name not in ESTIMATORS:
            raise UnknownName("estimator", name, ESTIMATORS)
    for law in laws:
        if law not in ("vic", "governed"):
            yield law
            continue
        for name in estimators:
            yield law if name == "observer" else f"{law}?slip_estimator={name}"


def _given(used: set[str]) -> set[str]:
    """Return the names of the options that the command line gives; one that the lottery does not use is an error."""
    context = click.get_current_context()
    given = {name for name in context.params if context.get_parameter_source(name) is ParameterSource.COMMANDLINE}
    for option in context.command.params:
        if option.name in given - used:
            raise click.UsageError(f"--lottery draws its worlds itself and takes no {option.opts[0]}")
    return given


@click.command()
@click.argument("folders", nargs=-1, required=True, type=click.Path(path_type=Path))
@out_option(None, "folder", required=True)
def merge(folders: tuple[Path, ...], out: Path) -> None:
    """Put studies that were made in parts (--shard) into one folder; parts that do not fit are refused."""
    from slip_vic.experiments.study import merge_studies

    click.echo(merge_studies(folders, out))


@click.command()
@choosing("scenario", "params", "sensor", "drive", "estimator", "law", "assignments", "urdf")
@click.option("--mismatch", "mismatches", default="all", show_default=True, help="worlds to simulate: names, or all")
def check(*, choice: Choice, mismatches: str) -> None:
    """Check what will hold before anything moves: gains, arm, path, and worlds that differ from the configured one.

    Bound on k_s, Propositions 1 to 3; whether the arm can start where the scenario has it and follow its path; what the
    path takes of the friction, where, and how long the motion lasts; then simulations in this process. Exit code 2
    where gains or path are refused, 1 where a simulated world does not hold.
    """
    from rich.console import Console

    from slip_vic.experiments.check import corner_table, gain_table, gains, path_lines, path_load, refusal, run_corners
    from slip_vic.experiments.world import MISMATCHES, check_mismatches

    wanted = MISMATCHES if mismatches == "all" else names(mismatches)
    check_mismatches(wanted)
    loaded = choice.load()
    report = gains(loaded)
    remarks = loaded.check_arm()
    console = Console()
    console.print(gain_table(loaded, report, choice.sensor))
    for condition in report.conditions:
        click.echo(f"{condition.name}: {condition.reason}")
    if not report.hold:
        raise click.exceptions.Exit(2)
    loaded.check()
    with Console(stderr=True).status("path") as status:
        load = path_load(loaded)
        corners = list(run_corners(choice, wanted, lambda name: status.update(f"simulates {name}")))
    for line in (*path_lines(load, corners[0]), *remarks):
        click.echo(line)
    refused = refusal(load, corners[0])
    if refused:
        click.echo(refused, err=True)
        raise click.exceptions.Exit(2)
    console.print(corner_table(corners))
    failed = [corner for corner in corners if not corner.holds]
    click.echo(f"holds in {len(corners) - len(failed)} of {len(corners)} simulated worlds")
    end_with((f"{corner.mismatch}: {corner.reason}" for corner in failed), allowed=False)


@click.command()
@SCENARIO
@SENSOR
@click.option("--law", type=click.Choice(["vic", "governed"]), default="vic", show_default=True, help="control law")
@click.option("--estimator", type=click.Choice(["measured", "observer"]), default="observer", show_default=True)
@click.option("--mismatch", "mismatches", default="none,mass+,mass-,friction+,friction-", show_default=True)
@click.option("--seeds", type=click.IntRange(1), default=2, show_default=True, help="seeds that the search sees")
@click.option(
    "--unseen", type=click.IntRange(1), default=5, show_default=True, help="seeds that the result is tried on"
)
@click.option("--trials", type=click.IntRange(2), default=40, show_default=True, help="sets that are tried")
@click.option("--batch", type=click.IntRange(1), default=4, show_default=True, help="sets that run at the same time")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="of the search")
@click.option(
    "--effort-rate", type=click.FloatRange(1.0), default=1.2, show_default=True,
    help="largest effort rate, as a factor on the default's in the same world",
)  # fmt: skip
@click.option("--later", type=click.FloatRange(0.0), default=0.3, show_default=True, help="latest arrival after it [s]")
@out_option("tune", "folder")
@workers
@ASSIGNMENTS
def tune(
    *,
    scenario: str,
    sensor: str,
    law: Law,
    estimator: Estimator,
    mismatches: str,
    seeds: int,
    unseen: int,
    trials: int,
    batch: int,
    seed: int,
    effort_rate: float,
    later: float,
    out: Path,
    jobs: int,
    engine: EngineName,
    assignments: tuple[str, ...],
) -> None:
    """Search gains for less slip with a sensor: controller.yaml, tune.html; continues where it stopped."""
    require_extra("optuna", "slip-vic tune", "tune")
    from slip_vic.experiments.tune.command import Wanted, run_tune
    from slip_vic.experiments.tune.space import Bounds
    from slip_vic.experiments.world import MISMATCHES

    wrong = MISMATCHES if mismatches == "all" else names(mismatches)
    bounds = Bounds(effort_rate, later)
    wanted = Wanted(scenario, law, sensor, estimator, wrong, seeds, unseen, bounds, trials, batch, seed, assignments)
    click.echo(run_tune(wanted, out, engine, jobs, shlex.join(["slip-vic", *sys.argv[1:]])))


@click.group()
def benchmark() -> None:
    """Compare control laws, yours too, in the worlds of the suite carry-2026.1."""


@benchmark.command()
@click.argument("law")
@click.option("--worlds", type=click.IntRange(1), default=300, show_default="all", help="the first N of each track")
@click.option("--track", type=click.Choice(["capped", "free"]), help="of the grip; default: that of the law")
@click.option("--arms", type=click.Choice(["1", "2"]), help="only worlds with so many; default: both")
@out_option(None, "folder of this law; default out/benchmark/LAW")
@workers
@click.option("--shard", default="1/1", callback=shard, metavar="I/N", help="every N-th world from the I-th on")
def run(
    *, law: str, worlds: int, track: Track | None, arms: str | None, out: Path | None, jobs: int,
    engine: EngineName, shard: tuple[int, int],
) -> None:  # fmt: skip
    """Run LAW (a name, module:Class or file.py:Class); a folder that has worlds already continues."""
    from slip_vic.experiments.law import find_law
    from slip_vic.experiments.suite import run_law

    folder = out or Path("out") / "benchmark" / find_law(law).label
    click.echo(run_law(law, worlds, folder, engine, jobs, shard, track, (int(arms),) if arms else (1, 2)))


@benchmark.command()
@click.argument("folders", nargs=-1, required=True, type=click.Path(path_type=Path))
@out_option("out/benchmark", "folder")
def compare(folders: tuple[Path, ...], out: Path) -> None:
    """Compare results in the worlds that all of them have: table, compare.png, compare.html."""
    from rich.console import Console

    from slip_vic.experiments.compare import compare as write
    from slip_vic.experiments.compare import table_for

    lines, line = write(folders, out)
    console = Console()
    console.print(table_for(console, lines))
    click.echo(line)


@benchmark.command()
@click.argument("folder", type=click.Path(path_type=Path))
def verify(folder: Path) -> None:
    """Run ten worlds of a result again, drawn by its own digest; exit code 1 where one differs."""
    from slip_vic.experiments.suite import verify_result

    count, wrong = verify_result(folder)
    for line in wrong:
        click.echo(line, err=True)
    click.echo(f"{folder}: {count} worlds ran again, {'they differ' if wrong else 'all are equal'}")
    if wrong:
        raise click.exceptions.Exit(1)


@benchmark.command("tune")
@click.argument("law")
@click.argument("attribute")
@click.argument("values", nargs=-1, required=True, type=float)
@click.option("--worlds", type=click.IntRange(1), default=6, show_default=True, help="how many, none of the suite")
def tune_law(law: str, attribute: str, values: tuple[float, ...], worlds: int) -> None:
    """Try values of an attribute of LAW in worlds that are not in the suite; the same budget for each law."""
    from slip_vic.experiments.suite import tried

    for line in tried(law, attribute, values, worlds):
        click.echo(line)
