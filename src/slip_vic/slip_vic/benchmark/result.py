"""The result of a law: a folder with its rows as they come, and what they are of as JSON."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, get_args

import numpy as np

from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_vic.benchmark.law import FoundLaw, find_law
from slip_vic.benchmark.suite import (
    COUNTS,
    DIGEST,
    LAYOUT,
    METRICS,
    SUITE,
    TIMED,
    Grip,
    World,
    run_world,
    suite,
)
from slip_vic.run.prepare import prepare
from slip_vic.run.versions import versions
from slip_vic.study.contents import check_versions
from slip_vic.study.engines import EngineName
from slip_vic.study.runner import fill
from slip_vic.study.table import CaseResult, Row, Settings, StudyTable, read_rows

SAMPLE = 10
"""Worlds that `verify` runs again."""


class Shared(NamedTuple):
    """What all worlds of a run share: the law by its name, and versions of the code by name."""

    law: str
    versions: Mapping[str, str]


def run_on_worker(shared: Shared, world: World) -> CaseResult[World]:
    """Run a world in this process.

    Raises:
        MixedVersions: this worker runs something else than where the benchmark was started.
    """
    check_versions(shared.versions)
    prepare()
    return run_world(shared.law, world)


@dataclass(frozen=True, slots=True)
class Result:
    """Rows of a law, and what they are of.

    name: as on the command line; label: in tables; oracle: not ranked; digest: of the rows as they were written.
    """

    name: str
    label: str
    source: str
    oracle: bool
    digest: str
    rows: tuple[Row, ...]

    def values(self, metric: str, arms: int, worlds: frozenset[str]) -> Array:
        """Return a metric of some worlds; infinite where the law has no number, as where the object was lost."""
        found = [float(row[metric]) for row in self.rows if row["arms"] == str(arms) and row["world"] in worlds]
        return np.where(np.isfinite(found), found, math.inf)


def run_law(
    name: str, count: int, out: Path, engine: EngineName, jobs: int, shard: tuple[int, int] = (1, 1),
    track: Grip | None = None, arms: Sequence[int] = tuple(COUNTS),
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
    wanted = suite(law, count, track, arms=arms)[shard[0] - 1 :: shard[1]]
    prepare()
    settings = Settings((f"law={law.name}",), {"suite": DIGEST, "law": law.source}, versions(), ())
    with StudyTable(out, settings, LAYOUT) as table:
        there, _ = fill(table, law.label, wanted, run_on_worker, Shared(law.name, versions()), engine, jobs)
        rows = table.rows()
        bad = sum(row["outcome"] != "ok" for row in rows)
    _write(out, law, rows)
    return f"{law.label}: {len(rows)} worlds, {bad} not ok, {there} were there already; {out}"


def _write(out: Path, law: FoundLaw, rows: Sequence[Row]) -> None:
    settings = Settings.read(out / "study.json")
    content = {
        "suite": SUITE,
        "suite_digest": settings.digests["suite"],
        "law": settings.assignments[0].removeprefix("law="),
        "label": law.label,
        "source": settings.digests["law"],
        "oracle": law.oracle,
        "several": law.several,
        "worlds": len(rows),
        "worlds_of_suite": sum(count for arms, count in COUNTS.items() if arms == 1 or law.several),
        "rows": digest_of_rows(rows),
        "versions": dict(settings.versions),
    }
    (out / "result.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def digest_of_rows(rows: Sequence[Row]) -> str:
    """Return the digest of rows, without what differs from run to run."""
    kept = [[row[name] for name in LAYOUT.columns if name not in TIMED] for row in rows]
    return hashlib.sha256(json.dumps(kept).encode()).hexdigest()[:16]


def read_result(folder: Path) -> Result:
    """Read a folder that `run_law` made.

    Raises:
        InputError: it holds no result, or one of another suite.
    """
    try:
        content = json.loads((folder / "result.json").read_text(encoding="utf-8"))
        rows = tuple(read_rows(folder / "study.csv", LAYOUT))
        law, label, source, digest = (str(content[name]) for name in ("law", "label", "source", "rows"))
        found = Result(law, label, source, bool(content["oracle"]), digest, rows)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"folder {folder}", got=f"{type(error).__name__}: {error}", expected="a result of slip-vic benchmark run"
        ) from None
    if content["suite_digest"] != DIGEST:
        raise InputError(f"folder {folder}", got=f"suite {content['suite_digest']}", expected=f"{SUITE} {DIGEST}")
    return found


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
    found = digest_of_rows(result.rows)
    wrong = [] if result.digest == found else [f"rows have the digest {found}, result.json has {result.digest}"]
    drawn = np.random.default_rng(int(found, 16)).permutation(len(result.rows))[:SAMPLE]
    most = max((int(row["world"]) for row in result.rows), default=0)
    tracks = [track for track in get_args(Grip) if any(row["track"] == track for row in result.rows)]
    known = {world.key: world for track in tracks for world in suite(law, most, track)}
    for row in (result.rows[k] for k in sorted(drawn)):
        world = known.get(LAYOUT.key_of(row))
        name = f"{row['arms']} arms, world {row['world']}"
        if world is None:
            wrong.append(f"{name}: no such world in {SUITE}")
            continue
        again = run_world(result.name, world)
        differ = [
            metric for metric in METRICS if metric not in TIMED and repr(float(again.metrics[metric])) != row[metric]
        ]
        differ += ["outcome"] if again.outcome != row["outcome"] else []
        for what in differ[:1]:
            value = again.outcome if what == "outcome" else repr(again.metrics[what])
            wrong.append(f"{name}: {what} is {value}, the result has {row[what]}")
    return len(drawn), wrong
