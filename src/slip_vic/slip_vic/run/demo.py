"""The demo: one scenario under classical, variable and governed impedance, over DDS: table, summary, page, picture."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import sys
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from slip_core.errors import InputError
from slip_vic.page.page import write_page
from slip_vic.run.judge import Verdict, judge_incidents, measured
from slip_vic.run.launcher import Launcher
from slip_vic.run.metrics import summary_rows
from slip_vic.run.picture import write_report
from slip_vic.run.progress import run_progress
from slip_vic.run.recording import versions
from slip_vic.run.series import RunSeries, read_series
from slip_vic.scenarios.scenario import GOVERNED, Law, Scenario, load_scenario

if TYPE_CHECKING:
    from slip_vic.run.run import Run

ORDER: tuple[Law, ...] = ("classical", "vic", "governed")


def run_demo(
    scenario: str,
    out: Path,
    seed: int,
    assignments: tuple[str, ...],
    domain: int | None,
    console: Console,
    parameters: Mapping[str, Any] = MappingProxyType({}),
    sensor: str = "",
    drive: str = "",
) -> dict[str, Any]:
    """Run all controllers, write page, ``summary.json``, ``report.png`` and the bags into `out`, return the summary.

    Nothing is written into `out` before all runs are complete: bags are recorded beside it and moved in.

    Raises:
        InputError: bad scenario or parameter, or an output folder that cannot be written.
    """
    loaded = all_laws(scenario, seed, assignments, parameters, sensor, drive)
    for made in loaded.values():
        made.check()
    staging = _staging_folder(out)
    runs: dict[str, dict[str, Any]] = {}
    series: dict[str, RunSeries] = {}
    try:
        with run_progress(console) as progress:
            bars = {law: progress.add_run(f"{scenario} {law}", loaded[law].duration_s) for law in ORDER}
            for law in ORDER:
                bag = staging / law
                result = Launcher(loaded[law], bag=bag, wanted_domain=domain).run(bars[law])
                read = [read_series(bag, arm) for arm in loaded[law].controllers]
                series |= {f"{law} {one.arm}".strip(): one for one in read}
                runs[law] = {
                    **numbers_of(measured(loaded[law], read, *judge_incidents(result.incidents))),
                    "ticks": result.ticks,
                    "real_time_factor": result.real_time_factor,
                    "messages": result.messages,
                    "messages_lost": result.lost,
                    "incidents": [str(incident) for incident in result.incidents],
                    "bag": str(out / law),
                }
        name, description = loaded["vic"].name, loaded["vic"].description
        write_report(staging / "report.png", f"{name}: {description}", series)
        table = comparison_table(name, runs)
        summary = {"scenario": name, "seed": seed, "versions": versions(), "runs": runs}
        write_page(
            staging / "report.html",
            {law: staging / law for law in ORDER},
            command=shlex.join(["slip-vic", *sys.argv[1:]]),
            title=name,
            description=description,
            ends={law: one["reason"] for law, one in runs.items() if one["outcome"] != "ok"},
        )
        (staging / "summary.json").write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
        _move_in(staging, out)
    finally:
        shutil.rmtree(staging, ignore_errors=True)
    console_out = Console()
    console_out.print(table)
    files = {"page": "report.html", "summary": "summary.json", "picture": "report.png"}
    console_out.print("\n".join(f"{what}: {out / name}" for what, name in files.items()), soft_wrap=True)
    return summary


def run_demo_in_process(
    scenario: str,
    out: Path,
    seed: int,
    assignments: tuple[str, ...],
    console: Console,
    parameters: Mapping[str, Any] = MappingProxyType({}),
    sensor: str = "",
    drive: str = "",
) -> dict[str, Any]:
    """Do what `run_demo` does in this process, without DDS and bags: seconds instead of a minute.

    Raises:
        InputError: bad scenario or parameter, or an output folder that cannot be written.
    """
    from slip_vic.page.page import write_runs

    loaded = all_laws(scenario, seed, assignments, parameters, sensor, drive)
    for made in loaded.values():
        made.check()
    staging = _staging_folder(out)
    try:
        done: dict[str, Run] = {}
        for law in ORDER:
            with console.status(f"{scenario} {law}"):
                done[law] = loaded[law].run()
        runs: dict[str, dict[str, Any]] = {law: numbers_of(run.verdict) | _ticks(run) for law, run in done.items()}
        name, description = loaded["vic"].name, loaded["vic"].description
        pictured = {f"{law} {s.arm}".strip(): s for law, run in done.items() for s in run.track.series()}
        write_report(staging / "report.png", f"{name}: {description}", pictured)
        summary = {"scenario": name, "seed": seed, "versions": versions(), "runs": runs}
        command = shlex.join(["slip-vic", *sys.argv[1:]])
        write_runs(staging / "report.html", done, command=command, title=name, description=description)
        (staging / "summary.json").write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
        _move_in(staging, out)
    finally:
        shutil.rmtree(staging, ignore_errors=True)
    console_out = Console()
    console_out.print(comparison_table(name, runs))
    files = {"page": "report.html", "summary": "summary.json", "picture": "report.png"}
    console_out.print("\n".join(f"{what}: {out / name}" for what, name in files.items()), soft_wrap=True)
    return summary


def _ticks(run: Run) -> dict[str, Any]:
    incidents = [run.reason] if run.outcome != "ok" else []
    return {"ticks": run.track.ticks, "incidents": incidents}


def numbers_of(verdict: Verdict) -> dict[str, Any]:
    """Return the numbers of a run for a table and for summary.json: of several arms those of the worst, and of each."""
    arms = list(verdict.arms.values())
    numbers: dict[str, Any] = {"outcome": verdict.outcome, "reason": verdict.reason, **verdict.together}
    for name in arms[0] if arms else ():
        values = [arm[name] for arm in arms]
        numbers[name] = max(values, key=lambda value: float(np.linalg.norm(value)))
    if len(arms) > 1:
        numbers["arms"] = {name: dict(own) for name, own in verdict.arms.items()}
    return numbers


def all_laws(
    scenario: str,
    seed: int,
    assignments: tuple[str, ...],
    parameters: Mapping[str, Any],
    sensor: str = "",
    drive: str = "",
) -> dict[Law, Scenario]:
    """Return the scenario with each law; all get the same `parameters`, without those in which they differ."""
    common = {name: value for name, value in parameters.items() if name not in ("controller", *GOVERNED)}
    return {
        law: load_scenario(
            scenario, law=law, seed=seed, sensor=sensor, drive=drive, assignments=assignments, parameters=common
        )
        for law in ORDER
    }


def _staging_folder(out: Path) -> Path:
    staging = out / f".run.{os.getpid()}"
    try:
        staging.mkdir(parents=True)
    except OSError as error:
        raise InputError(
            f"output folder {out}", got=error.strerror or str(error), expected="a folder that can be written"
        ) from None
    return staging


def _move_in(staging: Path, out: Path) -> None:
    for item in staging.iterdir():
        target = out / item.name
        if target.is_dir():
            shutil.rmtree(target)
        item.replace(target)


def comparison_table(scenario: str, runs: Mapping[str, Mapping[str, Any]]) -> Table:
    """Return the table the demo prints: one row per number, one column per controller, and classical over vic."""
    table = Table(title=f"{scenario}: how much the object slips")
    table.add_column("")
    for name in runs:
        table.add_column(name, justify="right")
    table.add_column("classical / vic", justify="right")

    for row in summary_rows(list(runs.values())):
        first, second = row.values[:2]
        ratio = f"{first / second:.1f}" if row.key.startswith("slip_") and second > 0.0 else ""
        table.add_row(escape(row.label), *row.texts, ratio)
    table.add_row("ticks", *(f"{run['ticks']:d}" for run in runs.values()), "")
    if all("real_time_factor" in run for run in runs.values()):
        table.add_row("simulated / wall time", *(f"{run['real_time_factor']:.2f}" for run in runs.values()), "")
    if any(run["outcome"] != "ok" for run in runs.values()):
        table.add_row("outcome", *(str(run["outcome"]) for run in runs.values()), "")
    return table
