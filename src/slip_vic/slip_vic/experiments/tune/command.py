"""What ``slip-vic tune`` does: search, try on unseen seeds, write parameter file and page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from slip_core.errors import InputError, SlipVicError
from slip_vic.experiments.check import gain_table, gains
from slip_vic.experiments.contents import gather
from slip_vic.experiments.engines import EngineName, open_engine
from slip_vic.experiments.rows import Plan, RowFile
from slip_vic.experiments.tune.page import Found, page, worst_mm
from slip_vic.experiments.tune.search import ReportDone, Search, Trial, best_of, run_search, run_sets
from slip_vic.experiments.tune.space import Bounds, assignments, search_space
from slip_vic.experiments.world import World, combined
from slip_vic.options import Choice
from slip_vic.run.prepare import prepare
from slip_vic.run.progress import Report, progress
from slip_vic.scenarios.scenario import NODES, Estimator, Law, Scenario, ros_parameter_file


@dataclass(frozen=True, slots=True)
class Wanted:
    """What a search is asked for.

    seeds: of the search, from 0; unseen: so many after them, on which the result is tried.
    """

    scenario: str
    law: Law
    sensor: str
    estimator: Estimator
    mismatches: tuple[str, ...]
    seeds: int
    unseen: int
    bounds: Bounds
    trials: int
    batch: int
    seed: int
    overrides: tuple[str, ...]


def run_tune(wanted: Wanted, out: Path, engine: EngineName, jobs: int, command: str) -> str:
    """Search, and write ``controller.yaml`` and ``tune.html``; return one line on what was found.

    Raises:
        InputError: an unknown name, a bad override, a folder that holds another search; runs that are too short.
        SlipVicError: the parameters that were found are refused by `check`.
    """
    law = wanted.law if wanted.estimator == "observer" else f"{wanted.law}?slip_estimator={wanted.estimator}"
    contents = gather([wanted.scenario], [wanted.sensor], wanted.overrides)

    def worlds(seeds: range) -> tuple[World, ...]:
        names = (wanted.scenario,), (wanted.sensor,), wanted.mismatches
        return tuple(combined(*names, seeds, {"": ()}, wanted.overrides, contents.texts))

    seen, unseen = worlds(range(wanted.seeds)), worlds(range(wanted.seeds, wanted.seeds + wanted.unseen))
    prepare()
    plain = World(wanted.scenario, wanted.sensor, settings=wanted.overrides)
    loaded = plain.load(wanted.law, wanted.estimator, (), contents.texts)
    loaded.check()
    space = tuple(search_space(loaded, wanted.law, wanted.estimator))
    search = Search(seen, law, space, wanted.bounds, wanted.seed, wanted.batch)
    total = len(seen) * wanted.trials + 2 * len(unseen)
    with (
        RowFile(out / "trials.csv", Plan(contents.made_of, ())) as file,
        progress("tune", total, 0, Console(stderr=True)) as report,
        open_engine(engine, jobs) as workers,
    ):
        trials: list[Trial] = []
        done = _report_done(report, trials, len(seen))
        for trial in run_search(search, wanted.trials, contents, file, workers, done):
            trials.append(trial)
            if trial.number == 0:
                check_time(trial.score.arrival, wanted.bounds.later_s, loaded.bridge.duration_s)
        best = best_of(trials)
        tried = {"unseen default": {}, "unseen tuned": best.values}
        rows = run_sets(file, tried, unseen, law, contents, workers, done)
        file.sort()
    found = Found(trials, best, *rows.values())
    tuned = plain.load(wanted.law, wanted.estimator, assignments(best.values), contents.texts)
    (out / "controller.yaml").write_text(_parameter_file(tuned), encoding="utf-8")
    title = f"{wanted.scenario}, {wanted.law}, {wanted.sensor}, {wanted.estimator}: gains"
    (out / "tune.html").write_text(page(search, found, title, command), encoding="utf-8")
    found_again = Choice(
        wanted.scenario, wanted.law, sensor=wanted.sensor, estimator=wanted.estimator, params=out / "controller.yaml"
    ).load()
    verdict = gains(found_again)
    found_again.check_arm()
    if not verdict.hold:
        Console().print(gain_table(found_again, verdict, wanted.sensor))
        raise SlipVicError(f"{out / 'controller.yaml'}: check refuses what was found")
    return (
        f"trial {best.number} of {len(trials)}: worst slip {trials[0].cost:.3g} -> {best.cost:.3g} mm, on unseen seeds "
        f"{worst_mm(found.unseen_default):.3g} -> {worst_mm(found.unseen_best):.3g} mm; "
        f"{out / 'controller.yaml'}, {out / 'tune.html'}"
    )


def check_time(arrival: float, later: float, duration: float) -> None:
    """Look whether runs last as long as the bound on arrival allows; arrival [s]: the default's latest.

    Raises:
        InputError: they do not, so what is allowed to come later would count as what never arrives.
    """
    if arrival + later > duration:
        raise InputError(
            "parameter bridge.duration_s", got=f"{duration:g} s, and the default arrives after {arrival:.2f} s",
            expected=f"at least {arrival + later:.2f} s: --later {later:g} allows it",
        )  # fmt: skip


def _report_done(report: Report, trials: Sequence[Trial], runs: int) -> ReportDone:
    def report_done(done: int) -> None:
        best = f"best {best_of(trials).cost:.3g} mm" if trials else ""
        report(runs * len(trials) + done, best)

    return report_done


def _parameter_file(scenario: Scenario) -> str:
    """Return the parameter file of the controller, with what differs from the defaults."""
    return ros_parameter_file(scenario.controller, NODES["controller"][0], complete=False)
