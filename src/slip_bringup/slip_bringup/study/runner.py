"""Runs the cases of a study in parallel processes; a worker that dies costs one row, not the study."""

from __future__ import annotations

import concurrent.futures
import math
import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool

from slip_bringup.study.cases import Case
from slip_bringup.study.run_case import METRICS, CaseResult, run_case

# Linear algebra is 6x6 here: threads of their own would only fight the other workers.
_SINGLE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
RunCase = Callable[[Case, Sequence[str]], CaseResult]


def run_cases(
    cases: Sequence[Case], assignments: Sequence[str], jobs: int, run: RunCase = run_case
) -> Iterator[CaseResult]:
    """Run cases in up to `jobs` processes and yield results as they come.

    Where a worker dies, the cases under way run again one by one, each in a process of its own: only the one that kills
    its worker is lost.
    """
    os.environ.update(_SINGLE_THREAD)
    waiting = list(reversed(cases))
    while waiting:
        under_way: dict[concurrent.futures.Future[CaseResult], Case] = {}
        try:
            with _pool(jobs) as pool:
                try:
                    while waiting or under_way:
                        while waiting and len(under_way) < 2 * jobs:
                            case = waiting.pop()
                            under_way[pool.submit(run, case, assignments)] = case
                        done, _ = concurrent.futures.wait(under_way, return_when=concurrent.futures.FIRST_COMPLETED)
                        for future in done:
                            result = future.result()
                            del under_way[future]
                            yield result
                except BaseException:
                    pool.shutdown(wait=False, cancel_futures=True)
                    raise
        except BrokenProcessPool:
            for case in under_way.values():
                yield _alone(case, assignments, run)


def _alone(case: Case, assignments: Sequence[str], run: RunCase) -> CaseResult:
    try:
        with _pool(1) as pool:
            return pool.submit(run, case, assignments).result()
    except BrokenProcessPool:
        return CaseResult(case, "crashed", "its process died", dict.fromkeys(METRICS, math.nan))


def _pool(jobs: int) -> concurrent.futures.ProcessPoolExecutor:
    return concurrent.futures.ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn"))
