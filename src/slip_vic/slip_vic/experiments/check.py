"""Whether a scenario holds: gains, and short runs in worlds that differ from the configured one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from slip_vic.experiments.run import Row, play, row_of
from slip_vic.experiments.world import NO_MISMATCH, World, mismatch_assignments
from slip_vic.options import Choice
from slip_vic.scenarios.scenario import load_scenario
from slip_vic_controller.law.bounds import GainReport


def gain_lines(report: GainReport) -> Iterator[str]:
    """Yield a line on k_s and on each condition."""
    yield f"k_s configured {report.asked:g}, used {report.used:.6g} of {report.accepted:.6g} 1/s"
    for one in report.conditions:
        numbers = f"{one.value:.6g}, limit {one.limit:.6g}, margin {one.margin:.3g}"
        yield f"{one.name} {'holds' if one.holds else 'fails'}: {numbers}; {one.reason}"


def run_worlds(choice: Choice, mismatches: Sequence[str], report: Callable[[str], None]) -> Iterator[Row]:
    """Run the configured world, then each mismatch, and yield their rows; `report` gets what runs.

    Where the path is refused already there is nothing more to run.
    """
    known = load_scenario(**choice)
    settings = {name: mismatch_assignments(name, known) for name in (NO_MISMATCH, *mismatches)}
    for number, (name, own) in enumerate(settings.items()):
        report(name)
        world = World(choice["scenario"], choice["sensor"], number=number, mismatch=name, law=choice["law"])
        wrong = load_scenario(**choice | {"assignments": (*choice["assignments"], *own)})
        row = row_of(world, *play(wrong.ticks(), wrong))
        yield row
        if row["outcome"] == "refused":
            return
