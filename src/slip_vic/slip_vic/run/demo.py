"""The demo: one scenario under four laws: table, summary, page."""

from __future__ import annotations

import json
import shlex
import shutil
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Column, Table

from slip_vic.options import Choice
from slip_vic.page.page import write_page
from slip_vic.run.data import RunData
from slip_vic.run.judge import judge_bag
from slip_vic.run.launcher import Launcher
from slip_vic.run.lock import own_folder
from slip_vic.run.metrics import summary_table
from slip_vic.run.progress import progress
from slip_vic.run.run import Run
from slip_vic.run.versions import versions
from slip_vic.scenarios.scenario import GOVERNED, Law, Scenario, load, read_parameters

Numbers = dict[str, Any]
ORDER: tuple[Law, ...] = ("classical", "vic", "governed", "governed_follow")


def run_demo(choice: Choice, out: Path, console: Console, domain: int | None = None) -> dict[str, Any]:
    """Run all controllers over DDS, write page, ``summary.json`` and bags into `out`, return the summary.

    Nothing is written into `out` before all runs are complete: bags are recorded beside it and moved in.

    Args:
        choice: the scenario; its law does not count.
        out: folder.
        console: shows what runs.
        domain: ROS domain id; None: a free one.

    Raises:
        InputError: bad scenario or parameter, or an output folder that cannot be written.
    """
    loaded = all_laws(choice)
    for scenario in loaded.values():
        scenario.check()
    shown = loaded["vic"]
    with own_folder(out), tempfile.TemporaryDirectory(prefix=".run.", dir=out) as folder:
        staging, runs, numbers = Path(folder), dict[str, RunData](), dict[str, Numbers]()
        with progress(console, unit=" s") as add_bar:
            bars = {law: add_bar(f"{shown.name} {law}", shown.duration_s) for law in loaded}
            for law, scenario in loaded.items():
                result = Launcher(scenario, bag=staging / law, wanted_domain=domain).run(bars[law])
                run = judge_bag(staging / law, scenario, result.incidents)
                runs[law] = run.data
                numbers[law] = numbers_of(run) | {
                    "ticks": result.ticks,
                    "real_time_factor": result.real_time_factor,
                    "messages": result.messages,
                    "messages_lost": result.lost,
                    "incidents": [str(incident) for incident in result.incidents],
                    "bag": str(out / law),
                }
        ends = {law: str(own["reason"]) for law, own in numbers.items() if own["reason"]}
        command = shlex.join(["slip-vic", *sys.argv[1:]])
        write_page(staging / "report.html", runs, command=command, description=shown.description, ends=ends)
        summary = {"scenario": shown.name, "seed": shown.seed, "versions": dict(versions()), "runs": numbers}
        (staging / "summary.json").write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
        for item in staging.iterdir():
            target = out / item.name
            if target.is_dir():
                shutil.rmtree(target)
            item.replace(target)
    console_out = Console()
    console_out.print(comparison_table(shown.name, numbers))
    console_out.print(f"page: {out / 'report.html'}\nsummary: {out / 'summary.json'}", soft_wrap=True)
    return summary


def numbers_of(run: Run) -> Numbers:
    """Return the numbers of a run for a table and for summary.json: of several arms those of the worst, and of each."""
    arms = list(run.summary.values())
    numbers: Numbers = {"outcome": run.outcome, "reason": run.reason}
    numbers |= {name: run.worst(name) for name in (arms[0] if arms else ())}
    if len(arms) > 1:
        numbers |= {"internal_peak_n": run.internal_force_n, "arms": run.summary}
    return numbers


def all_laws(choice: Choice) -> dict[Law, Scenario]:
    """Return the scenario with each law; all get the parameters of the file, without those in which they differ."""
    file = choice["parameters"]
    given = {} if file is None else read_parameters(file)
    common = {name: value for name, value in given.items() if name not in ("controller", "grip.control", *GOVERNED)}
    return {law: load(**choice | {"law": law, "parameters": common}) for law in ORDER}


def comparison_table(scenario: str, runs: Mapping[str, Mapping[str, Any]]) -> Table:
    """Return the table the demo prints: one row per number, one column per controller."""
    table = Table("", *(Column(name, justify="right") for name in runs), title=f"{scenario}: what each law does")
    for label, texts in summary_table(runs).iterrows():
        table.add_row(escape(str(label)), *texts)
    table.add_row("simulated / wall time", *(f"{run['real_time_factor']:.2f}" for run in runs.values()))
    if any(run["outcome"] != "ok" for run in runs.values()):
        table.add_row("outcome", *(str(run["outcome"]) for run in runs.values()))
    return table
