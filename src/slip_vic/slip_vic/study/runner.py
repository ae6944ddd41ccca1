"""Runs the cases of a table on an engine; a worker that dies costs time, a case that kills its worker is a row."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from rich.console import Console

from slip_vic.run.prepare import prepare
from slip_vic.run.progress import progress
from slip_vic.study.cases import Case
from slip_vic.study.contents import Contents, check_versions
from slip_vic.study.engines import Died, Engine, EngineName, Shared, open_engine
from slip_vic.study.run_case import run_case
from slip_vic.study.table import STUDY, CaseResult, Layout, Named, StudyTable


def run_on_worker(contents: Contents, case: Case) -> CaseResult[Case]:
    """Run one case in this process, from the texts it was sent.

    Raises:
        MixedVersions: this worker runs something else than where the study was started.
    """
    check_versions(contents.versions)
    prepare()
    return run_case(case, contents.assignments, contents.texts)


def run_cases(
    cases: Sequence[Named],
    shared: Shared,
    engine: Engine,
    run: Callable[[Shared, Named], CaseResult[Named]],
    layout: Layout = STUDY,
) -> Iterator[CaseResult[Named]]:
    """Run cases and yield results as they come."""
    for case, result in engine.run(run, shared, cases):
        yield layout.failed(case, "crashed", result.reason) if isinstance(result, Died) else result


def fill(
    table: StudyTable,
    name: str,
    cases: Sequence[Named],
    run: Callable[[Any, Named], CaseResult[Named]],
    shared: object,
    engine: EngineName,
    jobs: int,
) -> tuple[int, int]:
    """Run the cases that a table does not have yet; return how many were there, and how many workers died.

    Args:
        table: gets a row of each.
        name: of what runs, for the progress that is shown.
        cases: all.
        run: runs one of them on a worker, with what all share.
        shared: see `run`.
        engine: where, with so many `jobs`.
    """
    done = table.done()
    left = [case for case in cases if case.key not in done]
    there, deaths = len(cases) - len(left), 0
    with progress(name, len(cases), there, Console(stderr=True)) as report:
        if left:
            with open_engine(engine, jobs) as workers:
                for now, result in enumerate(run_cases(left, shared, workers, run, table.layout), there + 1):
                    table.append(result)
                    deaths = workers.deaths
                    report(now, f"{deaths} workers died" if deaths else "")
    table.sort()
    return there, deaths
