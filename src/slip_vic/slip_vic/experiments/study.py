"""What the commands of experiments do with a folder: make its rows, and show them as a table and a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from rich.console import Console

from slip_vic.experiments.engines import EngineName
from slip_vic.experiments.rows import FILE, Row, RowFile, Task, joined
from slip_vic.experiments.runner import Done, fill
from slip_vic.experiments.tables import tables_of, write_picture
from slip_vic.experiments.world import World


def tasks_of(worlds: Sequence[World], laws: Sequence[str]) -> list[Task]:
    """Return the runs, each once; all laws of a world one after the other."""
    return list(dict.fromkeys(Task(world, law) for world in worlds for law in laws))


def run_study(
    tasks: Sequence[Task], out: Path, engine: EngineName, jobs: int, more: Mapping[str, str] | None = None
) -> Done:
    """Make the runs that a folder does not have yet, and show all that were asked for; see `runner.fill`."""
    done = fill(out / FILE, out.name, tasks, engine, jobs, more)
    show(done.rows, out)
    return done


def merge(folders: Sequence[Path], out: Path) -> int:
    """Put the rows of several folders into one, and show them; return how many there are.

    Raises:
        InputError: they do not fit together, see `joined`.
    """
    rows, made_of = joined([*folders, *([out] if (out / FILE).exists() else [])])
    with RowFile(out / FILE, made_of) as file:
        file.put(rows)
    show(rows, out)
    return len(rows)


def show(rows: Sequence[Row], out: Path) -> None:
    """Print the tables of some rows, and write their picture, ``rows.png``."""
    if not rows:
        return
    write_picture((out / FILE).with_suffix(".png"), rows)
    Console().print(*tables_of(rows), sep="\n")


def bad_ones(rows: Sequence[Row]) -> list[str]:
    """Return a line on every run that did not end well."""
    names = ("set", "world", "law", "scenario", "sensor", "drive", "motion", "mismatch")
    return [
        f"{' '.join(row[name] for name in names if row[name])}: {row['outcome']}, {row['reason']}"
        for row in rows
        if row["outcome"] != "ok"
    ]
