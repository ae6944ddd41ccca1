"""Makes the runs of a file on an engine; a worker that dies costs time, a run that kills its worker is a row."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rich.console import Console

from slip_vic.experiments.contents import Contents, check_versions
from slip_vic.experiments.engines import Died, Engine, EngineName, open_engine
from slip_vic.experiments.rows import RowFile, Task
from slip_vic.experiments.run import Result, failed, run
from slip_vic.run.prepare import prepare
from slip_vic.run.progress import progress


def run_on_worker(contents: Contents, task: Task) -> Result:
    """Make one run in this process, from the texts that it was sent.

    Raises:
        MixedVersions: this worker has other versions than the process that sent the task.
    """
    check_versions(contents.versions)
    prepare()
    return run(task.world, task.law, contents.texts)


def results(engine: Engine, contents: Contents, tasks: Sequence[Task]) -> Iterator[Result]:
    """Make runs and yield their results as they come; one that kills its workers is crashed."""
    for task, result in engine.run(run_on_worker, contents, tasks):
        yield failed(*task, "crashed", result.reason) if isinstance(result, Died) else result


def fill(
    file: RowFile, name: str, tasks: Sequence[Task], contents: Contents, engine: EngineName, jobs: int
) -> tuple[int, int]:
    """Make the runs that a file does not have yet; return how many it had, and how many workers died.

    Args:
        file: gets a row of each.
        name: of what runs, for the progress that is shown.
        tasks: all.
        contents: what all runs share.
        engine: where, with so many `jobs`.
    """
    done = file.done()
    left = [task for task in tasks if task.key not in done]
    there, deaths = len(tasks) - len(left), 0
    with progress(name, len(tasks), there, Console(stderr=True)) as report:
        if left:
            prepare()  # here, before workers that start together all begin to
            with open_engine(engine, jobs) as workers:
                for now, result in enumerate(results(workers, contents, left), there + 1):
                    file.append(result)
                    deaths = workers.deaths
                    report(now, f"{deaths} workers died" if deaths else "")
    file.sort()
    return there, deaths
