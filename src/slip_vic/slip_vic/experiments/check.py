"""Whether a scenario holds: gains, and short runs in worlds that differ from the configured one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from rich.table import Table

from slip_vic.experiments.rows import Row, row_of
from slip_vic.experiments.run import Controlled, Result, play
from slip_vic.experiments.world import NO_MISMATCH, World, mismatch_assignments
from slip_vic.options import Choice
from slip_vic.scenarios.scenario import Scenario
from slip_vic_controller.law.bounds import GainReport
from slip_vic_controller.law.gains import gain_report


def gains(scenario: Scenario) -> GainReport:
    """Return the verdict on the gains, without refusing them."""
    return gain_report(next(iter(scenario.controllers.values())), refuse=False)


def run_worlds(choice: Choice, mismatches: Sequence[str], report: Callable[[str], None]) -> Iterator[Row]:
    """Run the configured world, then each mismatch, and yield their rows; `report` gets what runs.

    Where the path is refused already there is nothing more to run.
    """
    known = choice.load()
    for number, name in enumerate(dict.fromkeys((NO_MISMATCH, *mismatches))):
        report(name)
        scenario = choice.load(*mismatch_assignments(name, known))
        world = World(choice.scenario, choice.sensor, choice.seed, number=number, mismatch=name)
        row = row_of(Result(world, choice.law, *play(Controlled(scenario))))
        yield row
        if row["outcome"] == "refused":
            return


def gain_table(scenario: Scenario, report: GainReport, sensor: str) -> Table:
    """Return the conditions on the gains."""
    params = next(iter(scenario.controllers.values()))  # the law is the same in all arms
    title = (
        f"k_s configured {report.asked:g}, used {report.used:.6g} of {report.accepted:.6g} 1/s ({params.slip_estimator}"
    )
    table = Table(title=f"{title}{', ' + sensor if sensor else ''})")
    for name in ("condition", "value", "limit", "margin", "verdict"):
        table.add_column(name, justify="right" if name in ("value", "limit", "margin") else "left")
    for c in report.conditions:
        verdict = "[green]holds[/]" if c.holds else "[red]fails[/]"
        table.add_row(c.name, f"{c.value:.6g}", f"{c.limit:.6g}", f"{c.margin:.3g}", verdict)
    return table
