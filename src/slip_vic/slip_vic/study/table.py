"""The folder of a study: one CSV row per case, appended as cases end; what it is made of; a lock.

Rows that stand in a folder were all made by the same code from the same files: what differs is refused by its name.
"""

from __future__ import annotations

import contextlib
import csv
import fcntl
import json
import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import IO, Any, Generic, Protocol, Self, TypeVar

from slip_core.errors import InputError
from slip_vic.study.cases import Asked
from slip_vic.study.contents import Contents, difference

KEY = ("scenario", "law", "sensor", "estimator", "mismatch", "seed")
Row = dict[str, str]
Key = tuple[str, ...]


METRICS = (
    "slip_linear_m",
    "slip_angular_rad",
    "slip_speed_peak_m_s",
    "tracking_rms_m",
    "final_error_m",
    "final_error_rad",
    "attitude_excursion_rad",
    "effort_rate_rms_n_m_s",
    "arrival_s",
    "slip_linear_peak_m",
)
"""At the end: slip_*, final_error_*; arrival_s: since when the pad stays within 1 mm and 0.5 degrees of the end of its
path; effort_rate_rms_n_m_s: of the norm of the change of all efforts from tick to tick."""


class Keyed(Protocol):
    """A case: a task of an engine, and what names its row."""

    @property
    def key(self) -> Key:
        """The leading columns of its row."""


Named = TypeVar("Named", bound=Keyed)


@dataclass(frozen=True, slots=True)
class CaseResult(Generic[Named]):
    """A row: outcome of a case, as `slip_vic.run.judge.Outcome` has them, why, and numbers by the names of a layout."""

    case: Named
    outcome: str
    reason: str
    metrics: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Layout:
    """Columns of a table: those that name a case, the last one a number, and its metrics."""

    key: tuple[str, ...]
    metrics: tuple[str, ...]

    @property
    def columns(self) -> tuple[str, ...]:
        """All, in their order."""
        return (*self.key, "outcome", *self.metrics, "reason")

    def key_of(self, row: Row) -> Key:
        """Return what names the case of a row."""
        return tuple(row[name] for name in self.key)

    def failed(self, case: Named, outcome: str, reason: str) -> CaseResult[Named]:
        """Return the result of a case that has no numbers."""
        return CaseResult(case, outcome, reason, dict.fromkeys(self.metrics, math.nan))


STUDY = Layout(KEY, METRICS)


@dataclass(frozen=True, slots=True)
class Settings:
    """What a study is made of: the content of ``study.json``.

    assignments: overrides of every case; digests: of scenario, sensor and URDF files; versions: of the code; asked:
    what it was asked for, one after the other.
    """

    assignments: tuple[str, ...]
    digests: Mapping[str, str]
    versions: Mapping[str, str]
    asked: tuple[Asked, ...] = field(default=())

    @classmethod
    def of(cls, contents: Contents, asked: Sequence[Asked]) -> Self:
        """Return the settings of a new study."""
        return cls(contents.assignments, contents.digests(), contents.versions, tuple(asked))

    @classmethod
    def read(cls, file: Path) -> Self:
        """Read a ``study.json``.

        Raises:
            InputError: there is none, or it is not one of today.
        """
        try:
            found = json.loads(file.read_text(encoding="utf-8"))
            asked = tuple(Asked.read(one) for one in found["asked"])
            return cls(tuple(found["assignments"]), dict(found["digests"]), dict(found["versions"]), asked)
        except (OSError, ValueError, KeyError, TypeError) as error:
            problem = f"{type(error).__name__}: {error}"
            raise InputError(
                f"file {file}", got=problem, expected="what a study of this version writes", fix="give another folder"
            ) from None

    def write(self, file: Path) -> None:
        """Write a ``study.json``."""
        _write_whole(file, json.dumps(asdict(self), indent=1) + "\n")

    def joined(self, other: Settings, where: str) -> Settings:
        """Return what both are made of together.

        Raises:
            InputError: they do not fit; names what differs.
        """
        if other.assignments != self.assignments:
            raise InputError(
                where, got=f"a study with --set {list(self.assignments)}",
                expected=f"the same overrides, {list(other.assignments)}", fix="give another folder",
            )  # fmt: skip
        for what, mine, others in (
            ("made with", self.versions, other.versions), ("of", self.digests, other.digests),
        ):  # fmt: skip
            differ = difference(mine, others)
            if differ:
                name = differ[0]
                raise InputError(
                    where, got=f"a study {what} {name} {mine[name]}", expected=f"{name} {others[name]}",
                    fix="give another folder",
                )  # fmt: skip
        asked = tuple(dict.fromkeys((*self.asked, *other.asked)))
        return replace(self, digests={**self.digests, **other.digests}, asked=asked)


