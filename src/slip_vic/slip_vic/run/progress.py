"""How far something is: bars on a terminal; elsewhere nothing of single runs, and a line now and then of many."""

from __future__ import annotations

import contextlib
import time
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
        console: where to; lines in the place of a bar where it is no terminal.
    """
    if not console.is_terminal:
        lines = _Lines(name, total, done, console)
        yield lines.report
        lines.end()
        return
    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn(),
        TextColumn("{task.fields[remark]}"),
    )  # fmt: skip
    with Progress(*columns, console=console) as bar:
        task = bar.add_task(name, total=total, completed=done, remark="")
        yield lambda now, remark: bar.update(task, completed=now, remark=remark)


class _Lines:
    """One line after every EVERY_S, and one at the end."""

    def __init__(self, name: str, total: int, done: int, console: Console) -> None:
        self._name, self._total, self._console = name, total, console
        self._before, self._start = done, time.monotonic()
        self._said_at = self._start
        self._now, self._said, self._remark = done, -1, ""

    def report(self, now: int, remark: str) -> None:
        """Take how many are done, and a remark."""
        self._now, self._remark = now, remark
        if time.monotonic() >= self._said_at + EVERY_S:
            self.say()

    def end(self) -> None:
        """Print the last line, where that has not been done."""
        if self._now != self._said:
            self.say()

    def say(self) -> None:
        """Print the line."""
        self._said_at, self._said = time.monotonic(), self._now
        passed, made = self._said_at - self._start, self._now - self._before
        parts = [f"{self._name}: {self._now} of {self._total} done"]
        if made:
            parts.append(f"{made / passed:.3g} per second")
        if made and self._now < self._total:
            parts.append(f"about {(self._total - self._now) * passed / made:.0f} s left")
        if self._remark:
            parts.append(self._remark)
        self._console.print(", ".join(parts), highlight=False, soft_wrap=True)


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
