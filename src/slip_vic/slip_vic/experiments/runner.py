"""Makes the runs of a file on an engine; a worker that dies costs time, a run that kills its worker is a row."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rich.console import Console

from slip_vic.experiments.rows import RowFile, Task
from slip_vic.experiments.run import Result, failed, run
from slip_vic.run.prepare import prepare
from slip_vic.run.progress import progress
from slip_vic.study.contents import check_versions
from slip_vic.study.engines import Died, EngineName, open_engine


def run_on_worker(versions: Mapping[str, str], task: Task) -> Result:
    """Make one run in this process.

    Raises:
        MixedVersions: this worker has other versions than the process that sent the task.
    """
    check_versions(versions)
    prepare()
    return run(task.world, task.law)


def fill(
    file: RowFile, name: str, tasks: Sequence[Task], versions: Mapping[str, str], engine: EngineName, jobs: int
) -> tuple[int, int]:
    """Make the runs that a file does not have yet; return how many it had, and how many workers died.

    Args:
        file: gets a row of each.
        name: of what runs, for the progress that is shown.
        tasks: all.
        versions: of the code, that every worker must have.
        engine: where, with so many `jobs`.
    """
    done = file.done()
    left = [task for task in tasks if task.key not in done]
    there, deaths = len(tasks) - len(left), 0
    with progress(name, len(tasks), there, Console(stderr=True)) as report:
        if left:
            prepare()  # here, before workers that start together all begin to
            with open_engine(engine, jobs) as workers:
                for now, (task, result) in enumerate(workers.run(run_on_worker, versions, left), there + 1):
                    file.append(failed(*task, "crashed", result.reason) if isinstance(result, Died) else result)
                    deaths = workers.deaths
                    report(now, f"{deaths} workers died" if deaths else "")
    file.sort()
    return there, deaths
