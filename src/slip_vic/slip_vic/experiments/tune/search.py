"""The search: Optuna proposes, an engine runs, and everything that is known stands in a folder.

The runs of every set of parameters are rows of one file, ``trials.csv``; the journal holds what was proposed and what
it cost. A proposal depends on the seed, its number and the sets before its batch alone: neither workers nor
interruptions change the result.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import optuna

from slip_core.errors import InputError
from slip_vic.experiments.contents import Contents
from slip_vic.experiments.engines import Engine
from slip_vic.experiments.rows import Row, RowFile, Task, key_of
from slip_vic.experiments.runner import results
from slip_vic.experiments.tune.space import Bounds, Range, Score, assignments, cost, score
from slip_vic.experiments.world import World

STARTUP = 10
"""Sets that are drawn at random before the model of what is good counts."""

ReportDone = Callable[[int], None]
"""Called with the number of finished runs of those under way."""


@dataclass(frozen=True, slots=True)
class Search:
    """What is searched.

    worlds, law: of every set; space: parameters; batch: sets that are proposed before the next result counts.
    """

    worlds: tuple[World, ...]
    law: str
    space: tuple[Range, ...]
    bounds: Bounds
    seed: int
    batch: int


@dataclass(frozen=True, slots=True)
class Trial:
    """One set of parameters and what it gave. number: 0 is the default."""

    number: int
    values: Mapping[str, float]
    score: Score
    cost: float


def run_sets(
    file: RowFile,
    sets: Mapping[str, Mapping[str, float]],
    worlds: Sequence[World],
    law: str,
    contents: Contents,
    engine: Engine,
    report_done: ReportDone,
) -> dict[str, list[Row]]:
    """Run worlds with several sets of parameters, all at once; return the rows of each set, in the order of the worlds.

    Args:
        file: gets the rows; what it has already is not run again.
        sets: parameters by the name of their set.
        worlds: of each set.
        law: under which they run.
        contents: what all share.
        engine: where to.
        report_done: called as runs end.
    """
    tasks = {
        name: [
            Task(replace(world, set=name, settings=(*world.settings, *assignments(values))), law) for world in worlds
        ]
        for name, values in sets.items()
    }
    done = file.done()
    left = [task for own in tasks.values() for task in own if task.key not in done]
    there = len(tasks) * len(worlds) - len(left)
    for number, result in enumerate(results(engine, contents, left), there + 1):
        file.append(result)
        report_done(number)
    by_key = {key_of(row): row for row in file.rows()}
    return {name: [by_key[task.key] for task in own] for name, own in tasks.items()}


def run_search(
    search: Search, trials: int, contents: Contents, file: RowFile, engine: Engine, report_done: ReportDone
) -> Iterator[Trial]:
    """Yield every trial of a search in its order, the default first; continues where the file stopped.

    Batches are run whole, so there may be more than `trials`.

    Raises:
        InputError: the folder of the file holds another search.
    """
    study = _study(file.path.parent / "journal.log", search)
    default: tuple[list[Row], Score] | None = None
    waiting = optuna.trial.TrialState.WAITING  # for its parameters
    for numbers in _batches(trials, search.batch):
        while (number := sum(trial.state != waiting for trial in study.trials)) < numbers.stop:
            _propose(study, search, number)
        batch = study.trials[numbers.start : numbers.stop]
        sets = {f"trial {trial.number}": trial.params for trial in batch}
        rows = run_sets(file, sets, search.worlds, search.law, contents, engine, report_done)
        for trial, found in zip(batch, rows.values(), strict=True):
            default = default or (found, score(found, found, search.bounds))
            scored = score(found, default[0], search.bounds)
            value = cost(scored, default[1])
            if not trial.state.is_finished():
                study.tell(trial.number, value)
            yield Trial(trial.number, trial.params, scored, value)


def _batches(trials: int, size: int) -> Iterator[range]:
    """Yield the numbers of the trials that are proposed together; the default is alone, others are compared with it."""
    yield range(1)
    for start in range(1, trials, size):
        yield range(start, start + size)  # whole ones, so that a search that continues proposes what a longer one does


def _study(journal: Path, search: Search) -> optuna.Study:
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    storage = optuna.storages.JournalStorage(optuna.storages.journal.JournalFileBackend(str(journal)))
    study = optuna.create_study(study_name="tune", storage=storage, load_if_exists=True)
    wanted = json.loads(json.dumps(asdict(search)))
    there = study.user_attrs.get("search", wanted)
    other = [name for name in wanted if there.get(name) != wanted[name]]
    if other:
        raise InputError(
            f"--out {journal.parent}", got=f"a search with {other[0]} {there.get(other[0])}",
            expected=f"{wanted[other[0]]}", fix="give another folder",
        )  # fmt: skip
    if "search" not in study.user_attrs:
        study.set_user_attr("search", wanted)
    return study


def _propose(study: optuna.Study, search: Search, number: int) -> None:
    """Add a trial; the sampler is made again for each, so that a resumed search proposes the same."""
    if number == 0 and not study.trials:
        study.enqueue_trial({one.name: one.default for one in search.space})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        study.sampler = optuna.samplers.TPESampler(
            seed=1_000_003 * search.seed + number, n_startup_trials=STARTUP, multivariate=True, constant_liar=True
        )
    ranges = {one.name: optuna.distributions.FloatDistribution(one.low, one.high, log=one.log) for one in search.space}
    study.ask(ranges)


def best_of(trials: Sequence[Trial]) -> Trial:
    """Return the cheapest trial within the bounds; the default is one."""
    return min((trial for trial in trials if trial.score.excess == 0.0 or trial.number == 0), key=lambda t: t.cost)
