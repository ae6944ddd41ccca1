"""What ``slip-vic tune`` does: Optuna proposes gains, an engine runs them, the best are tried on unseen seeds.

The runs of every set of parameters are rows of one file. A proposal depends on the seed and the sets before its batch
alone: a search that was stopped anywhere proposes the same again, and finds its runs in the file.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import optuna

from slip_core.errors import SlipVicError
from slip_core.params import flatten
from slip_vic.experiments.check import gains
from slip_vic.experiments.engines import EngineName
from slip_vic.experiments.rows import FILE, Row, Task
from slip_vic.experiments.runner import fill
from slip_vic.experiments.world import World, combined
from slip_vic.scenarios.scenario import NODES, Law, Scenario, ros_parameter_file
from slip_vic_controller.law.gains import gain_report

BATCH: Final = 4
"""Sets that are proposed before the next result counts."""
STARTUP: Final = 10
"""Sets that are drawn at random before the model of what is good counts."""
DECADE: Final = 10.0
"""Gammas are searched from their default over this to their default times this."""
K_S_RANGE: Final = 20.0
"""k_s is searched from what the sensor's delay allows over this up to what it allows."""
MARGIN: Final = (0.7, 1.0)
LEVER_M: Final = 0.03
"""Length that makes turning in the grasp comparable with sliding, as gains.characteristic_length."""
SEARCHED: Final = ("gains.gamma",)


class Range(NamedTuple):
    """Where a parameter of the controller is searched; log: evenly in its logarithm."""

    name: str
    low: float
    high: float
    log: bool
    default: float


@dataclass(frozen=True, slots=True)
class Search:
    """What is searched.

    worlds, law: of every set; space: parameters; effort_rate, later_s: what less slip may cost against the default, a
    factor on the largest effort rate, and how much later [s] the latest arrival.
    """

    worlds: tuple[World, ...]
    law: Law
    space: tuple[Range, ...]
    effort_rate: float = 1.2
    later_s: float = 0.3
    seed: int = 0


class Trial(NamedTuple):
    """One set of parameters and what it costs [mm]; number 0 is the default."""

    number: int
    values: Mapping[str, float]
    cost: float


RunTasks = Callable[[Sequence[Task]], Sequence[Row]]
"""Returns a row of each of some runs, in any order."""


def search_space(scenario: Scenario) -> list[Range]:
    """Return what is searched around the parameters of a scenario."""
    params = next(iter(scenario.controllers.values()))  # what is searched is the same for all arms
    values = flatten(params)
    allowed = gain_report(params, refuse=False).used
    space = [Range("gains.k_s", allowed / K_S_RANGE, allowed, True, min(values["gains.k_s"], allowed))]
    around = [name for name in SEARCHED if values[name] > 0.0]
    space += [Range(name, values[name] / DECADE, values[name] * DECADE, True, values[name]) for name in around]
    if params.governor.mode != "off":
        space.append(Range("governor.margin", *MARGIN, False, values["governor.margin"]))
    return space


def assignments(values: Mapping[str, float]) -> tuple[str, ...]:
    """Return the overrides that set these parameters of the controller."""
    return tuple(f"controller.{name}={value!r}" for name, value in values.items())


def worst_mm(rows: Sequence[Row]) -> float:
    """Return the worst slip of some runs at their end [mm], turning by `LEVER_M`; infinite where one is not ok."""
    slips = [math.hypot(float(row["slip_linear_m"]), LEVER_M * float(row["slip_angular_rad"])) for row in rows]
    return max(1e3 * slip if row["outcome"] == "ok" else math.inf for row, slip in zip(rows, slips, strict=True))


def cost(search: Search, rows: Sequence[Row], defaults: Sequence[Row]) -> float:
    """Return what the search makes small [mm]: the worst slip; beyond the bounds never less than the default's.

    defaults: the rows of the same worlds with the default parameters.
    """
    good, known = ([row for row in some if row["outcome"] == "ok"] for some in (rows, defaults))
    excess = float(len(rows) - len(good))
    if good and known:
        excess += max(0.0, _most(good, "effort_rate_rms_n_m_s") / _most(known, "effort_rate_rms_n_m_s")
                      / search.effort_rate - 1.0)  # fmt: skip
        latest = _most(known, "arrival_s") + search.later_s
        excess += max(0.0, min(_most(good, "arrival_s") / latest, 2.0) - 1.0) if math.isfinite(latest) else 0.0
    if excess == 0.0:
        return worst_mm(rows)
    worst = max([worst_mm([row]) for row in (*good, *known)], default=1.0)
    return worst * (1.0 + excess)


