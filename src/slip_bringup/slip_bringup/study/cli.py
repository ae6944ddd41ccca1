"""``slip-vic study`` and ``slip-vic check``."""

from __future__ import annotations

import os
from pathlib import Path

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]


@click.command()
@click.option("--scenario", "scenarios", default="paper_planar", show_default=True, help="names, comma separated")
@click.option("--sensors", default="", help="names or .yaml files, comma separated; default all")
@click.option("--estimators", default="classical,measured,observer", show_default=True)
@click.option("--mismatch", "mismatches", default="none", show_default=True, help="names, comma separated, or all")
@click.option("--seeds", type=click.IntRange(1), default=5, show_default=True, help="how many seeds, from 0")
@click.option("--out", type=click.Path(path_type=Path), default=Path("study"), show_default=True, help="folder")
@click.option("--jobs", type=click.IntRange(1), default=None, help="parallel processes; default one per core")
@click.option("--set", "assignments", multiple=True, metavar="KEY=VALUE", help="override a parameter; repeatable")
@click.option(
    "--lottery", "drawn", type=click.IntRange(0), default=0, help="draw so many cases nobody tuned to instead"
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="of the lottery")
def study(
    scenarios: str,
    sensors: str,
    estimators: str,
    mismatches: str,
    seeds: int,
    out: Path,
    jobs: int | None,
    assignments: tuple[str, ...],
    drawn: int,
    seed: int,
) -> None:
    """Run scenario x sensor x estimator x mismatch over seeds: study.csv, study.png; goes on where it stopped."""
    if drawn:
        _lottery(drawn, seed, out, jobs or os.cpu_count() or 1)
        return
    from slip_bringup.study.cases import MISMATCHES, all_cases
    from slip_bringup.study.runner import run_cases
    from slip_bringup.study.summary import summary_table, write_picture
    from slip_bringup.study.table import StudyTable
    from slip_sim_bridge.sensors.presets import load_preset, preset_names

    wanted_sensors = _names(sensors) or preset_names()
    for name in wanted_sensors:
        load_preset(name)
    wrong = list(MISMATCHES) if mismatches == "all" else _names(mismatches)
    cases = all_cases(_names(scenarios), wanted_sensors, _names(estimators), wrong, seeds)
    for scenario in _names(scenarios):
        next(case for case in cases if case.scenario == scenario).load(assignments).check()
    table = StudyTable(out, assignments)
    done = table.done()
    left = [case for case in cases if case.key not in done]
    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn(),
    )  # fmt: skip
    with Progress(*columns, console=console, disable=not console.is_terminal) as progress:
        task = progress.add_task("study", total=len(cases), completed=len(cases) - len(left))
        for result in run_cases(left, assignments, jobs or os.cpu_count() or 1):
            table.append(result)
            progress.advance(task)
    rows = table.rows()
    write_picture(out / "study.png", rows)
    Console().print(summary_table(rows))
    click.echo(f"{len(cases) - len(left)} of {len(cases)} cases were there already; {table.path}, {out / 'study.png'}")


def _lottery(cases: int, seed: int, out: Path, jobs: int) -> None:
    """Draw cases, run each with every law, and say how the laws compare."""
    from slip_bringup.study.lottery import lottery, lottery_table, write_lottery

    out.mkdir(parents=True, exist_ok=True)
    results = []
    console = Console(stderr=True)
    with Progress(console=console, disable=not console.is_terminal) as progress:
        task = progress.add_task("lottery", total=cases)
        for result in lottery(cases, seed, jobs):
            results.append(result)
            progress.update(task, completed=result[0].number + 1)
    write_lottery(out / "lottery.csv", results)
    Console(width=120).print(lottery_table(results))
    click.echo(f"{len(results)} of {cases} drawn cases are feasible; {out / 'lottery.csv'}")


@click.command()
@click.option("--scenario", default="paper_planar", show_default=True, help="name or .yaml file")
@click.option("--params", type=click.Path(path_type=Path), help="ROS or plain parameter file of the controller")
@click.option("--sensor", default="", help="name or .yaml file; default the scenario's own")
@click.option("--estimator", type=click.Choice(["measured", "observer"]), help="default the sensor's")
@click.option("--set", "assignments", multiple=True, metavar="KEY=VALUE", help="override a parameter; repeatable")
def check(scenario: str, params: Path | None, sensor: str, estimator: str | None, assignments: tuple[str, ...]) -> None:
    """Judge the gains with a sensor: bound on k_s, Propositions 1 to 3, margins; exit code 2 where one fails."""
    from slip_bringup.study.check import check_table

    table, good = check_table(scenario, params, sensor, estimator, assignments)  # type: ignore[arg-type]
    Console(width=150).print(table)
    if not good:
        raise click.exceptions.Exit(2)