class StudyTable:
    """The file ``study.csv`` of a folder; a context manager that holds the folder's lock.

    Args:
        folder: made where it does not exist.
        settings: what the rows that come are made of.
        layout: its columns.

    Raises:
        InputError: the folder cannot be written, is in use, or holds a study that is made of something else.
    """

    def __init__(self, folder: Path, settings: Settings, layout: Layout = STUDY) -> None:
        self.layout = layout
        self.path = folder / "study.csv"
        file = folder / "study.json"
        with contextlib.ExitStack() as undo:
            try:
                undo.enter_context(locked(folder))
                if file.exists():
                    settings = Settings.read(file).joined(settings, f"--out {folder}")
                settings.write(file)
                self.settings = settings
                _write_rows(self.path, [row for row in self.rows() if row["outcome"] != "crashed"], layout)
                self._file = undo.enter_context(self.path.open("a", newline="", encoding="utf-8"))
            except (OSError, ValueError) as error:
                raise InputError(f"--out {folder}", got=str(error), expected="a folder for a study") from None
            self._close = undo.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._close.close()

    def rows(self) -> list[Row]:
        """Return all complete rows."""
        return read_rows(self.path, self.layout)

    def done(self) -> set[Key]:
        """Return the keys of the cases that need not run again; those that crashed do."""
        return {self.layout.key_of(row) for row in self.rows() if row["outcome"] != "crashed"}

    def append(self, result: CaseResult[Any]) -> None:
        """Add a row; it is on the disk when this returns."""
        numbers = [repr(float(result.metrics[name])) for name in self.layout.metrics]
        csv.writer(self._file).writerow([*result.case.key, result.outcome, *numbers, " ".join(result.reason.split())])
        self._file.flush()
        os.fsync(self._file.fileno())

    def sort(self) -> None:
        """Put the rows in the order of their cases: the same file, whichever was first."""
        self.write(self.rows())

    def write(self, rows: Iterable[Row]) -> None:
        """Put these rows in the place of those that are there, in the order of their cases."""
        in_order = sorted(rows, key=lambda row: (*(key := self.layout.key_of(row))[:-1], int(key[-1])))
        _write_rows(self.path, in_order, self.layout)
        self._file.close()
        self._file = self.path.open("a", newline="", encoding="utf-8")
        self._close.callback(self._file.close)


def read_rows(path: Path, layout: Layout = STUDY) -> list[Row]:
    """Return the complete rows of a table, of each case the last; none where there is no file.

    Raises:
        ValueError: the file has other columns.
    """
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        reader = csv.DictReader(file)
        if reader.fieldnames is not None and tuple(reader.fieldnames) != layout.columns:
            raise ValueError(f"{path.name} has other columns")
        whole = [row for row in reader if None not in row.values() and None not in row]
    return list({layout.key_of(row): row for row in whole}.values())


def merge(folders: Sequence[Path], out: Path) -> StudyTable:
    """Put the rows of several studies, for instance shards, into one folder; the caller closes the table.

    Raises:
        InputError: a folder holds no study, they are made of different things, or a case has two different results.
    """
    settings = Settings.read(folders[0] / "study.json")
    for folder in folders[1:]:
        settings = Settings.read(folder / "study.json").joined(settings, f"folder {folder}")
    table = StudyTable(out, settings)
    try:
        rows = {STUDY.key_of(row): row for row in table.rows()}
        for folder in folders:
            for row in read_rows(folder / "study.csv"):
                there = rows.setdefault(STUDY.key_of(row), row)
                if there["outcome"] == "crashed":
                    rows[STUDY.key_of(row)] = row
                elif row != there and row["outcome"] != "crashed":
                    raise InputError(
                        f"folder {folder}", got=f"another result of {' '.join(STUDY.key_of(row))}",
                        expected="the same row of a case in all folders",
                    )  # fmt: skip
        table.write(rows.values())
    except BaseException:
        table.__exit__()
        raise
    return table


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder while the block runs; it ends with the process, however that ends.

    Raises:
        InputError: another process holds it, or the folder cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = (folder / "study.lock").open("a+")
    except OSError as error:
        raise InputError(f"--out {folder}", got=str(error), expected="a folder that can be written") from None
    with file as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.seek(0)
            raise InputError(
                f"--out {folder}", got=f"a folder in use by {lock.read().strip() or 'another study'}",
                expected="a folder of its own for each study that runs", fix="wait for it, or give another folder",
            ) from None  # fmt: skip
        lock.truncate(0)
        lock.write(f"process {os.getpid()} on {os.uname().nodename}\n")
        lock.flush()
        yield


def _write_rows(path: Path, rows: Iterable[Row], layout: Layout) -> None:
    partial = path.with_suffix(".partial")
    with partial.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, layout.columns)
        writer.writeheader()
        writer.writerows(rows)
        _to_disk(file)
    partial.replace(path)


def _write_whole(path: Path, text: str) -> None:
    """Write a file that is whole or not there."""
    partial = path.with_suffix(".partial")
    with partial.open("w", encoding="utf-8") as file:
        file.write(text)
        _to_disk(file)
    partial.replace(path)


def _to_disk(file: IO[str]) -> None:
    file.flush()
    os.fsync(file.fileno())
