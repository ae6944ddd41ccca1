"""Tasks for the engines of experiments, in a module that worker processes can import."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from slip_vic.experiments.run import Row
    from slip_vic.experiments.world import World


def note_and_square(folder: str, number: int) -> int:
    """Leave a file with this process's id, then square."""
    (Path(folder) / f"{number}.{os.getpid()}").touch()
    return number * number


def slow_square(folder: str, number: int) -> int:
    """As `note_and_square`, after a time in which a test may kill this process."""
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


def deadly_run(wanted: object, world: World) -> Row:
    """Kill the worker with seed 1, else give numbers that come from the world alone."""
    from slip_vic.experiments.run import METRICS, row_of  # the other tasks need nothing, and start sooner

    if world.seed == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return row_of(world, "ok", "", dict.fromkeys(METRICS, world.seed / 3.0))
