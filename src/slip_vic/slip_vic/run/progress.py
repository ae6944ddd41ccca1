"""Progress bars for runs; on a terminal they move, in a file or a pipe they print nothing."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn


class RunProgress:
    """Bars of simulated time, one per run."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress

    def add_run(self, label: str, duration_s: float) -> Callable[[float], None]:
        """Add a bar and return the function that sets its simulated time [s]."""
        task = self._progress.add_task(label, total=duration_s)

        def set_time(sim_time_s: float) -> None:
            self._progress.update(task, completed=sim_time_s)

        return set_time


@contextlib.contextmanager
def run_progress(console: Console) -> Iterator[RunProgress]:
    """Show bars while the block runs."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TextColumn("{task.completed:.1f}/{task.total:.1f} s"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, disable=not console.is_terminal) as progress:
        yield RunProgress(progress)
