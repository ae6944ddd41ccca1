"""How far something is: bars on a terminal; elsewhere a line now and then."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

EVERY_S = 10.0
"""Time between two lines where there is no terminal [s]."""

Report = Callable[..., None]
"""Takes how much is done, and a remark."""


AddBar = Callable[..., Report]
"""Adds a bar of a name and total, of which some is done; returns the function that sets how far it is."""


@contextlib.contextmanager
def progress(console: Console, *, unit: str = "") -> Iterator[AddBar]:
    """Show bars while the block runs, which is given the function that adds one.

    Where the console is no terminal, it prints a line now and then, and one at the end.

    Args:
        console: where to.
        unit: behind the numbers.
    """
    columns = (
        TextColumn("{task.description}"), BarColumn(), TextColumn(f"{{task.completed:g}}/{{task.total:g}}{unit}"),
        TimeElapsedColumn(), TimeRemainingColumn(), TextColumn("{task.fields[remark]}"),
    )  # fmt: skip
    with Progress(*columns, console=console, disable=not console.is_terminal) as bars:

        def add(name: str, total: float, done: int = 0) -> Report:
            task = bars.add_task(name, total=total, completed=done, remark="")
            said_s, ended = bars.get_time(), False

            def report(now: float, remark: str = "") -> None:
                nonlocal said_s, ended
                bars.update(task, completed=round(now, 1), remark=remark)
                ends = now == total and not ended
                if not console.is_terminal and (ends or bars.get_time() >= said_s + EVERY_S):
                    said_s, ended = bars.get_time(), now == total
                    left_s = bars.tasks[task].time_remaining
                    parts = [f"{name}: {round(now, 1):g} of {total:g}{unit} done"]
                    parts += [f"{left_s:.0f} s left"] if left_s else []
                    console.print(", ".join(filter(None, (*parts, remark))), highlight=False)

            return report

        yield add
