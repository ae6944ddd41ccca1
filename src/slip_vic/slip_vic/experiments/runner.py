"""Makes runs on an engine into a folder, and shows its rows; a run that kills its workers is a row."""

from __future__ import annotations

import functools
import platform
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from slip_bags.cli import echo
from slip_vic.experiments import suite
from slip_vic.experiments.engines import ENGINES, Died, Engine
from slip_vic.experiments.law import find_law
from slip_vic.experiments.rows import FILE, key_of, read_rows, refuse_difference, rows_added
from slip_vic.experiments.run import Row, row_of, run
from slip_vic.experiments.world import Key, World
from slip_vic.presets import preset_text
from slip_vic.run.prepare import prepare
from slip_vic.run.progress import progress
from slip_vic.run.versions import digest, versions
from slip_vic.scenarios.scenario import LAWS, load


def made_of(worlds: Iterable[World]) -> dict[str, str]:
    """Return what rows of these runs are made of: versions, and digests of scenarios with arms, sensors, laws, suite.

    Raises:
        InputError: an unknown name, a file that cannot be read, a bad override of the arm, no such law.
    """
    found = dict(versions())
    for world in worlds:
        arm = tuple(one for one in world.settings if "robot_description_file=" in one)
        found[" ".join(("scenario", world.scenario, *arm))] = _scenario(world.scenario, arm)
        for kind, name in (("sensor", world.sensor), ("drive", world.preset_drive)):
            if name:
                found[f"{kind} {name}"] = digest([preset_text(f"{kind}s", name).encode()])
        if world.track or world.law.partition("?")[0] not in LAWS:
            found[f"law {world.law}"] = find_law(world.law).source
        if world.track:
            found["suite"] = suite.DIGEST
    return found


@functools.cache
def _scenario(name: str, arm: tuple[str, ...]) -> str:
    loaded = load(name, set=arm)
    return digest(text.encode() for text in (loaded.text, *loaded.urdfs.values()))


def run_on_worker(wanted: Mapping[str, str], world: World) -> Row:
    """Make one run in this process.

    Raises:
        InputError: this worker has other versions or files than the process that sent the world.
    """
    refuse_difference(made_of([world]), wanted, f"worker on {platform.node()}", "install there what runs here")
    prepare()
    return run(world)


def fill(path: Path, name: str, worlds: Sequence[World], workers: Engine) -> tuple[list[Row], int]:
    """Make the runs that a file of rows does not have yet; return all rows, and how many of them it had.

    Workers that died are reported with their runs.

    Args:
        path: of the file.
        name: of what runs, for the progress that is shown.
        worlds: all, each with its law.
        workers: make the runs.

    Raises:
        InputError: see `made_of` and `rows_added`; a worker has other versions or files.
    """
    wanted, before = made_of(worlds), len(workers.deaths)
    with rows_added(path, wanted) as (done, add):
        left = [world for world in worlds if world.key not in done]
        there = len(worlds) - len(left)
        with progress(Console(stderr=True)) as add_bar:
            report = add_bar(name, len(worlds), there)
            if left:
                prepare()  # here, before workers that start together all begin to
            for now, (world, row) in enumerate(workers.run(run_on_worker, wanted, left), there + 1):
                add(row_of(world, "crashed", row.reason, {}) if isinstance(row, Died) else row)
                died = len(workers.deaths) - before
                report(now, f"{died} workers died" if died else "")
    for world, why in workers.deaths[before:]:
        echo(f"a worker died and its run was tried again: {in_words(world.key)}, {why}", err=True)
    keys = {world.key for world in worlds}
    return [row for row in read_rows(path) if key_of(row) in keys], there


def in_words(key: Key) -> str:
    """Return a key in words, without the digest."""
    return " ".join(filter(None, key[:-1]))


def sentences(rows: Iterable[Row]) -> list[str]:
    """Return a line on each row: its run, outcome and reason."""
    return [f"{in_words(key_of(row))}: {row['outcome']}, {row['reason']}" for row in rows]


def under_laws(worlds: Sequence[World], laws: Sequence[str]) -> list[World]:
    """Return each world once under each law; all laws of a world one after the other."""
    return list(dict.fromkeys(replace(world, law=law) for world in worlds for law in laws))


def run_study(worlds: Sequence[World], out: Path, engine: str, jobs: int) -> list[Row]:
    """Make the runs that a folder does not have yet, and show all that were asked for; see `fill`."""
    with ENGINES[engine](jobs) as workers:
        rows, there = fill(out / FILE, out.name, worlds, workers)
    show(rows, out)
    echo(f"{there} of {len(rows)} runs were there already; {out}")
    return rows


def show(rows: Sequence[Row], out: Path) -> None:
    """Print the tables of some rows, and write their picture, ``rows.png``."""
    from slip_vic.experiments.tables import tables_of, write_picture  # workers need no matplotlib

    if not rows:
        return
    write_picture((out / FILE).with_suffix(".png"), rows)
    echo("\n\n".join(tables_of(rows)))
