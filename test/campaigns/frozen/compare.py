"""Rows of this checkout against those of the frozen judge, in equal worlds."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import pandas as pd
from scipy.stats import binomtest

from slip_vic.experiments.run import CARRIED, Row, kind_of
from slip_vic.experiments.run import KINDS as ALL_KINDS

GREW_M: Final = 3e-4
"""Slip path by which a run counts as grown [m]."""
VIC_M: Final = 8e-3
"""Slip path up to which `vic` may grow on drives with loops, gears or delays of their own [m]."""
VIC_DRIVES: Final = ("ideal", "torque_joint")
"""Drives on which `vic` is judged as the other laws are."""
GROWN_SHARE: Final = 0.05
LATER: Final = 1.05
"""Largest median ratio of arrivals."""
LEVEL: Final = 0.05
"""Level of McNemar's test."""
KINDS: Final = tuple(kind for kind in ALL_KINDS if kind not in CARRIED)
TESTS: Final = {"lost": ("lost",), "lost or short": ("lost", "short"), "not carried": KINDS}
"""Kinds of rows that each of McNemar's tests counts."""
ONE_ARM: Final = "one_arm"


def mcnemar(before_alone: int, after_alone: int) -> float:
    """Return the probability, two-sided, of counts at least as different where both chances are the same.

    Args:
        before_alone, after_alone: worlds in which only the run before, and only that after, has the event.

    Implements: McNemar's test, exact: the binomial test of the discordant pairs with one half.
    """
    pairs = before_alone + after_alone
    return float(binomtest(before_alone, pairs).pvalue) if pairs else 1.0


@dataclass(frozen=True, slots=True)
class Line:
    """One law in one set: how often each kind came before and now, and what changed in equal worlds.

    p: of McNemar's test, by its name in `TESTS`; grown, shrunk, kept: worlds that both keep whose slip path grew or
    shrank too much, of how many. later: median ratio of arrivals in worlds where both arrive, with how many.
    """

    name: str
    law: str
    worlds: int
    before: dict[str, int]
    now: dict[str, int]
    p: dict[str, float]
    grown: int
    shrunk: int
    kept: int
    later: float
    arrived: int

    @property
    def p_grown(self) -> float:
        """McNemar's exact test of worlds that grew against worlds that shrank: the sign test."""
        return mcnemar(self.shrunk, self.grown)

    @property
    def worse(self) -> list[str]:
        """Why it is worse, empty where it is not."""
        found = [
            f"{name}: p {self.p[name]:.2g}"
            for name, kinds in TESTS.items()
            if self.p[name] < LEVEL and sum(self.now[kind] for kind in kinds) > sum(self.before[kind] for kind in kinds)
        ]
        if self.kept and self.grown > GROWN_SHARE * self.kept:
            found.append(f"slip path grew in {self.grown} and shrank in {self.shrunk} of {self.kept}")
        if self.law.startswith("governed") and self.later > LATER:
            found.append(f"arrives {100.0 * (self.later - 1.0):.0f} % later")
        return found


def compare(before: Iterable[Row], now: Iterable[Row]) -> list[Line]:
    """Return a line for each set and law that both have, and for each law in all worlds with one arm."""
    known = {(row["set"], row["world"], row["law"]): row for row in before}
    pairs = [
        (known[key], row) for row in now if (key := (row["set"], row["world"], row["law"])) in known
    ]  # fmt: skip
    sets = sorted({row["set"] for _, row in pairs})
    laws = list(dict.fromkeys(row["law"] for _, row in pairs))
    groups = [(name, [pair for pair in pairs if pair[1]["set"] == name]) for name in sets]
    if sum(name.startswith(ONE_ARM) for name in sets) > 1:
        groups.append((f"{ONE_ARM}, all", [pair for pair in pairs if pair[1]["set"].startswith(ONE_ARM)]))
    lines = []
    for name, members in groups:
        for law in laws:
            own = [pair for pair in members if pair[1]["law"] == law]
            lines += [line_of(name, law, own)] if own else []
    return lines


def line_of(name: str, law: str, pairs: Sequence[tuple[Row, Row]]) -> Line:
    """Return the line of a law; pairs: rows before and now, of equal worlds.

    `vic` is tested for what it loses on `VIC_DRIVES` alone; on others its slip path may grow up to `VIC_M`.
    """
    kinds = [(kind_of(before), kind_of(now)) for before, now in pairs]
    tested = [k for k, (row, _) in enumerate(pairs) if law != "vic" or row["drive"] in VIC_DRIVES]

    def p(among: Sequence[str]) -> float:
        apart = [(kinds[k][0] in among, kinds[k][1] in among) for k in tested]
        return mcnemar(apart.count((True, False)), apart.count((False, True)))

    kept = [pair for pair, kind in zip(pairs, kinds, strict=True) if set(kind) <= set(CARRIED)]
    ratios = [
        float(now["arrival_s"]) / float(before["arrival_s"])
        for before, now in kept
        if float(before["arrival_s"]) > 0.0 and math.isfinite(float(now["arrival_s"]))
    ]
    return Line(
        name, law, len(pairs),
        {kind: sum(before == kind for before, _ in kinds) for kind in KINDS},
        {kind: sum(now == kind for _, now in kinds) for kind in KINDS},
        {test: p(among) for test, among in TESTS.items()},
        sum(_grown(*pair) for pair in kept), sum(_grown(now, before) for before, now in kept), len(kept),
        float(np.median(ratios)) if ratios else math.nan, len(ratios),
    )  # fmt: skip


def _grown(one: Row, other: Row) -> bool:
    """Return whether the slip path of the other row of a world is longer than that of the one by more than counts."""
    shorter, longer = float(one["slip_path_m"]), float(other["slip_path_m"])
    own_drive = other["law"] == "vic" and one["drive"] not in VIC_DRIVES
    return longer > shorter + GREW_M and not (own_drive and longer <= VIC_M)


def judged(lines: Sequence[Line]) -> list[Line]:
    """Return the lines that count: of one arm all sets together, so that chance has one try for each law."""
    together = [line for line in lines if line.name.endswith(", all")]
    return [line for line in lines if not (together and line.name.startswith(ONE_ARM)) or line in together]


def verdict(lines: Sequence[Line]) -> list[str]:
    """Return why this checkout is worse, a sentence for each line; empty where it is not."""
    return [f"{line.law} in {line.name}: {'; '.join(line.worse)}" for line in judged(lines) if line.worse]


def table_of(lines: Sequence[Line]) -> str:
    """Return the table: each count now, in brackets before, with the bounds of its share now."""
    rows = [
        {
            "set": line.name, "law": line.law, "worlds": line.worlds,
            **{kind: _count(line, kind) for kind in KINDS},
            **{f"p {test}": f"{p:.2g}" for test, p in line.p.items()},
            "slip path grew": f"{100.0 * line.grown / line.kept:.1f} % of {line.kept}" if line.kept else "-",
            "shrank": line.shrunk, "p grew": f"{line.p_grown:.2g}",
            "arrival": f"x {line.later:.3f} of {line.arrived}" if line.arrived else "-",
        }
        for line in lines
    ]  # fmt: skip
    title = "frozen worlds: now (before), bounds of 95 % by Clopper and Pearson"
    return f"{title}\n{pd.DataFrame(rows).to_string(index=False)}"


def _count(line: Line, kind: str) -> str:
    bounds = binomtest(line.now[kind], line.worlds).proportion_ci()
    return f"{line.now[kind]} ({line.before[kind]}) {100.0 * bounds.low:.1f} to {100.0 * bounds.high:.1f} %"
