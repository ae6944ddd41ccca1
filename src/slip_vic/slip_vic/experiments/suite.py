"""The benchmark: the suite carry-2026.2, a law in its worlds, and results that are verified and compared."""

from __future__ import annotations

import functools
import gzip
import json
from collections.abc import Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Final

import numpy as np

from slip_core.errors import InputError
from slip_core.files.resources import bounded_memory
from slip_vic.experiments.law import KNOWN, FoundLaw
from slip_vic.experiments.rows import FILE, digest_of, key_of, read_json, read_rows, refuse_difference
from slip_vic.experiments.run import Row, run
from slip_vic.experiments.world import Key, Track, World
from slip_vic.run.prepare import prepare
from slip_vic.run.versions import versions

SUITE: Final = "carry-2026.2"
COUNTS: Final = {1: 300, 2: 60}
"""Worlds with so many arms."""
DIGEST: Final = "efe34995133087f6"
"""Of the digests of all worlds."""
CLOCK: Final = 2.0
"""How many times the fastest slip-free time of its world a run lasts."""
SAMPLE: Final = 10
"""Worlds that `verify_result` runs again."""
TRACKS: Final[tuple[Track, ...]] = ("capped", "free")


@functools.cache
def _stored() -> tuple[World, ...]:
    """Return the worlds of both tracks, as tools/freeze_suite.py has frozen them.

    Of one arm every second one has drives, joints and sensors with all troubles at once. On the free track every second
    one has a gripper's preset, its forces scaled to the cap of 10 N. A run lasts CLOCK times the fastest time in which
    the path, never faster than given, is carried without slip by the world's own friction; where there is none the
    world is impossible. Of two arms it is the time of the path as given.
    """
    packed = resources.files("slip_vic.experiments").joinpath(f"{SUITE}.jsonl.gz").read_bytes()
    rows = map(json.loads, gzip.decompress(packed).splitlines())
    return tuple(World(**row | {"settings": tuple(row["settings"])}) for row in rows)


def worlds(track: Track, arms: int, count: int) -> list[World]:
    """Return the first worlds of a track."""
    chosen = [world for world in _stored() if (world.track, world.arms) == (track, arms)]
    return [
        replace(world, settings=(*world.settings, f"bridge.duration_s={CLOCK * world.fastest_s}"))
        for world in chosen[:count]
    ]


def suite(law: FoundLaw, count: int, arms: Sequence[int] = tuple(COUNTS)) -> list[World]:
    """Return the first `count` worlds with one arm, and with two where the law answers for several.

    Their track is free where the law commands the grip.
    """
    track: Track = "free" if "grip" in law.kind.needs else "capped"
    return [world for n in arms if n == 1 or getattr(law.kind, "several", False) for world in worlds(track, n, count)]


def read_result(folder: Path) -> list[Row]:
    """Return the rows of a folder.

    Raises:
        InputError: it has no rows, they are of another suite, or they were changed after they were written.
    """
    with bounded_memory(f"folder {folder}"):
        (made_of, written), rows = read_json(folder / FILE), read_rows(folder / FILE)
    for what, found, wanted in (
        ("suite", made_of.get("suite"), DIGEST),
        ("rows", digest_of(rows) if rows else "none", written),
    ):
        if found != wanted:
            raise InputError(f"folder {folder}", got=f"{what} {found}", expected=f"{wanted}, of slip-vic benchmark run")
    return rows


def compared(folders: Sequence[Path]) -> list[Row]:
    """Return the rows of several folders in the worlds that all laws of as many arms have.

    Raises:
        InputError: a folder holds no result, a world of a law differs between two, or no world is in all of them.
    """
    rows: dict[Key, Row] = {}
    made_of: dict[str, str] = {}
    for folder in folders:
        found = read_result(folder)
        own = {name: value for name, value in read_json(folder / FILE)[0].items() if name not in versions()}
        refuse_difference(own, made_of, f"rows in {folder}", "make all with the same")
        made_of |= own
        for row in found:
            if rows.setdefault(key_of(row), row) != row:
                got = f"another result of {' '.join(key_of(row))}"
                raise InputError(f"folder {folder}", got=got, expected="the same row of a run in all folders")
    kept = []
    for arms in COUNTS:
        own_rows = [row for row in rows.values() if row["arms"] == str(arms)]
        laws: dict[tuple[str, str], set[str]] = {}
        for row in own_rows:
            laws.setdefault((row["law"], row["track"]), set()).add(row["world"])
        common = set.intersection(*laws.values()) if laws else set()
        kept += [row for row in own_rows if row["world"] in common]
    if not kept:
        raise InputError("folders", got="no world that all of them have", expected="results of the same worlds")
    return kept


def verify_result(folder: Path, given: str = "") -> tuple[int, list[str]]:
    """Run ten worlds of a result, drawn by the digest of its rows, again; return how many, and those that differ.

    given: the law as the command line names it: a file of results can name any module, and is not followed.

    Raises:
        InputError: the folder holds no result of one law, or its law is not here or not named.
    """
    rows = read_result(folder)
    law, *others = {row["law"] for row in rows}
    if others or not (given or law.partition("?")[0] in KNOWN):
        raise InputError(
            f"folder {folder}", got=f"the law {', '.join((law, *others))}", expected="one law, of this suite",
            fix="read the code, then name it: --law LAW",
        )  # fmt: skip
    prepare()
    every = [world for track in TRACKS for arms, count in COUNTS.items() for world in worlds(track, arms, count)]
    known = {replace(world, law=law).key: replace(world, law=given or law) for world in every}
    drawn = np.random.default_rng(int(digest_of(rows), 16)).permutation(len(rows))[:SAMPLE]
    wrong = []
    for row in (rows[k] for k in sorted(drawn)):
        world = known.get(key_of(row))
        if world is None or run(world) | {"law": law} != row:
            wrong.append(f"{' '.join(key_of(row))} differs")
    return len(drawn), wrong
