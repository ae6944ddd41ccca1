"""The file of an experiment: one CSV row per run, added as runs end; beside it what the rows are made of, and a lock.

Rows of one file were all made by the same code from the same files: what differs is refused by its name. A file that
was stopped anywhere is continued.
"""

from __future__ import annotations

import contextlib
import csv
import fcntl
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import IO, Final, NamedTuple, Self

from slip_core.errors import InputError
from slip_vic.experiments.run import METRICS, TIMED, Result
from slip_vic.experiments.world import World
from slip_vic.run.versions import digest

KEY: Final = (
    "set", "world", "law", "scenario", "sensor", "drive", "motion", "mismatch", "seed", "arms", "track", "digest",
)  # fmt: skip
"""Columns that name a run; world: the number in its set; digest: of everything that makes the world."""
COLUMNS: Final = (*KEY, "outcome", *METRICS, "reason")
Row = dict[str, str]
Key = tuple[str, ...]


class Task(NamedTuple):
    """A run that is to be made."""

    world: World
    law: str

    @property
    def key(self) -> Key:
        """The leading cells of its row."""
        world, law = self
        labels = (world.scenario, world.sensor, world.drive, world.motion, world.mismatch)
        numbers = (str(world.seed), str(world.arms))
        return (world.set, str(world.number), law, *labels, *numbers, world.track, world.digest)


class Asked(NamedTuple):
    """All worlds under all laws."""

    worlds: tuple[World, ...]
    laws: tuple[str, ...]

    def tasks(self) -> list[Task]:
        """Return the runs; all laws of a world one after the other."""
        return [Task(world, law) for world in self.worlds for law in self.laws]


@dataclass(frozen=True, slots=True)
class Plan:
    """What a file is made of, and what it was asked for, one after the other; the content of the JSON beside it.

    made_of: versions of the code and digests of the files, by their names.
    """

    made_of: Mapping[str, str]
    asked: tuple[Asked, ...]

    @classmethod
    def read(cls, file: Path) -> Self:
        """Read it.

        Raises:
            InputError: there is none, or it is not one of this version.
        """
        try:
            found = json.loads(file.read_text(encoding="utf-8"))
            asked = [Asked(tuple(map(World.read, one["worlds"])), tuple(one["laws"])) for one in found["asked"]]
            return cls(dict(found["made_of"]), tuple(asked))
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InputError(
                f"file {file}", got=f"{type(error).__name__}: {error}",
                expected="what an experiment of this version writes", fix="give another place",
            ) from None  # fmt: skip

    def write(self, file: Path) -> None:
        """Write it."""
        asked = [{"worlds": [asdict(world) for world in one.worlds], "laws": one.laws} for one in self.asked]
        content = {"made_of": dict(self.made_of), "asked": asked}
        with whole(file) as opened:
            opened.write(json.dumps(content, indent=1) + "\n")

    def joined(self, other: Plan, where: str) -> Plan:
        """Return what both are made of together.

        Raises:
            InputError: they do not fit; names what differs.
        """
        for name in difference(self.made_of, other.made_of):
            raise InputError(
                where, got=f"rows made with {name} {self.made_of[name]}", expected=f"{name} {other.made_of[name]}",
                fix="give another place",
            )  # fmt: skip
        asked = tuple(dict.fromkeys((*self.asked, *other.asked)))
        return replace(self, made_of={**self.made_of, **other.made_of}, asked=asked)

    def tasks(self) -> list[Task]:
        """Return all runs that were asked for, each once."""
        return list(dict.fromkeys(task for one in self.asked for task in one.tasks()))


class RowFile:
    """The rows of an experiment; a context manager that holds their lock.

    Args:
        path: of the CSV file; its folder is made where it does not exist.
        plan: what the rows that come are made of.

    Raises:
        InputError: the file cannot be written, is in use, or holds rows that are made of something else.
    """

    def __init__(self, path: Path, plan: Plan) -> None:
        self.path = path
        file = path.with_suffix(".json")
        with contextlib.ExitStack() as undo:
            try:
                undo.enter_context(locked(path))
                if file.exists():
                    plan = Plan.read(file).joined(plan, f"--out {path}")
                plan.write(file)
                self.plan = plan
                write_rows(path, (row for row in self.rows() if row["outcome"] != "crashed"))
                self._file = undo.enter_context(path.open("a", newline="", encoding="utf-8"))
            except (OSError, ValueError) as error:
                raise InputError(f"--out {path}", got=str(error), expected="a place for an experiment") from None
            self._close = undo.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._close.close()

    def rows(self) -> list[Row]:
        """Return all complete rows."""
        return read_rows(self.path)

    def done(self) -> set[Key]:
        """Return the keys of the runs that need not be made again; those that crashed do."""
        return {key_of(row) for row in self.rows() if row["outcome"] != "crashed"}

    def append(self, result: Result) -> None:
        """Add a row; it is on the disk when this returns."""
        csv.writer(self._file).writerow(row_of(result).values())
        _to_disk(self._file)

    def sort(self) -> None:
        """Put the rows in the order of their runs: the same file, whichever was first."""
        self.write(self.rows())

    def write(self, rows: Iterable[Row]) -> None:
        """Put these rows in the place of those that are there, in the order of their runs."""
        write_rows(self.path, sorted(rows, key=lambda row: (row["set"], int(row["world"]), key_of(row))))
        self._file.close()
        self._file = self.path.open("a", newline="", encoding="utf-8")
        self._close.callback(self._file.close)


