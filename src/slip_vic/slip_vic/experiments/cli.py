"""``slip-vic study``, ``check``, ``tune`` and ``benchmark``."""

from __future__ import annotations

import os
from pathlib import Path

import click
from click.core import ParameterSource

from slip_bags.cli import echo
from slip_core.errors import UnknownName, require_extra
from slip_vic.options import (
    ASSIGNMENTS,
    PACKAGE,
    SCENARIO,
    SCENARIOS,
    SENSOR,
    Choice,
    Decorator,
    choosing,
    end_with,
    listed,
    names,
    out_option,
)

JOBS = click.option(
    "--jobs", type=click.IntRange(1), default=os.cpu_count() or 1, help="parallel processes; default one per core"
)
ENGINE = click.option(
    "--engine", type=click.Choice(["pool", "ray"]), default="pool", show_default=True,
    help="pool: processes of this machine; ray: the cluster at RAY_ADDRESS, else one on this machine",
)  # fmt: skip


def _mismatches(context: click.Context, parameter: click.Parameter, text: str) -> tuple[str, ...]:
    from slip_vic.experiments.world import MISMATCHES

    chosen = MISMATCHES if text == "all" else names(text)
    for name in set(chosen) - set(MISMATCHES):
        raise UnknownName("mismatch", name, MISMATCHES)
    return chosen


def mismatches_option(default: str) -> Decorator:
    """Return the option ``--mismatch``."""
    return click.option(
        "--mismatch", "mismatches", default=default, show_default=True, callback=_mismatches,
        help="configuration errors to simulate: names, comma separated, or all",
    )  # fmt: skip


@click.command()
@SCENARIOS
@listed("--sensor", "", "names or .yaml files, comma separated; default all")
@listed("--law", "classical,vic,governed", "comma separated")
@mismatches_option("none")
@click.option("--seeds", type=click.IntRange(1), default=5, show_default=True, help="number of seeds, from 0")
@out_option("study", "folder; an existing one is continued")
@JOBS
@ENGINE
@listed("--drive", "", "names or .yaml files, comma separated")
@ASSIGNMENTS
@PACKAGE
@click.option(
    "--lottery", "drawn", type=click.IntRange(0), default=0,
    help="draw this many random worlds instead, each with errors in drives, joints and sensors",
)  # fmt: skip
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="seed of the lottery")
def study(
    *, scenarios: tuple[str, ...], sensors: tuple[str, ...], laws: tuple[str, ...], mismatches: tuple[str, ...],
    seeds: int, out: Path, jobs: int, engine: str,
    drives: tuple[str, ...], set: tuple[str, ...], drawn: int, seed: int,
) -> None:  # fmt: skip
    """Run scenario x drive x sensor x mismatch under laws over seeds: table, rows.csv, rows.png.

    A law is one of the controller, or yours: module:Class or file.py:Class; `vic?slip_estimator=measured` changes a
    parameter of the controller. Lists every failed run in a line, and ends with exit code 1 if there is one.
    """
    from slip_vic.experiments.world import combined
    from slip_vic.presets import preset_names
    from slip_vic.scenarios import scenario_names

    if drawn:
        from slip_vic.experiments.draw import drawn_worlds

        given = click.get_current_context().get_parameter_source
        fixed = {"sensors": "--sensor", "mismatches": "--mismatch", "seeds": "--seeds"}
        if wrong := [option for name, option in fixed.items() if given(name) is ParameterSource.COMMANDLINE]:
            raise click.UsageError(f"--lottery draws its worlds itself and takes no {', '.join(wrong)}")
        worlds = list(drawn_worlds(drawn, seed, scenarios, "".join(drives[:1]), set))
    else:
        chosen = scenarios or tuple(scenario_names(1))
        sensors = sensors or tuple(preset_names("sensors"))
        worlds = combined(chosen, sensors, mismatches, range(seeds), drives or ("",), set)
    from slip_vic.experiments.runner import made_of, run_study, sentences, under_laws

    runs = under_laws(worlds, laws)
    if not drawn:
        made_of(runs)  # an unknown name ends here, before anything is compiled
        for world in {world.scenario: world for world in worlds}.values():
            world.load("classical").check()
    rows = run_study(runs, out, engine, jobs)
    end_with(sentences(row for row in rows if row["outcome"] != "ok"))


