"""The benchmark: the suite carry-2026.1, a law in its worlds, and results that are verified."""

from __future__ import annotations

import functools
import gzip
import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Final, get_args

import numpy as np

from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_vic.experiments.contents import Contents
from slip_vic.experiments.engines import EngineName
from slip_vic.experiments.law import FoundLaw, find_law
from slip_vic.experiments.rows import Asked, Plan, Row, RowFile, Task, digest_of, key_of, read_rows
from slip_vic.experiments.run import LOST, Result, run
from slip_vic.experiments.runner import fill
from slip_vic.experiments.world import Track, World, frozen_worlds
from slip_vic.run.prepare import prepare
from slip_vic.run.versions import versions
from slip_vic.scenarios.scenario import NO_TEXTS

SUITE: Final = "carry-2026.1"
TUNING: Final = f"{SUITE}-tuning"
"""The set on which laws are tuned; none of its worlds is in the suite."""
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
ROWS: Final = "rows.csv"


@functools.cache
def _stored() -> tuple[World, ...]:
    """Return all worlds, as they were drawn when the suite was frozen.

    Of one arm every second one has drives, joints and sensors with all troubles at once. A world in which friction does
    not carry the weight at rest was not taken. Runs last 2 s longer than the path as given, and laws of this project
    read their sensors at rest for 0.3 s first.
    """
    packed = resources.files("slip_vic.experiments").joinpath(f"{SUITE}.jsonl.gz").read_bytes()
    return tuple(frozen_worlds(json.loads(line) for line in gzip.decompress(packed).splitlines()))


def worlds(track: Track, arms: int, count: int, name: str = SUITE) -> list[World]:
    """Return the first worlds of a track."""
    chosen = [world for world in _stored() if (world.set, world.arms) == (name, arms)]
    return [replace(world, track=track) for world in chosen[:count]]


def track_of(law: FoundLaw) -> Track:
    """Return the track of a law: free where it commands the grip."""
    return "free" if "grip" in law.kind.needs else "capped"


def suite(
    law: FoundLaw, count: int, track: Track | None = None, arms: Sequence[int] = tuple(COUNTS), name: str = SUITE
) -> list[World]:
    """Return the first `count` worlds with one arm, and with two where the law answers for several.

    track: None: that of the law.
    """
    able = [n for n in arms if n == 1 or law.several]
    return [world for n in able for world in worlds(track or track_of(law), n, count, name)]


@dataclass(frozen=True, slots=True)
class LawRows:
    """Rows of a law, and what they are of.

    name: as on the command line; label: in tables; oracle: not ranked; digest: of the rows as they were written.
    """

    name: str
    label: str
    source: str
    oracle: bool
    digest: str
    rows: tuple[Row, ...]

    def values(self, metric: str, arms: int, numbers: frozenset[str]) -> Array:
        """Return a metric of some worlds; infinite where the law has no number, as where the object was lost."""
        found = [float(row[metric]) for row in self.rows if row["arms"] == str(arms) and row["world"] in numbers]
        return np.where(np.isfinite(found), found, math.inf)


