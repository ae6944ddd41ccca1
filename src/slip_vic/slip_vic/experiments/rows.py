"""The rows of an experiment: ``rows.csv``, a row per run, added as runs end, and ``rows.json``, what they are made of.

Rows of one file were all made by the same code from the same files: what differs is refused by its name. A file that
was stopped anywhere is continued.
"""

from __future__ import annotations

import contextlib
import csv
import io
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Final

from slip_core.errors import InputError
from slip_core.files.plain_yaml import parse_json
from slip_core.files.resources import open_file, read_text
from slip_vic.experiments.run import COLUMNS, METRICS, Row
from slip_vic.experiments.world import KEY, Key
from slip_vic.run.lock import own_folder
from slip_vic.run.versions import digest

FILE: Final = "rows.csv"


@contextlib.contextmanager
def rows_added(path: Path, made_of: Mapping[str, str]) -> Iterator[tuple[set[Key], Callable[[Row], None]]]:
    """Give the keys of the runs that a file has, but for those that crashed, and a function that adds a row.

    The file is locked while the block runs. At its end the rows are put in the order of their runs: the same file,
    whichever was first.

    Args:
        path: of the CSV file; its folder is made where it does not exist.
        made_of: versions of the code and digests of the files of which the rows that come are made, by their names.

    Raises:
        InputError: the file cannot be written, is in use, or holds rows that are made of something else.
    """
    with own_folder(path.parent):
        before = read_json(path)[0] if path.with_suffix(".json").exists() else {}
        refuse_difference(before, made_of, f"rows in {path.parent}", "give another folder")
        together = {**before, **made_of}
        there = [row for row in read_rows(path) if row["outcome"] != "crashed"]
        write_rows(path, there, together)
        try:
            with path.open("a", newline="", encoding="utf-8") as file:

                def add(row: Row) -> None:
                    csv.writer(file).writerow(row.values())
                    file.flush()

                yield {key_of(row) for row in there}, add
        finally:
            write_rows(path, read_rows(path), together)


def key_of(row: Row) -> Key:
    """Return what names the run of a row."""
    return tuple(row[name] for name in KEY)


def digest_of(rows: Iterable[Row]) -> str:
    """Return the digest of rows."""
    return digest(json.dumps(list(row.values())).encode() for row in rows)


def read_rows(path: Path) -> list[Row]:
    """Return the complete rows of a file, of each run the last; none where there is no file.

    Raises:
        InputError: the file lacks columns, or has something else where numbers belong.
    """
    if not path.exists():
        return []
    with io.TextIOWrapper(open_file(path, f"rows {path}"), "utf-8", newline="") as file:
        reader = csv.DictReader(file)
        try:
            if missing := set(COLUMNS).difference(reader.fieldnames or COLUMNS):
                raise ValueError(f"no column {', '.join(sorted(missing))}")
            found = [row for row in reader if None not in row.values() and None not in row]
            for row in found:
                int(row["world"]), [float(row[name]) for name in METRICS]
        except (csv.Error, ValueError) as error:
            raise InputError(f"rows {path}", got=str(error), expected="rows of a study") from None
    return list({key_of(row): {name: row[name] for name in COLUMNS} for row in found}.values())


def write_rows(path: Path, rows: Iterable[Row], made_of: Mapping[str, str]) -> None:
    """Write rows in the order of their runs, and what they are made of with their digest; each file whole or not."""
    kept = sorted(rows, key=lambda row: (row["set"], int(row["world"]), key_of(row)))
    partial = path.with_suffix(".partial")
    with partial.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(kept)
    partial.replace(path)
    content = {"made_of": dict(made_of), "rows": digest_of(kept)}
    partial.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    partial.replace(path.with_suffix(".json"))


def read_json(path: Path) -> tuple[dict[str, str], str]:
    """Return what the rows of a file are made of, and their digest when they were written.

    Raises:
        InputError: nothing of this version says so.
    """
    try:
        found = parse_json(read_text(str(path.with_suffix(".json")), f"rows {path}"))
        return dict(found["made_of"]), str(found["rows"])
    except (ValueError, KeyError, TypeError) as error:
        expected, fix = "rows of an experiment", "give another folder"
        raise InputError(f"folder {path.parent}", got=str(error), expected=expected, fix=fix) from None


def refuse_difference(one: Mapping[str, str], other: Mapping[str, str], where: str, fix: str) -> None:
    """Raise if a name has different meanings in both."""
    for name in one:
        if other.get(name, one[name]) != one[name]:
            raise InputError(where, got=f"{name} {one[name]}", expected=f"{other[name]}", fix=fix)
