"""Tasks for the engines of studies, in a module that worker processes can import."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from slip_vic.study.cases import Case
    from slip_vic.study.contents import Contents
    from slip_vic.study.table import CaseResult


def note_and_square(folder: str, number: int) -> int:
    """Leave a file with this process's id, then square."""
    (Path(folder) / f"{number}.{os.getpid()}").touch()
    return number * number


def slow_square(folder: str, number: int) -> int:
    """As `note_and_square`, after a time in which somebody may kill this process."""
    note_and_square(folder, number)
    time.sleep(0.2)
    return number * number


def deadly(folder: str, number: int) -> int:
    """Task 3 kills its worker, always; task 5 the first time."""
    first = not list(Path(folder).glob(f"{number}.*"))
    result = note_and_square(folder, number)
    if number == 3 or (number == 5 and first):
        os.kill(os.getpid(), signal.SIGKILL)
    return result


def wrong(folder: str, number: int) -> int:
    """Raise."""
    raise ValueError(f"task {number} of {folder}")


def deadly_case(contents: Contents, case: Case) -> CaseResult:
    """Kill the worker with seed 1, else give numbers that come from the case alone."""
    from slip_vic.study.table import METRICS, CaseResult  # the other tasks need nothing, and start sooner

    if case.seed == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return CaseResult(case, "ok", "", dict.fromkeys(METRICS, case.seed / 3.0))
