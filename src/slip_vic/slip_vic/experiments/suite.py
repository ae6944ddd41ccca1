"""The benchmark: the suite carry-2026.1, a law in its worlds, and results that are verified and compared."""

from __future__ import annotations

import functools
import gzip
import json
from collections.abc import Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Final, get_args

import numpy as np

from slip_core.errors import InputError
from slip_vic.experiments.law import KNOWN, FoundLaw, find_law
from slip_vic.experiments.rows import FILE, Row, Task, digest_of, joined, key_of, read_json, read_rows
from slip_vic.experiments.run import run
from slip_vic.experiments.world import Track, World, frozen_worlds
from slip_vic.run.prepare import prepare
from slip_vic.run.versions import versions

SUITE: Final = "carry-2026.1"
COUNTS: Final = {1: 300, 2: 60}
"""Worlds with so many arms."""
DIGEST: Final = "8e44fee3abe2ed8c"
"""Of the digests of all worlds."""
RANKED: Final = (
    "slip_path_m", "slip_path_rad", "arrival_s", "final_error_m", "final_error_rad", "squeeze_peak_n",
    "squeeze_mean_n", "effort_rate_rms_n_m_s",
)  # fmt: skip
"""What laws are compared by and `verify_result` looks at."""
SAMPLE: Final = 10
"""Worlds that `verify_result` runs again."""


@functools.cache
def _stored() -> tuple[World, ...]:
    """Return all worlds, as they were drawn when the suite was frozen.

    Of one arm every second one has drives, joints and sensors with all troubles at once. A world in which friction does
    not carry the weight at rest was not taken. Runs last 2 s longer than the path as given, and laws of this project
    read their sensors at rest for 0.3 s first.
    """
    packed = resources.files("slip_vic.experiments").joinpath(f"{SUITE}.jsonl.gz").read_bytes()
    return tuple(frozen_worlds(json.loads(line) for line in gzip.decompress(packed).splitlines()))


def worlds(track: Track, arms: int, count: int) -> list[World]:
    """Return the first worlds of a track."""
    chosen = [world for world in _stored() if (world.set, world.arms) == (SUITE, arms)]
    return [replace(world, track=track) for world in chosen[:count]]


def track_of(law: FoundLaw) -> Track:
    """Return the track of a law: free where it commands the grip."""
    return "free" if "grip" in law.kind.needs else "capped"


def suite(law: FoundLaw, count: int, track: Track | None = None, arms: Sequence[int] = tuple(COUNTS)) -> list[World]:
    """Return the first `count` worlds with one arm, and with two where the law answers for several.

    track: None: that of the law.
    """
    able = [n for n in arms if n == 1 or law.several]
    return [world for n in able for world in worlds(track or track_of(law), n, count)]


def read_result(folder: Path) -> tuple[list[Row], str, dict[str, str]]:
    """Return the rows of a folder, their digest when they were written, and what they are made of.

    Raises:
        InputError: it has no rows, or they are of another suite.
    """
    made_of, digest = read_json(folder / FILE)
    if made_of.get("suite") != DIGEST:
        found = made_of.get("suite", "rows of no suite")
        raise InputError(f"folder {folder}", got=found, expected=f"{SUITE} {DIGEST}, of slip-vic benchmark run")
    return read_rows(folder / FILE), digest, made_of


def compared(folders: Sequence[Path]) -> list[Row]:
    """Return the rows of several folders, shards too, in the worlds that all laws of as many arms have.

    Raises:
        InputError: a folder holds no result, two of a law differ, or no world is in all of them.
    """
    for folder in folders:
        read_result(folder)
    rows, _ = joined(folders, versions=versions())
    kept = []
    for arms in COUNTS:
        own = [row for row in rows if row["arms"] == str(arms)]
        laws: dict[tuple[str, str], set[str]] = {}
        for row in own:
            laws.setdefault((row["law"], row["track"]), set()).add(row["world"])
        common = set.intersection(*laws.values()) if laws else set()
        kept += [row for row in own if row["world"] in common]
    if not kept:
        raise InputError("folders", got="no world that all of them have", expected="results of the same worlds")
    return kept


def verify_result(folder: Path, given: str = "") -> tuple[int, list[str]]:
    """Run ten worlds, drawn by the digest of the rows, again; return how many, and one line on each that differs.

    given: the law as the command line names it: a file of results can name any module, and is not followed.

    Raises:
        InputError: the folder holds no result, or its law is not here, is not named, or has another source.
    """
    rows, digest, made_of = read_result(folder)
    named = {row["law"] for row in rows}
    if len(named) != 1:
        raise InputError(f"folder {folder}", got=f"{len(named)} laws", expected="the rows of one")
    (name,) = named
    law = given or name
    if not given and name.partition("?")[0] not in KNOWN:
        raise InputError(
            f"folder {folder}", got=f"law {name}, whose code would run here", expected="a law of this suite",
            fix="read the code, then name it: --law LAW",
        )  # fmt: skip
    source, wanted = find_law(law).source, made_of.get(f"law {name}", "no source")
    if source != wanted:
        raise InputError(f"law {law}", got=f"source {source}", expected=f"{wanted}, as in {folder}")
    prepare()
    found = digest_of(rows)
    wrong = [] if digest == found else [f"rows have the digest {found}, rows.json has {digest}"]
    drawn = np.random.default_rng(int(found, 16)).permutation(len(rows))[:SAMPLE]
    tracks = [track for track in get_args(Track) if track]
    known = {
        Task(world, name).key: world
        for track in tracks for arms, count in COUNTS.items() for world in worlds(track, arms, count)
    }  # fmt: skip
    for row in (rows[k] for k in sorted(drawn)):
        world = known.get(key_of(row))
        title = f"{row['arms']} arms, world {row['world']}"
        if world is None:
            wrong.append(f"{title}: no such world in {SUITE}")
            continue
        again = run(world, law)
        differ = {"outcome": again.outcome} | {metric: repr(float(again.metrics[metric])) for metric in RANKED}
        lines = [
            f"{title}: {what} is {now}, the result has {row[what]}" for what, now in differ.items() if now != row[what]
        ]
        wrong += lines[:1]
    return len(drawn), wrong