@click.command()
@choosing("scenario", "parameters", "sensor", "drive", "gripper", "law", "set")
@mismatches_option("all")
def check(*, choice: Choice, mismatches: tuple[str, ...]) -> None:
    """Check gains, arm and path before anything moves, and simulate the path with configuration errors.

    Bound on k_s, Propositions 1 to 3, M_D over the inertia of the wrist; whether the arm can follow the path from the
    scenario's start; then simulations in this process. Exit code 2 if gains or path are refused, 1 if the object does
    not arrive in a simulated world.
    """
    from slip_vic.scenarios.scenario import load

    loaded = load(**choice)  # a typo ends here
    from rich.console import Console

    from slip_vic.experiments.check import hindered, judged, run_worlds
    from slip_vic.experiments.tables import tables_of
    from slip_vic.run.prepare import prepare

    prepare()
    report = judged(loaded)
    echo(f"k_s configured {report.asked:g}, used {report.used:.6g} of {report.accepted:.6g} 1/s")
    for one in report.conditions:
        echo(one.line)
    if not report.hold:
        raise click.exceptions.Exit(2)
    loaded.check()
    with Console(stderr=True).status("simulates the configured world and its mismatches"):
        rows = list(run_worlds(choice, mismatches))
    if rows[0]["outcome"] == "refused":
        echo(f"refused: {rows[0]['reason']}", err=True)
        raise click.exceptions.Exit(2)
    echo("\n\n".join(tables_of(rows)))
    failed = {row["mismatch"]: why for row in rows if (why := hindered(row))}
    echo(f"holds in {len(rows) - len(failed)} of {len(rows)} simulated worlds")
    end_with(f"{mismatch}: {why}" for mismatch, why in failed.items())


@click.command()
@SCENARIO
@SENSOR
@click.option("--law", type=click.Choice(["vic", "governed"]), default="vic", show_default=True, help="control law")
@mismatches_option("none,mass+,mass-,friction+,friction-")
@click.option(
    "--seeds", type=click.IntRange(1), default=2, show_default=True, help="seeds of the search; as many validate it"
)
@click.option("--trials", type=click.IntRange(2), default=40, show_default=True, help="number of trials")
@out_option("tune", "folder; an existing one is continued")
@JOBS
@ENGINE
@ASSIGNMENTS
def tune(
    *, scenario: str, sensor: str, law: str, mismatches: tuple[str, ...], seeds: int, trials: int, out: Path, jobs: int,
    engine: str, set: tuple[str, ...],
) -> None:  # fmt: skip
    """Search gains for less slip with a sensor: rows.csv, controller.yaml."""
    require_extra("optuna", "slip-vic tune", "tune")
    from slip_vic.experiments.tune import run_tune
    from slip_vic.experiments.world import World

    base = World(scenario, sensor, settings=set)
    echo(run_tune(base, law, mismatches, seeds, trials, out, engine, jobs))


@click.group()
def benchmark() -> None:
    """Compare control laws, including yours, in the worlds of the suite carry-2026.2."""


@benchmark.command()
@click.argument("law")
@click.option("--worlds", type=click.IntRange(1), default=300, show_default="all", help="run the first N of each track")
@click.option("--arms", type=click.Choice(["1", "2"]), help="only worlds with this many arms; default: both")
@out_option(None, "folder of this law; default out/benchmark/LAW")
@JOBS
@ENGINE
def run(*, law: str, worlds: int, arms: str | None, out: Path | None, jobs: int, engine: str) -> None:
    """Run LAW (a name, module:Class or file.py:Class); an existing folder is continued.

    Exit code 1 if the law itself fails in a world, with a line for each.
    """
    from slip_vic.experiments import suite
    from slip_vic.experiments.law import find_law
    from slip_vic.experiments.runner import run_study, sentences, under_laws

    folder = out or Path("out") / "benchmark" / law.rpartition(":")[2]
    chosen = suite.suite(find_law(law), worlds, (int(arms),) if arms else (1, 2))
    rows = run_study(under_laws(chosen, (law,)), folder, engine, jobs)
    end_with(sentences(row for row in rows if row["outcome"] in ("failed", "crashed")))


@benchmark.command()
@click.argument("folders", nargs=-1, required=True, type=click.Path(path_type=Path))
@out_option("out/benchmark", "folder of the picture")
def compare(folders: tuple[Path, ...], out: Path) -> None:
    """Compare results in their common worlds: table, rows.png."""
    from slip_vic.experiments.runner import show
    from slip_vic.experiments.suite import compared
    from slip_vic.run.lock import own_folder

    rows = compared(folders)
    with own_folder(out):
        show(rows, out)


@benchmark.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--law", default="", help="law of the result, if it is your own; its code is run")
def verify(folder: Path, law: str) -> None:
    """Rerun ten worlds of a result, selected by its digest; exit code 1 if one differs."""
    from slip_vic.experiments.suite import verify_result

    count, wrong = verify_result(folder, law)
    echo(f"{folder}: {count} worlds ran again, {'they differ' if wrong else 'all are equal'}")
    end_with(wrong)
