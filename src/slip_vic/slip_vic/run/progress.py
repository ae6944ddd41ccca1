"""Progress bars for runs; on a terminal they move, in a file or a pipe they print nothing."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

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
