"""Rows of an experiment as tables and as a picture: medians, intervals, worst cases, and laws in equal worlds."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt  # the backend must be chosen first: no display is needed
import numpy as np
from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from slip_vic.experiments.rows import Row
from slip_vic.experiments.run import kind_of
from slip_vic.experiments.statistics import CONFIDENCE, clopper_pearson
from slip_vic.experiments.world import NO_MISMATCH

RESAMPLES: Final = 2000
COLOURS: Final = {"classical": "#c44e52", "vic": "#1f6fb2", "governed": "#55a868"}
OTHERS: Final = ("#dd8452", "#8172b3", "#937860", "#da8bc3", "#8c8c8c", "#ccb974", "#64b5cd")
SHOWN: Final = (("slip_linear_m", 1e3, "slip [mm]"), ("off_goal_m", 1e3, "off the goal [mm]"))
DRAWN: Final = (*SHOWN, ("attitude_excursion_rad", 1.0, "attitude [rad]"))
"""What the picture has."""
BASE: Final = "classical"
"""Law that others are compared with in equal worlds."""
WORSE_M: Final = 5e-4
"""Slip by which a law may exceed `BASE` before it counts as worse."""


class Spread(NamedTuple):
    """Median with its confidence interval, and the worst value."""

    median: float
    low: float
    high: float
    worst: float


def spread(values: Sequence[float]) -> Spread:
    """Return the spread of some values; the interval is a percentile bootstrap of the median, seeded."""
    data = np.asarray(values, dtype=float)
    if data.size == 0:
        return Spread(np.nan, np.nan, np.nan, np.nan)
    rng = np.random.default_rng(0)
    medians = np.median(rng.choice(data, (RESAMPLES, data.size)), axis=1)
    low, high = np.quantile(medians, (0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2))
    return Spread(float(np.median(data)), float(low), float(high), float(data.max()))


def numbers(rows: Sequence[Row], metric: str) -> list[float]:
    """Return a metric of the rows that have it; runs that diverged are counted with what they had reached."""
    return [value for row in rows if np.isfinite(value := float(row[metric]))]


def summary_tables(rows: Sequence[Row]) -> Iterator[Table]:
    """Yield a table for each scenario: what became of each drive, mismatch, sensor and law; of drawn worlds, each law.

    In 80 columns. The share of lost runs has bounds, by Clopper and Pearson, where there are many.
    """
    scenarios: dict[str, list[Row]] = {}
    for row in rows:
        scenarios.setdefault("all scenarios" if _drawn(row) else row["scenario"], []).append(row)
    base = {_world(row): row for row in rows if row["law"] == BASE}
    for scenario, members in scenarios.items():
        keys = [
            key for key in ("drive", "mismatch", "sensor")
            if not _drawn(members[0]) and len({row[key] for row in members}) > 1
        ]  # fmt: skip
        groups: dict[tuple[str, ...], list[Row]] = {}
        for row in members:
            groups.setdefault((*(row[key] for key in keys), row["law"]), []).append(row)
        compared = _drawn(members[0]) and bool(base)
        table = Table(title=f"{scenario}: median / worst of each row's runs", box=SIMPLE_HEAD)
        for name in (*keys, "law", "kept"):
            table.add_column(name, no_wrap=True)
        for label in ("lost", *(label for _, _, label in SHOWN), *([f"worse than {BASE}"] if compared else [])):
            table.add_column(escape(label), justify="right")
        for key, group in groups.items():
            kinds = [kind_of(row) for row in group]
            spreads = [spread([scale * value for value in numbers(group, metric)]) for metric, scale, _ in SHOWN]
            cells = [f"{short(s.median)} / {short(s.worst)}" for s in spreads]
            cells += [_worse(group, base)] if compared else []
            table.add_row(*key, f"{kinds.count('kept')}/{len(group)}", _lost(kinds), *cells)
        yield table


def _drawn(row: Row) -> bool:
    return row["set"].startswith("drawn")


def _world(row: Row) -> tuple[str, ...]:
    return (row["set"], row["world"], row["scenario"], row["sensor"], row["digest"])


def _lost(kinds: Sequence[str]) -> str:
    count, total = kinds.count("lost"), len(kinds)
    low, high = clopper_pearson(count, total)
    return f"{count} ({100.0 * low:.0f}-{100.0 * high:.0f} %)" if total >= 20 else str(count)


def _worse(group: Sequence[Row], base: Mapping[tuple[str, ...], Row]) -> str:
    """Return in how many worlds a law loses what the base keeps, or slips more by WORSE_M."""
    pairs = [(base[_world(row)], row) for row in group if _world(row) in base]
    worse = sum(
        kind_of(before) != "lost"
        and (kind_of(row) == "lost" or float(row["slip_linear_m"]) > float(before["slip_linear_m"]) + WORSE_M)
        for before, row in pairs
    )
    return f"{worse}/{len(pairs)}"


def short(value: float) -> str:
    """Return a number as the tables have it."""
    return "-" if math.isnan(value) else f"{value:.0f}" if abs(value) >= 100.0 else f"{value:.2f}"


def write_picture(path: Path, rows: Sequence[Row]) -> None:
    """Write slip, distance from the goal and attitude per sensor and law.

    Bars are medians, lines their intervals, dots the worst.
    """
    sides = [("no mismatch", [row for row in rows if row["mismatch"] == NO_MISMATCH])]
    wrong = [row for row in rows if row["mismatch"] != NO_MISMATCH]
    if wrong:
        sides.append(("every mismatch", wrong))
    sensors, labels = (list(dict.fromkeys(row[name] for row in rows)) for name in ("sensor", "law"))
    figure, axes = plt.subplots(
        len(DRAWN), len(sides), figsize=(4.0 + 1.4 * len(sensors) * len(sides), 11.0), squeeze=False,
        constrained_layout=True,
    )  # fmt: skip
    for column, (title, members) in enumerate(sides):
        own: defaultdict[tuple[str, str], list[Row]] = defaultdict(list)
        for row in members:
            own[row["sensor"], row["law"]].append(row)
        for line, (metric, scale, title_of) in enumerate(DRAWN):
            axis = axes[line, column]
            for k, label in enumerate(labels):
                spreads = [spread([scale * v for v in numbers(own[sensor, label], metric)]) for sensor in sensors]
                x = np.arange(len(sensors)) + 0.8 * (k - 0.5 * (len(labels) - 1)) / len(labels)
                median = np.array([s.median for s in spreads])
                reach = np.array([[s.median - s.low for s in spreads], [s.high - s.median for s in spreads]])
                colour = COLOURS.get(label) or OTHERS[k % len(OTHERS)]
                axis.bar(x, median, 0.75 / len(labels), yerr=np.abs(reach), color=colour, label=label, capsize=3)
                axis.plot(x, [s.worst for s in spreads], ".", color="black", markersize=5)
            axis.set_yscale("symlog", linthresh=0.1)
            axis.set_ylabel(title_of)
            axis.set_xticks(range(len(sensors)), sensors, rotation=15)
            axis.grid(axis="y", alpha=0.3)
        axes[0, column].set_title(f"{title} (dots: worst case)")
    axes[0, 0].legend()
    figure.savefig(path, dpi=110)
    plt.close(figure)
