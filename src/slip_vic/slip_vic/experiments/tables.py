"""Rows of an experiment as a table and as a picture: what became of the worlds, and medians in them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt  # the backend must be chosen first: no display is needed
import numpy as np
import pandas as pd
from matplotlib.patches import Patch
from scipy.stats import binomtest

from slip_core.arrays import Array
from slip_core.errors import printable
from slip_vic.experiments.run import CARRIED, KINDS, Row, kind_of

GROUPS: Final = ("scenario", "track", "arms", "drive", "mismatch", "sensor")
"""What a study separates, beside the laws."""
TITLES: Final = ("scenario", "track", "arms")
OF_SETS: Final = TITLES[1:]
"""What separates other sets: each of their worlds is of a kind of its own."""
SHOWN: Final = (
    ("slip_path_m", 1e3, "slip [mm]"), ("arrival_s", 1.0, "arrives [s]"), ("squeeze_peak_n", 1.0, "peak [N]"),
    ("squeeze_mean_n", 1.0, "mean [N]"),
)  # fmt: skip
"""Medians; where an object is not carried, slip and arrival are infinite. The picture has the first two."""
BOUNDS: Final = (("arrival_s", "fastest_s", "x fastest"), ("squeeze_mean_n", "squeeze_least_n", "x least"))
"""Medians of what a suite has a bound of, over that bound."""
QUARTILES: Final = (0.25, 0.5, 0.75)
OUTCOMES: Final = {
    "arrived": "#2a7f62", "late": "#9ccfb8", "short": "#e9c46a", "held": "#8c8c8c", "refused": "#4f4f4f",
    "lost": "#c8553d", "impossible": "#e4e4e4",
}  # fmt: skip
"""What becomes of a world, with its colour in the picture."""
BASE: Final = "classical"
"""Law that others are compared with in equal worlds."""
NOTHING: Final = 1e-6
"""What the table shows as 0."""


def grouped(rows: Sequence[Row]) -> dict[tuple[str, ...], list[Row]]:
    """Return the rows of each line, by what separates it: law last."""
    names = _columns(rows)
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[name] for name in names), []).append(row)
    return groups


def _columns(rows: Sequence[Row]) -> list[str]:
    return [*(GROUPS if all(row["set"] == "study" for row in rows) else OF_SETS), "law"]


def lines_of(rows: Sequence[Row]) -> Iterator[dict[str, str]]:
    """Yield the cells of each line of the table by their column."""
    base = {_world(row): row for row in rows if row["law"] == BASE}
    for key, every in grouped(rows).items():
        group = [row for row in every if kind_of(row) != "impossible"]
        count = [kind_of(row) for row in every].count
        line = dict(zip(_columns(rows), key, strict=True))
        line |= {"carried": f"{count('arrived') + count('late')}/{len(group)}", "lost": _lost(group)}
        line |= {name: str(count(name)) for name in ("short", "late", "held", "refused", "impossible")}
        line |= {label: cell(median(values_of(group, metric) * scale)) for metric, scale, label in SHOWN}
        if all(row["track"] for row in group):
            bounds = {bound: np.array([float(row[bound]) for row in group]) for _, bound, _ in BOUNDS}
            line |= {label: cell(median(values_of(group, name) / bounds[bound])) for name, bound, label in BOUNDS}
        if base:
            pairs = [(kind_of(base[_world(row)]), kind_of(row)) for row in group if _world(row) in base]
            alone = sum(before != "lost" and now == "lost" for before, now in pairs)
            line["lost alone"] = f"{alone}/{len(pairs)}"
        yield line


def _world(row: Row) -> tuple[str, ...]:
    return (row["set"], row["world"], row["scenario"], row["sensor"], row["digest"], row["track"])


def _lost(group: Sequence[Row]) -> str:
    """Return the number of lost runs, of many with the bounds of 95 % of its share by Clopper and Pearson."""
    count, total = [kind_of(row) for row in group].count("lost"), len(group)
    if total < 20:
        return str(count)
    bounds = binomtest(count, total).proportion_ci()
    return f"{count} ({100.0 * bounds.low:.0f}-{100.0 * bounds.high:.0f} %)"


def values_of(rows: Sequence[Row], metric: str) -> Array:
    """Return a metric of some rows; infinite where the object is not carried, or where there is no number."""
    values = np.array([float(row[metric]) for row in rows])
    carried = np.array([kind_of(row) in CARRIED for row in rows])
    return np.where(np.isfinite(values) & (carried | metric.startswith("squeeze")), values, math.inf)


def median(values: Array) -> float:
    """Return the median of numbers some of which are infinite: one of them, the upper of two in the middle."""
    return float(np.quantile(values, 0.5, method="higher"))


def cell(value: float) -> str:
    """Return a number with three digits."""
    return ("0" if abs(value) < NOTHING else f"{value:.3g}") if math.isfinite(value) else "inf"


def tables_of(rows: Sequence[Row]) -> Iterator[str]:
    """Yield a table of each scenario, track and number of arms; lost runs with exact bounds.

    Columns that separate nothing, and outcomes that no run has, are left out.
    """
    lines = pd.DataFrame(lines_of(rows))
    for names, table in lines.groupby([name for name in TITLES if name in lines], sort=False):
        title = ", ".join(filter(None, (*names[:-1], f"arms: {names[-1]}")))
        separates = (table.nunique() > 1) | ~(table.columns.isin(GROUPS) | table.columns.str.endswith("[N]"))
        happens = ~table.columns.isin(KINDS) | (table != "0").any() | (table.columns == "lost")
        shown = table.loc[:, separates & happens].to_string(index=False)
        yield f"{title}; medians, what is not carried counts as infinite\n{shown}"


def write_picture(path: Path, rows: Sequence[Row]) -> None:
    """Write what became of the worlds of each line, and slip and arrival of what was carried: medians and quartiles."""
    groups = grouped(rows)
    differs = [len(set(column)) > 1 for column in zip(*groups, strict=True)]
    figure, (bars, *axes) = plt.subplots(
        1, 3, sharey=True, figsize=(14.0, 2.0 + 0.35 * len(groups)), constrained_layout=True
    )
    for k, group in enumerate(groups.values()):
        left, found = 0, [kind_of(row) for row in group]
        for outcome, colour in OUTCOMES.items():
            bars.barh(k, found.count(outcome), left=left, color=colour)
            left += found.count(outcome)
        for axis, (metric, scale, _) in zip(axes, SHOWN, strict=False):
            values = values_of(group, metric)
            values = scale * values[np.isfinite(values)]
            if len(values):
                low, middle, high = np.quantile(values, QUARTILES)
                axis.errorbar([middle], [k], xerr=[[middle - low], [high - middle]], fmt="o", color="#1f6fb2", ms=5)
    labels = [" ".join(text for text, differ in zip(key, differs, strict=True) if differ) or key[-1] for key in groups]
    bars.set_yticks(range(len(groups)), map(printable, labels), parse_math=False)
    bars.invert_yaxis()
    bars.set(xlabel="runs")
    handles = [Patch(color=colour) for colour in OUTCOMES.values()]
    figure.legend(handles, OUTCOMES, ncols=len(OUTCOMES), loc="outside upper center", frameon=False)
    axes[0].set_xscale("symlog", linthresh=0.1)
    axes[0].set_xlim(left=-0.01)
    for axis, (_, _, label) in zip(axes, SHOWN, strict=False):
        axis.set(xlabel=f"{label}, where carried")
        axis.grid(axis="x", alpha=0.3)
    figure.savefig(path, dpi=80)
    plt.close(figure)
