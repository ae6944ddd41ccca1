"""``slip-vic study``, ``slip-vic merge``, ``slip-vic check`` and ``slip-vic tune``."""

from __future__ import annotations

import os
import re
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

from slip_core.errors import require_extra
from slip_vic.options import (
    ALLOW_FAULT,
    ASSIGNMENTS,
    DRIVE,
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
    from slip_vic.scenarios.scenario import Estimator, Law
    from slip_vic.study.engines import EngineName


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
@click.option("--seeds", type=click.IntRange(1), default=5, show_default=True, help="how many seeds, from 0")
@out_option("study", "folder")
@workers
@click.option("--shard", default="1/1", callback=shard, metavar="I/N", help="every N-th case from the I-th on")
@click.option("--resume", "go_on", is_flag=True, help="continue the study in --out")
@DRIVE
@ASSIGNMENTS
@URDF
@click.option(
    "--lottery",
    "drawn",
    type=click.IntRange(0),
    default=0,
    help="draw so many random cases instead, without --drive with drives, joints and all troubles at once",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="of the lottery")
@ALLOW_FAULT
def study(
    *,
    scenarios: tuple[str, ...],
    sensors: tuple[str, ...],
    laws: tuple[Law, ...],
    estimators: str,
    mismatches: str,
    seeds: int,
    out: Path,
    jobs: int,
    engine: EngineName,
    shard: tuple[int, int],
    go_on: bool,
    drive: str,
    assignments: tuple[str, ...],
    urdf: Path | None,
    drawn: int,
    seed: int,
    allow_fault: bool,
) -> None:
    """Run scenario x law x sensor x mismatch over seeds: study.csv, study.png; continues where it stopped.

    Names every case that did not end well in a line, and ends with exit code 1 where there is one.
    """
    if drawn:
        of_command_line = _given({"drawn", "seed", "scenarios", "laws", "assignments", "out", "jobs", "drive"})
        _lottery(drawn, seed, scenarios, laws, assignments, out, jobs, drive if "drive" in of_command_line else None)
        return
    from slip_vic.presets import preset_names
    from slip_vic.scenarios import scenario_names
    from slip_vic.scenarios.scenario import drive_assignments, urdf_assignment
    from slip_vic.study.cases import MISMATCHES, Asked
    from slip_vic.study.command import resume, run_study

    if go_on:
        done = resume(out, engine, jobs)
        click.echo(done.line)
        end_with(done.bad, allow_fault)
        return
    wrong = MISMATCHES if mismatches == "all" else names(mismatches)
    wanted = sensors or tuple(preset_names("sensors"))
    asked = Asked(scenarios or tuple(scenario_names(1)), laws, wanted, names(estimators), wrong, seeds, shard)
    given = (*urdf_assignment(urdf), *assignments)
    given = (*drive_assignments(drive, asked.scenarios[0], given), *given)
    done = run_study([asked], given, out, engine, jobs)
    click.echo(done.line)
    end_with(done.bad, allow_fault)


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
    from slip_vic.study.command import merge_studies

    click.echo(merge_studies(folders, out))


def _lottery(
    cases: int, seed: int, scenarios: tuple[str, ...], laws: tuple[Law, ...], assignments: tuple[str, ...], out: Path,
    jobs: int, drive: str | None,
) -> None:  # fmt: skip
    """Draw cases, with drives unless one is given, run each with every law, and say how the laws compare."""
    from rich.console import Console

    from slip_vic.run.progress import progress
    from slip_vic.scenarios import scenario_names
    from slip_vic.scenarios.scenario import drive_assignments
    from slip_vic.study.lottery import lottery, lottery_file, lottery_table

    if drive is not None:
        assignments = (*drive_assignments(drive, (*scenarios, *scenario_names(1))[0], assignments), *assignments)
    out.mkdir(parents=True, exist_ok=True)
    results = []
    with (
        lottery_file(out / "lottery.csv") as write,
        progress("lottery", cases, 0, Console(stderr=True)) as report,
    ):
        for ticket, by_law in lottery(cases, seed, jobs, scenarios, laws, assignments, drives=drive is None):
            write(ticket, by_law)
            results.append((ticket, by_law))
            report(ticket.number + 1, "")
    Console().print(lottery_table(results))
    click.echo(f"{len(results)} of {cases} drawn cases are feasible; {out / 'lottery.csv'}")


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

    from slip_vic.study.cases import MISMATCHES, check_names
    from slip_vic.study.check import corner_table, gain_table, gains, path_lines, path_load, refusal, run_corners

    wanted = MISMATCHES if mismatches == "all" else names(mismatches)
    check_names("mismatch", wanted, MISMATCHES)
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
    from slip_vic.study.cases import MISMATCHES
    from slip_vic.study.tune.command import Wanted, run_tune
    from slip_vic.study.tune.space import Bounds

    wrong = MISMATCHES if mismatches == "all" else names(mismatches)
    bounds = Bounds(effort_rate, later)
    wanted = Wanted(scenario, law, sensor, estimator, wrong, seeds, unseen, bounds, trials, batch, seed, assignments)
    click.echo(run_tune(wanted, out, engine, jobs, shlex.join(["slip-vic", *sys.argv[1:]])))
