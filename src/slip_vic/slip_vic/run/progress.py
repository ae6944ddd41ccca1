"""How far something is: bars on a terminal; elsewhere nothing of single runs, and a line now and then of many."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

EVERY_S = 10.0
"""Time between two lines where there is no terminal [s]."""

Report = Callable[[int, str], None]


@contextlib.contextmanager
def progress(name: str, total: int, done: int, console: Console) -> Iterator[Report]:
    """Show progress while the block runs; it is given a function that takes the number done and a remark.

    Args:
        name: of what runs.
        total: number of cases.
        done: how many were done before.
        console: where to; a line now and then, and one at the end, instead of a bar where it is no terminal.
    """
    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn(),
        TextColumn("{task.fields[remark]}"),
    )  # fmt: skip
    with Progress(*columns, console=console, disable=not console.is_terminal) as bar:
        task, said_s = bar.add_task(name, total=total, completed=done, remark=""), bar.get_time()

        def report(now: int, remark: str) -> None:
            nonlocal said_s
            bar.update(task, completed=now, remark=remark)
            if not console.is_terminal and (now == total or bar.get_time() >= said_s + EVERY_S):
                said_s = bar.get_time()
                console.print(", ".join(filter(None, (f"{name}: {now} of {total} done", remark))), highlight=False)

        yield report


AddBar = Callable[[str, float], Callable[[float], None]]
"""Adds a bar of this name and simulated time [s]; returns the function that sets how far it is [s]."""


@contextlib.contextmanager
def run_progress(console: Console) -> Iterator[AddBar]:
    """Show bars of simulated time, one per run, while the block runs."""
    columns = (
        TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(),
        TextColumn("{task.completed:.1f}/{task.total:.1f} s"), TimeElapsedColumn(), TimeRemainingColumn(),
    )  # fmt: skip
    with Progress(*columns, console=console, disable=not console.is_terminal) as bars:

        def add(name: str, duration_s: float) -> Callable[[float], None]:
            task = bars.add_task(name, total=duration_s)
            return lambda time_s: bars.update(task, completed=time_s)

        yield add