def run_law(
    name: str, count: int, out: Path, engine: EngineName, jobs: int, shard: tuple[int, int] = (1, 1),
    track: Track | None = None, arms: Sequence[int] = tuple(COUNTS),
) -> str:  # fmt: skip
    """Run the worlds that a folder does not have yet; return one line on what is there.

    Args:
        name: of the law, see `find_law`.
        count: worlds with each number of arms.
        out: folder of this law alone.
        engine: where, with so many `jobs`.
        shard: every n-th world from the i-th on.
        track: None: that of the law.
        arms: worlds with which numbers of arms.

    Raises:
        InputError: no such law, a folder that is in use or holds another result, no cluster.
    """
    law = find_law(name)
    asked = Asked(tuple(suite(law, count, track, arms)[shard[0] - 1 :: shard[1]]), (law.name,))
    contents = Contents(NO_TEXTS, versions(), {"suite": DIGEST, "law": law.name, "source of the law": law.source})
    with RowFile(out / ROWS, Plan(contents.made_of, (asked,))) as file:
        there, _ = fill(file, law.label, asked.tasks(), contents, engine, jobs)
        rows = file.rows()
    bad = sum(row["outcome"] != "ok" for row in rows)
    content = {
        "suite": SUITE,
        "suite_digest": DIGEST,
        "law": law.name,
        "label": law.label,
        "source": law.source,
        "oracle": law.oracle,
        "several": law.several,
        "worlds": len(rows),
        "worlds_of_suite": sum(count for n, count in COUNTS.items() if n == 1 or law.several),
        "rows": digest_of(rows),
        "versions": dict(versions()),
    }
    (out / "result.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    return f"{law.label}: {len(rows)} worlds, {bad} not ok, {there} were there already; {out}"


def read_result(folder: Path) -> LawRows:
    """Read a folder that `run_law` made.

    Raises:
        InputError: it holds no result, or one of another suite.
    """
    try:
        content = json.loads((folder / "result.json").read_text(encoding="utf-8"))
        rows = tuple(read_rows(folder / ROWS))
        law, label, source, found = (str(content[name]) for name in ("law", "label", "source", "rows"))
        result = LawRows(law, label, source, bool(content["oracle"]), found, rows)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"folder {folder}", got=f"{type(error).__name__}: {error}", expected="a result of slip-vic benchmark run"
        ) from None
    if content["suite_digest"] != DIGEST:
        raise InputError(f"folder {folder}", got=f"suite {content['suite_digest']}", expected=f"{SUITE} {DIGEST}")
    return result


def verify_result(folder: Path) -> tuple[int, list[str]]:
    """Run ten worlds, drawn by the digest of the rows, again; return how many, and one line on each that differs.

    Raises:
        InputError: the folder holds no result, or its law is not here or has another source.
    """
    result = read_result(folder)
    law = find_law(result.name)
    if law.source != result.source:
        raise InputError(f"law {result.name}", got=f"source {law.source}", expected=f"{result.source}, as in {folder}")
    prepare()
    found = digest_of(result.rows)
    wrong = [] if result.digest == found else [f"rows have the digest {found}, result.json has {result.digest}"]
    drawn = np.random.default_rng(int(found, 16)).permutation(len(result.rows))[:SAMPLE]
    known = {Task(world, law.name).key: world for track in get_args(Track) if track for world in suite(law, 300, track)}
    for row in (result.rows[k] for k in sorted(drawn)):
        world = known.get(key_of(row))
        name = f"{row['arms']} arms, world {row['world']}"
        if world is None:
            wrong.append(f"{name}: no such world in {SUITE}")
            continue
        again = run(world, law.name)
        differ = {"outcome": again.outcome} | {metric: repr(float(again.metrics[metric])) for metric in RANKED}
        lines = [
            f"{name}: {what} is {now}, the result has {row[what]}" for what, now in differ.items() if now != row[what]
        ]
        wrong += lines[:1]
    return len(drawn), wrong


def cost(results: Sequence[Result]) -> tuple[int, float, float]:
    """Return what a value is judged by, the first number first: lost, mean log of slip over 1 mm, mean squeeze [N].

    Where the object does not arrive counts as half a loss.
    """
    lost = sum(2 if one.outcome in LOST else math.isnan(one.metrics["arrival_s"]) for one in results)
    slips = [one.metrics["slip_path_m"] for one in results if math.isfinite(one.metrics["slip_path_m"])]
    squeezes = [one.metrics["squeeze_mean_n"] for one in results if math.isfinite(one.metrics["squeeze_mean_n"])]
    slip = float(np.mean(np.log1p(1e3 * np.array(slips)))) if slips else math.inf
    return lost, slip, float(np.mean(squeezes)) if squeezes else math.inf


def tried(law: str, attribute: str, values: Sequence[float], count: int) -> Iterator[str]:
    """Yield a line for each value of a number of a law in worlds that are not in the suite, and one on the best.

    Raises:
        InputError: no such law, or it has no such number.
    """
    costs = {}
    prepare()
    for value in values:
        name = f"{law}?{attribute}={value:g}"
        chosen = suite(find_law(name), count, arms=(1,), name=TUNING)
        costs[value] = cost([run(world, name) for world in chosen])
        lost, slip, squeeze = costs[value]
        yield f"{name}: {lost / 2:g} lost, log slip {slip:.3f}, mean squeeze {squeeze:.2f} N"
    yield f"best: {attribute}={min(costs, key=lambda value: costs[value]):g}"
