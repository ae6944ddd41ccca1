"""Runs the cases of a study on an engine; a worker that dies costs time, a case that kills its worker is a row."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from slip_vic.run.prepare import prepare
from slip_vic.study.cases import Case
from slip_vic.study.contents import Contents, check_versions
from slip_vic.study.engines import Died, Engine
from slip_vic.study.run_case import CaseResult, failed, run_case

RunCase = Callable[[Contents, Case], CaseResult]


def run_on_worker(contents: Contents, case: Case) -> CaseResult:
    """Run one case in this process, from the texts it was sent.

    Raises:
        MixedVersions: this worker runs something else than where the study was started.
    """
    check_versions(contents.versions)
    prepare()
    return run_case(case, contents.assignments, contents.texts)


def run_cases(
    cases: Sequence[Case], contents: Contents, engine: Engine, run: RunCase = run_on_worker
) -> Iterator[CaseResult]:
    """Run cases and yield results as they come."""
    for case, result in engine.run(run, contents, cases):
        yield failed(case, "crashed", result.reason) if isinstance(result, Died) else result
