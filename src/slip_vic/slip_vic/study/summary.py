"""Medians, confidence intervals and worst cases of a study, as tables and as a picture."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt  # the backend must be chosen first: no display is needed
import numpy as np
from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from slip_vic.scenarios.scenario import LAWS
from slip_vic.study.cases import ESTIMATORS, NO_ESTIMATOR, NO_MISMATCH
from slip_vic.study.table import Row

CONFIDENCE = 0.95
RESAMPLES = 2000
COLOURS = {
    "classical": "#c44e52", "vic measured": "#dd8452", "vic observer": "#1f6fb2", "governed observer": "#55a868"
}  # fmt: skip
OTHERS = ("#8172b3", "#937860", "#da8bc3", "#8c8c8c", "#ccb974", "#64b5cd")
SHOWN = (
    ("slip_linear_m", 1e3, "slip [mm]"),
    ("tracking_rms_m", 1e3, "tracking rms [mm]"),
    ("attitude_excursion_rad", 1.0, "attitude [rad]"),
)


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
    """Yield a table for each scenario: median and worst case of each mismatch, sensor and law, in 80 columns."""
    scenarios: dict[str, list[Row]] = {}
    for row in rows:
        scenarios.setdefault(row["scenario"], []).append(row)
    for scenario, members in scenarios.items():
        keys = [key for key in ("mismatch", "sensor") if len({row[key] for row in members}) > 1]
        alone = len({row["law"] for row in members}) == len({label_of(row) for row in members})
        groups: dict[tuple[str, ...], list[Row]] = {}
        for row in members:
            law = row["law"] if alone else label_of(row)
            groups.setdefault((*(row[key] for key in keys), law), []).append(row)
        table = Table(title=f"{scenario}: median / worst of each row's runs", box=SIMPLE_HEAD)
        for name in (*keys, "law", "ok"):
            table.add_column(name, no_wrap=True)
        for _, _, label in SHOWN:
            table.add_column(escape(label), justify="right")
        for key, group in groups.items():
            kept = sum(row["outcome"] == "ok" for row in group)
            spreads = [spread([scale * value for value in numbers(group, metric)]) for metric, scale, _ in SHOWN]
            cells = [f"{short(s.median)} / {short(s.worst)}" for s in spreads]
            table.add_row(*key, f"{kept}/{len(group)}", *cells)
        yield table


def short(value: float) -> str:
    """Return a number as the tables have it."""
    return f"{value:.0f}" if abs(value) >= 100.0 else f"{value:.2f}"


def write_picture(path: Path, rows: Sequence[Row]) -> None:
    """Write slip, tracking and attitude per sensor and law: bars are medians, lines intervals, dots worst."""
    sides = [("no mismatch", [row for row in rows if row["mismatch"] == NO_MISMATCH])]
    wrong = [row for row in rows if row["mismatch"] != NO_MISMATCH]
    if wrong:
        sides.append(("every mismatch", wrong))
    sensors = list(dict.fromkeys(row["sensor"] for row in rows))
    there = {label_of(row) for row in rows}
    labels = [label for label in ORDER if label in there]
    figure, axes = plt.subplots(
        len(SHOWN), len(sides), figsize=(4.0 + 1.4 * len(sensors) * len(sides), 11.0), squeeze=False,
        constrained_layout=True,
    )  # fmt: skip
    for column, (title, members) in enumerate(sides):
        own: defaultdict[tuple[str, str], list[Row]] = defaultdict(list)
        for row in members:
            own[row["sensor"], label_of(row)].append(row)
        for line, (metric, scale, title_of) in enumerate(SHOWN):
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


def label_of(row: Row) -> str:
    """Return what a row is drawn as: its law, and the estimator where it has one."""
    return row["law"] if row["estimator"] == NO_ESTIMATOR else f"{row['law']} {row['estimator']}"


ORDER = [
    law if estimator == NO_ESTIMATOR else f"{law} {estimator}"
    for law in LAWS
    for estimator in (NO_ESTIMATOR, *ESTIMATORS)
]
