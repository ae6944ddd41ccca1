"""The table of a study: one CSV row per case, appended as cases end, read back to go on where a study stopped."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from pathlib import Path

from slip_bringup.study.run_case import METRICS, CaseResult
from slip_core.errors import InputError

KEY = ("scenario", "controller", "sensor", "estimator", "mismatch", "seed")
COLUMNS = (*KEY, "outcome", *METRICS, "reason")
Row = dict[str, str]


class StudyTable:
    """The file ``study.csv`` of a folder.

    Args:
        folder: made where it does not exist.
        assignments: overrides of the study; a folder keeps to one set of them.

    Raises:
        InputError: the folder cannot be written, or holds a study with other overrides.
    """

    def __init__(self, folder: Path, assignments: Sequence[str]) -> None:
        self.path = folder / "study.csv"
        settings, wanted = folder / "study.json", {"assignments": list(assignments)}
        try:
            folder.mkdir(parents=True, exist_ok=True)
            if settings.exists():
                found = json.loads(settings.read_text(encoding="utf-8"))
                if found != wanted:
                    raise InputError(
                        f"--out {folder}",
                        got=f"a study with --set {found.get('assignments')}",
                        expected=f"the same overrides, {list(assignments)}",
                        fix="give another folder",
                    )
            settings.write_text(json.dumps(wanted) + "\n", encoding="utf-8")
            self._repair()
        except (OSError, ValueError) as error:
            raise InputError(f"--out {folder}", got=str(error), expected="a folder for a study") from None

    def rows(self) -> list[Row]:
        """Return all complete rows."""
        with self.path.open(newline="", encoding="utf-8") as file:
            return list(csv.DictReader(file))

    def done(self) -> set[tuple[str, ...]]:
        """Return the keys of the cases that need not run again; those that crashed do."""
        return {tuple(row[name] for name in KEY) for row in self.rows() if row["outcome"] != "crashed"}

    def append(self, result: CaseResult) -> None:
        """Add a row; it is on the disk when this returns."""
        numbers = [f"{result.metrics[name]:.9g}" for name in METRICS]
        with self.path.open("a", newline="", encoding="utf-8") as file:
            csv.writer(file).writerow([*result.case.key, result.outcome, *numbers, " ".join(result.reason.split())])

    def _repair(self) -> None:
        """Write the header of a new table; drop a row that was cut off, and those that a newer one replaces."""
        kept: dict[tuple[str, ...], Row] = {}
        if self.path.exists():
            with self.path.open(newline="", encoding="utf-8") as file:
                reader = csv.DictReader(file)
                if reader.fieldnames is not None and tuple(reader.fieldnames) != COLUMNS:
                    raise ValueError(f"{self.path.name} has other columns")
                for row in reader:
                    if None not in row.values() and None not in row:
                        kept[tuple(row[name] for name in KEY)] = row
        with self.path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, COLUMNS)
            writer.writeheader()
            writer.writerows(row for row in kept.values() if row["outcome"] != "crashed")
