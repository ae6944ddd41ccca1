"""What ``slip-vic study`` and ``slip-vic merge`` do: worlds under laws into a folder, with tables and a picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

from rich.console import Console

from slip_vic.experiments.contents import Contents, gather
from slip_vic.experiments.engines import EngineName
from slip_vic.experiments.rows import Asked, Plan, RowFile, key_of, merged
from slip_vic.experiments.runner import fill
from slip_vic.experiments.tables import summary_tables, write_picture
from slip_vic.run.prepare import prepare

FILE: Final = "study.csv"


class Done(NamedTuple):
    """One line on what was done, and one on every run that did not end well."""

    line: str
    bad: tuple[str, ...]


def run_study(asked: Sequence[Asked], out: Path, engine: EngineName, jobs: int, *, check: bool = True) -> Done:
    """Make the runs that a folder does not have yet.

    Args:
        asked: worlds and laws.
        out: the folder.
        engine: where, with so many `jobs`.
        check: whether a world of each scenario is checked first: what does not fit ends the study before it begins.

    Raises:
        InputError: an unknown name, a bad override, a folder that is in use or holds another study, no cluster.
        MixedVersions: a worker has other versions.
    """
    worlds = list(dict.fromkeys(world for one in asked for world in one.worlds))
    contents = gather_of(asked)
    prepare()  # here, before workers that start together all begin to
    if check:
        for world in {world.scenario: world for world in reversed(worlds)}.values():
            world.load("classical", texts=contents.texts).check()
    plan = Plan(contents.made_of, tuple(asked))
    with RowFile(out / FILE, plan) as file:
        tasks = Plan({}, tuple(asked)).tasks()
        there, deaths = fill(file, "study", tasks, contents, engine, jobs)
        picture = _show(file)
        rows = file.rows()
    died = f"; {deaths} workers died" if deaths else ""
    keys = {task.key for task in tasks}
    bad = [row for row in rows if row["outcome"] != "ok" and key_of(row) in keys]
    return Done(
        f"{there} of {len(tasks)} runs were there already{died}; {file.path}, {picture}",
        tuple(f"{' '.join(filter(None, key_of(row)[:-1]))}: {row['outcome']}, {row['reason']}" for row in bad),
    )


def gather_of(asked: Sequence[Asked]) -> Contents:
    """Return what the runs share: the texts of their files, and versions."""
    worlds = [world for one in asked for world in one.worlds]
    urdfs = [one for world in worlds for one in world.settings if "robot_description_file=" in one]
    scenarios = dict.fromkeys(world.scenario for world in worlds)
    return gather(scenarios, dict.fromkeys(world.sensor for world in worlds), tuple(dict.fromkeys(urdfs)))


def resume(out: Path, engine: EngineName, jobs: int) -> Done:
    """Continue everything that a folder was asked for; see `run_study`."""
    return run_study(Plan.read((out / FILE).with_suffix(".json")).asked, out, engine, jobs)


def merge_studies(folders: Sequence[Path], out: Path) -> str:
    """Put studies into one folder; return one line on what is there and what is not.

    Raises:
        InputError: they do not fit together.
    """
    with merged([folder / FILE for folder in folders], out / FILE) as file:
        picture = _show(file)
        wanted = {task.key for task in file.plan.tasks()}
        missing = len(wanted - file.done())
        return f"{len(file.rows())} rows, {missing} of {len(wanted)} runs are missing; {file.path}, {picture}"


def _show(file: RowFile) -> Path:
    rows = file.rows()
    picture = file.path.with_suffix(".png")
    write_picture(picture, rows)
    Console().print(*summary_tables(rows), sep="\n")
    return picture
