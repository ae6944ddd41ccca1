"""What ``slip-vic study`` and ``slip-vic merge`` do."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from rich.console import Console

from slip_vic.run.prepare import prepare
from slip_vic.study.cases import Asked
from slip_vic.study.contents import gather
from slip_vic.study.engines import EngineName
from slip_vic.study.runner import fill, run_on_worker
from slip_vic.study.summary import summary_tables, write_picture
from slip_vic.study.table import KEY, Settings, StudyTable, merge


class Done(NamedTuple):
    """One line on what was done, and one on every case that did not end well."""

    line: str
    bad: tuple[str, ...]


def run_study(asked: Sequence[Asked], assignments: Sequence[str], out: Path, engine: EngineName, jobs: int) -> Done:
    """Run the cases that a folder does not have yet.

    Raises:
        InputError: an unknown name, a bad override, a folder that is in use or holds another study, no cluster.
        MixedVersions: a worker has other versions.
    """
    cases = list(dict.fromkeys(case for one in asked for case in one.cases()))
    scenarios = dict.fromkeys(name for one in asked for name in one.scenarios)
    contents = gather(scenarios, dict.fromkeys(name for one in asked for name in one.sensors), assignments)
    prepare()  # here, before workers that start together all begin to
    for case in {case.scenario: case for case in reversed(cases)}.values():
        case.load(assignments, contents.texts).check()
    with StudyTable(out, Settings.of(contents, asked)) as table:
        there, deaths = fill(table, "study", cases, run_on_worker, contents, engine, jobs)
        picture = _show(table)
        rows = table.rows()
    died = f"; {deaths} workers died" if deaths else ""
    keys = {case.key for case in cases}
    bad = [row for row in rows if row["outcome"] != "ok" and tuple(row[name] for name in KEY) in keys]
    return Done(
        f"{there} of {len(cases)} cases were there already{died}; {table.path}, {picture}",
        tuple(f"{' '.join(row[name] for name in KEY)}: {row['outcome']}, {row['reason']}" for row in bad),
    )


def resume(out: Path, engine: EngineName, jobs: int) -> Done:
    """Go on with everything that a folder was asked for; see `run_study`."""
    settings = Settings.read(out / "study.json")
    return run_study(settings.asked, settings.assignments, out, engine, jobs)


def merge_studies(folders: Sequence[Path], out: Path) -> str:
    """Put studies into one folder; return one line on what is there and what is not.

    Raises:
        InputError: they do not fit together.
    """
    with merge(folders, out) as table:
        picture = _show(table)
        wanted = {case.key for one in table.settings.asked for case in one.cases()}
        missing = len(wanted - table.done())
        return f"{len(table.rows())} rows, {missing} of {len(wanted)} cases are missing; {table.path}, {picture}"


def _show(table: StudyTable) -> Path:
    rows = table.rows()
    picture = table.path.with_suffix(".png")
    write_picture(picture, rows)
    Console().print(*summary_tables(rows), sep="\n")
    return picture
