"""The demo: one scenario under classical, variable and governed impedance, over DDS: table, summary, page, picture."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import sys
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from types import MappingProxyType
from typing import Any, get_args

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from slip_core.errors import InputError
from slip_vic.page.page import write_page
from slip_vic.pair.any_scenario import load_any
from slip_vic.pair.measures import Judged, verdicts
from slip_vic.pair.picture import write_picture
from slip_vic.pair.recorded import judge_bag
from slip_vic.pair.scenario import PairScenario, is_pair
from slip_vic.run.launcher import Launcher, RunResult
from slip_vic.run.metrics import summarise, summary_rows
from slip_vic.run.picture import write_report
from slip_vic.run.progress import run_progress
from slip_vic.run.recording import versions
from slip_vic.run.series import RunSeries, read_series
from slip_vic.scenarios.scenario import GOVERNED, Law, Scenario

ORDER: tuple[Law, ...] = ("classical", "vic", "governed")


def run_demo(
    scenario: str,
    out: Path,
    seed: int,
    assignments: tuple[str, ...],
    domain: int | None,
    console: Console,
    parameters: Mapping[str, Any] = MappingProxyType({}),
    drive: str = "",
) -> dict[str, Any]:
    """Run all controllers, write page, ``summary.json``, ``report.png`` and the bags into `out`, return the summary.

    Nothing is written into `out` before all runs are complete: bags are recorded beside it and moved in.

    Raises:
        InputError: bad scenario or parameter, or an output folder that cannot be written.
    """
    assert set(ORDER) == set(get_args(Law))
    loaded = all_kinds(scenario, seed, assignments, parameters, drive)
    for made in loaded.values():
        made.check()
    staging = _staging_folder(out)
    runs: dict[str, dict[str, Any]] = {}
    results: dict[Law, RunResult] = {}
    try:
        with run_progress(console) as progress:
            bars = {kind: progress.add_run(f"{scenario} {kind}", loaded[kind].duration_s) for kind in ORDER}
            for kind in ORDER:
                bag = staging / kind
                result = Launcher(loaded[kind], bag=bag, wanted_domain=domain).run(bars[kind])
                results[kind] = result
                runs[kind] = {
                    "ticks": result.ticks,
                    "real_time_factor": result.real_time_factor,
                    "messages": result.messages,
                    "messages_lost": result.lost,
                    "incidents": [str(incident) for incident in result.incidents],
                    "bag": str(out / kind),
                }
        bags: dict[str, Path] = {kind: staging / kind for kind in ORDER}
        title = f"{loaded['vic'].name}: {loaded['vic'].description}"
        if is_pair(scenario):
            table = _sum_up_pair(staging, loaded, results, runs)
        else:
            series: dict[str, RunSeries] = {kind: read_series(bag) for kind, bag in bags.items()}
            runs = {kind: {**summarise(series[kind]), **runs[kind]} for kind in ORDER}
            write_report(staging / "report.png", title, series)
            table = comparison_table(loaded["vic"].name, runs)
        summary = {"scenario": loaded["vic"].name, "seed": seed, "versions": versions(), "runs": runs}
        write_page(
            staging / "report.html",
            bags,
            command=shlex.join(["slip-vic", *sys.argv[1:]]),
            title=loaded["vic"].name,
            description=loaded["vic"].description,
        )
        (staging / "summary.json").write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
        _move_in(staging, out)
    finally:
        shutil.rmtree(staging, ignore_errors=True)
    console_out = Console(width=150) if is_pair(scenario) else Console()
    console_out.print(table)
    files = {"page": "report.html", "summary": "summary.json", "picture": "report.png"}
    console_out.print("\n".join(f"{what}: {out / name}" for what, name in files.items()), soft_wrap=True)
    return summary


def all_kinds(
    scenario: str, seed: int, assignments: tuple[str, ...], parameters: Mapping[str, Any], drive: str = ""
) -> dict[Law, Scenario | PairScenario]:
    """Return the scenario with each controller; all get the same `parameters`, without those in which they differ."""
    common = {name: value for name, value in parameters.items() if name not in ("controller", *GOVERNED)}
    return {
        kind: load_any(scenario, law=kind, seed=seed, drive=drive, assignments=assignments, parameters=common)
        for kind in ORDER
    }


def _sum_up_pair(
    folder: Path,
    loaded: Mapping[Law, Any],
    results: Mapping[Law, RunResult],
    runs: dict[str, Any],
) -> Table:
    """Write the picture of runs with two arms and put their numbers into `runs`; return the table."""
    judged: dict[str, Judged] = {}
    rows: dict[str, list[tuple[float, ...]]] = {}
    for kind, result in results.items():
        judged[kind], rows[kind] = judge_bag(folder / kind, loaded[kind], result.incidents)
        runs[kind] |= asdict(judged[kind])
    write_picture(folder / "report.png", loaded["vic"].name, rows)
    return verdicts(loaded["vic"].name, judged)


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
    table.add_row("simulated / wall time", *(f"{run['real_time_factor']:.2f}" for run in runs.values()), "")
    return table
