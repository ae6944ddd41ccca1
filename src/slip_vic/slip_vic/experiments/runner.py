"""Makes runs on an engine: a worker that dies costs time, a run that kills its workers is a row."""

from __future__ import annotations

import functools
import platform
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from rich.console import Console

from slip_core.errors import SlipVicError
from slip_vic.experiments.engines import Died, Engine, EngineName, open_engine
from slip_vic.experiments.law import find_law
from slip_vic.experiments.rows import Row, RowFile, Task, difference, key_of
from slip_vic.experiments.run import Result, failed, own_law, run
from slip_vic.presets import preset_text
from slip_vic.run.prepare import prepare
from slip_vic.run.progress import progress
from slip_vic.run.versions import digest, versions
from slip_vic.scenarios.scenario import load_scenario


class MixedVersions(SlipVicError):
    """A worker that does not run what the experiment runs."""

    exit_code = 2


class Done(NamedTuple):
    """What came of an experiment. there: how many runs it had before; died: workers, each with its task in a line."""

    rows: list[Row]
    there: int
    died: list[str]


def made_of(tasks: Iterable[Task]) -> dict[str, str]:
    """Return what rows of these runs are made of: versions, and digests of scenarios with their arms, sensors and laws.

    Raises:
        InputError: an unknown name, a file that cannot be read, a bad override of the arm, no such law.
    """
    found = dict(versions())
    for world, law in tasks:
        arm = tuple(one for one in world.settings if "robot_description_file=" in one)
        found[" ".join(("scenario", world.scenario, *arm))] = _scenario(world.scenario, arm)
        if world.sensor:
            found[f"sensor {world.sensor}"] = _sensor(world.sensor)
        if world.track or own_law(law) is None:
            found[f"law {law}"] = find_law(law).source
    return found


@functools.cache
def _scenario(name: str, arm: tuple[str, ...]) -> str:
    loaded = load_scenario(name, assignments=arm)
    return digest(text.encode() for text in (loaded.text, *loaded.urdfs.values()))


@functools.cache
def _sensor(name: str) -> str:
    return digest([preset_text("sensors", name).encode()])


def run_on_worker(wanted: Mapping[str, str], task: Task) -> Result:
    """Make one run in this process.

    Raises:
        MixedVersions: this worker has other versions or files than the process that sent the task.
    """
    check_versions(wanted, made_of([task]))
    prepare()
    return run(task.world, task.law)


def check_versions(wanted: Mapping[str, str], here: Mapping[str, str]) -> None:
    """Compare what runs here with what an experiment runs.

    Raises:
        MixedVersions: names what differs.
    """
    for name in difference(wanted, here):
        raise MixedVersions(
            f"worker on {platform.node()}: got {name} {here[name]}, expected {wanted[name]}, as where the experiment "
            "was started; install the same there"
        )


def results(engine: Engine, wanted: Mapping[str, str], tasks: Sequence[Task]) -> Iterator[Result]:
    """Make runs and yield their results as they come; one that kills its workers is crashed."""
    for task, result in engine.run(run_on_worker, wanted, tasks):
        yield failed(*task, "crashed", result.reason) if isinstance(result, Died) else result


def fill(
    path: Path, name: str, tasks: Sequence[Task], engine: EngineName, jobs: int, more: Mapping[str, str] | None = None
) -> Done:
    """Make the runs that a file of rows does not have yet.

    Args:
        path: of the file.
        name: of what runs, for the progress that is shown.
        tasks: all.
        engine: where, with so many `jobs`.
        more: what rows depend on beside versions and files, by name.

    Raises:
        InputError: see `made_of` and `RowFile`; no cluster.
        MixedVersions: a worker has other versions or files.
    """
    wanted = {**made_of(tasks), **(more or {})}
    with RowFile(path, wanted) as file:
        done = file.done()
        left = [task for task in tasks if task.key not in done]
        there, died = len(tasks) - len(left), []
        with progress(name, len(tasks), there, Console(stderr=True)) as report:
            if left:
                prepare()  # here, before workers that start together all begin to
                with open_engine(engine, jobs) as workers:
                    for now, result in enumerate(results(workers, wanted, left), there + 1):
                        file.append(result)
                        died = [f"a worker died and its run was tried again: {task.name}, {reason}"
                                for task, reason in workers.deaths]  # fmt: skip
                        report(now, f"{len(died)} workers died" if died else "")
    keys = {task.key for task in tasks}
    return Done([row for row in file.rows() if key_of(row) in keys], there, died)