def _most(rows: Sequence[Row], metric: str) -> float:
    """Return the largest number of some rows; infinite where one has none, as where it does not arrive."""
    return max(math.inf if math.isnan(value := float(row[metric])) else value for row in rows)


def run_search(search: Search, trials: int, run_tasks: RunTasks) -> Iterator[Trial]:
    """Yield every trial of a search in its order, the default first; whole batches, so there may be more."""
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        sampler = optuna.samplers.TPESampler(
            seed=search.seed, n_startup_trials=STARTUP, multivariate=True, constant_liar=True
        )
    study = optuna.create_study(sampler=sampler)
    study.enqueue_trial({one.name: one.default for one in search.space})
    ranges = {one.name: optuna.distributions.FloatDistribution(one.low, one.high, log=one.log) for one in search.space}
    defaults: list[Row] = []
    while len(study.trials) < trials:
        batch = [study.ask(ranges) for _ in range(BATCH if defaults else 1)]  # others are compared with the default
        tasks = {trial.number: _tasks(search, trial) for trial in batch}
        found = {
            (row["set"], row["digest"]): row for row in run_tasks([task for own in tasks.values() for task in own])
        }
        for trial in batch:
            rows = [found[task.world.set, task.world.digest] for task in tasks[trial.number]]
            defaults = defaults or rows
            value = cost(search, rows, defaults)
            study.tell(trial, value)
            yield Trial(trial.number, trial.params, value)


def _tasks(search: Search, trial: Any) -> list[Task]:
    return tried(search.worlds, search.law, f"trial {trial.number}", trial.params)


def tried(worlds: Sequence[World], law: Law, name: str, values: Mapping[str, float]) -> list[Task]:
    """Return the runs of worlds with parameters of the controller, as a set of this name."""
    more = assignments(values)
    return [Task(replace(world, set=name, settings=(*world.settings, *more)), law) for world in worlds]


def run_tune(
    base: World, law: Law, mismatches: Sequence[str], seeds: int, unseen: int, bounds: tuple[float, float],
    trials: int, seed: int, out: Path, engine: EngineName, jobs: int,
) -> str:  # fmt: skip
    """Search, and write ``controller.yaml``; return one line on what was found.

    Args:
        base: scenario, sensor and assignments.
        law: vic or governed.
        mismatches, seeds: of the worlds of the search; unseen: so many more seeds, on which the result is tried.
        bounds: see `Search`.
        trials, seed: of the search.
        out: folder that gets rows and parameter file.
        engine: where, with so many `jobs`.

    Raises:
        InputError: an unknown name, a bad override.
        SlipVicError: the parameters that were found are refused by `check`.
    """

    def worlds(of: range) -> tuple[World, ...]:
        return tuple(combined((base.scenario,), (base.sensor,), mismatches, of, {"": ()}, base.settings))

    def run_tasks(tasks: Sequence[Task]) -> Sequence[Row]:
        return fill(out / FILE, tasks[-1].world.set, tasks, engine, jobs).rows

    loaded = base.load(law, "observer")
    loaded.check()
    search = Search(worlds(range(seeds)), law, tuple(search_space(loaded)), *bounds, seed)
    found = list(run_search(search, trials, run_tasks))
    best = min(found, key=lambda trial: trial.cost)
    values, others = {"unseen default": {}, "unseen tuned": best.values}, worlds(range(seeds, seeds + unseen))
    before, after = (worst_mm(run_tasks(tried(others, law, *one))) for one in values.items())
    tuned, file = base.load(law, "observer", assignments(best.values)), out / "controller.yaml"
    file.write_text(ros_parameter_file(tuned.controller, NODES["controller"][0], complete=False), encoding="utf-8")
    tuned.check_arm()
    if not gains(tuned).hold:
        raise SlipVicError(f"{file}: check refuses what was found")
    return (
        f"trial {best.number} of {len(found)}: worst slip {found[0].cost:.3g} -> {best.cost:.3g} mm, on unseen seeds "
        f"{before:.3g} -> {after:.3g} mm; {file}"
    )
