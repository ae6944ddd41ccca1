"""What ``slip-vic tune`` does: search, try on unseen seeds, write parameter file and page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from rich.console import Console

from slip_core.errors import InputError, SlipVicError
from slip_vic.options import Choice
from slip_vic.run.prepare import prepare
from slip_vic.run.progress import Report, progress
from slip_vic.scenarios.scenario import NODES, Estimator, Law, Scenario, ros_parameter_file
from slip_vic.study.cases import Asked
from slip_vic.study.check import gain_table, gains
from slip_vic.study.contents import gather
from slip_vic.study.engines import EngineName, open_engine
from slip_vic.study.tune.page import Found, page, worst_mm
from slip_vic.study.tune.search import ReportDone, Search, Trial, best_of, run_search, run_sets
from slip_vic.study.tune.space import Bounds, assignments, search_space


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
    names = (wanted.scenario,), (wanted.law,), (wanted.sensor,), (wanted.estimator,)
    asked = Asked(*names, wanted.mismatches, wanted.seeds)
    unseen = replace(asked, first_seed=wanted.seeds, seeds=wanted.unseen)
    contents = gather([wanted.scenario], [wanted.sensor], wanted.overrides)
    case = asked.cases()[0]
    prepare()
    loaded = case.load(contents.assignments, contents.texts)
    loaded.check()
    search = Search(
        asked, tuple(search_space(loaded, wanted.law, wanted.estimator)), wanted.bounds, wanted.seed, wanted.batch
    )
    runs = len(asked.cases())
    total = runs * wanted.trials + 2 * len(unseen.cases())
    with progress("tune", total, 0, Console(stderr=True)) as report, open_engine(engine, jobs) as workers:
        trials: list[Trial] = []
        for trial in run_search(search, wanted.trials, contents, out, workers, _report_done(report, trials, runs)):
            trials.append(trial)
            if trial.number == 0:
                check_time(trial.score.arrival, wanted.bounds.later_s, loaded.bridge.duration_s)
        best = best_of(trials)
        tried = {out / "unseen_default": {}, out / "unseen_tuned": best.values}
        rows = run_sets(tried, unseen, contents, workers, _report_done(report, trials, runs))
    found = Found(trials, best, *rows.values())
    tuned = case.load((*contents.assignments, *assignments(best.values)), contents.texts)
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