def row_of(result: Result) -> Row:
    """Return a result as the cells of its row."""
    numbers = [repr(float(result.metrics[name])) for name in METRICS]
    cells = (*Task(result.world, result.law).key, result.outcome, *numbers, " ".join(result.reason.split()))
    return dict(zip(COLUMNS, cells, strict=True))


def key_of(row: Row) -> Key:
    """Return what names the run of a row."""
    return tuple(row[name] for name in KEY)


def timeless(row: Row) -> list[str]:
    """Return the cells of a row that are the same in each run."""
    return [cell for name, cell in row.items() if name not in TIMED]


def digest_of(rows: Iterable[Row]) -> str:
    """Return the digest of rows, without what differs from run to run."""
    return digest(json.dumps(timeless(row)).encode() for row in rows)


def read_rows(path: Path) -> list[Row]:
    """Return the complete rows of a file, of each run the last; none where there is no file.

    Raises:
        ValueError: the file has other columns.
    """
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        reader = csv.DictReader(file)
        if reader.fieldnames is not None and tuple(reader.fieldnames) != COLUMNS:
            raise ValueError(f"{path.name} has other columns")
        found = [row for row in reader if None not in row.values() and None not in row]
    return list({key_of(row): row for row in found}.values())


def write_rows(path: Path, rows: Iterable[Row]) -> None:
    """Write a file of rows that is whole or not there."""
    kept = list(rows)
    with whole(path) as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(kept)


def merged(paths: Sequence[Path], out: Path) -> RowFile:
    """Put the rows of several files, for instance shards, into one; the caller closes it.

    Raises:
        InputError: a file is missing, they are made of different things, or a run has two different results.
    """
    plan = Plan.read(paths[0].with_suffix(".json"))
    for path in paths[1:]:
        plan = Plan.read(path.with_suffix(".json")).joined(plan, f"{path}")
    file = RowFile(out, plan)
    try:
        rows = {key_of(row): row for row in file.rows()}
        for path in paths:
            for row in read_rows(path):
                there = rows.setdefault(key_of(row), row)
                if there["outcome"] == "crashed":
                    rows[key_of(row)] = row
                elif timeless(row) != timeless(there) and row["outcome"] != "crashed":
                    raise InputError(
                        f"{path}", got=f"another result of {' '.join(key_of(row))}",
                        expected="the same row of a run in all files",
                    )  # fmt: skip
        file.write(rows.values())
    except BaseException:
        file.__exit__()
        raise
    return file


def difference(one: Mapping[str, object], other: Mapping[str, object]) -> list[str]:
    """Return the names that both have with different values."""
    return [name for name in one if name in other and one[name] != other[name]]


@contextlib.contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold the lock of a file while the block runs; it ends with the process, however that ends.

    Raises:
        InputError: another process holds it, or the folder cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = path.with_suffix(".lock").open("a+")
    except OSError as error:
        raise InputError(f"--out {path}", got=str(error), expected="a place that can be written") from None
    with file as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.seek(0)
            raise InputError(
                f"--out {path}", got=f"a file in use by {lock.read().strip() or 'another process'}",
                expected="a place of its own for each experiment that runs", fix="wait for it, or give another place",
            ) from None  # fmt: skip
        lock.truncate(0)
        lock.write(f"process {os.getpid()} on {os.uname().nodename}\n")
        lock.flush()
        yield


@contextlib.contextmanager
def whole(path: Path) -> Iterator[IO[str]]:
    """Open a file that is whole or not there."""
    partial = path.with_suffix(f"{path.suffix}.partial")
    with partial.open("w", newline="", encoding="utf-8") as file:
        yield file
        _to_disk(file)
    partial.replace(path)


def _to_disk(file: IO[str]) -> None:
    file.flush()
    os.fsync(file.fileno())
