"""Results of laws side by side: a table, a picture, and a page that needs nothing else."""

from __future__ import annotations

import base64
import io
import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt  # the backend must be chosen first: no display is needed
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch
from rich.console import Console
from rich.table import Table
from rich.text import Text

from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_vic.document import document, table
from slip_vic.experiments.rows import Row
from slip_vic.experiments.run import LOST, SHORT_M
from slip_vic.experiments.suite import DIGEST, SUITE, LawRows, read_result

SHOWN: Final = (
    ("slip_path_m", 1e3, "slip [mm]"),
    ("slip_path_rad", 180.0 / math.pi, "slip [deg]"),
    ("arrival_s", 1.0, "arrives [s]"),
    ("final_error_m", 1e3, "error [mm]"),
    ("squeeze_peak_n", 1.0, "peak [N]"),
    ("squeeze_mean_n", 1.0, "mean [N]"),
    ("effort_rate_rms_n_m_s", 1.0, "effort rate [N m/s]"),
    ("step_p99_s", 1e3, "step [ms]"),
)
HEAD: Final = ("law", "grip", "arms", "worlds", "carried", "lost", "short", "late", *(label for _, _, label in SHOWN))
NARROW: Final = ("law", "arms", "carried", "lost", "short", "slip [mm]", "arrives [s]", "peak [N]")
"""Of `HEAD`, what a terminal of 80 columns has room for; compare.html has all."""
WIDE: Final = 1000
"""Columns in which any table fits."""
QUARTILES: Final = (0.25, 0.5, 0.75)
NOT_CARRIED: Final = 1e3
ARRIVES_NEVER: Final = 10.0
"""Where the picture has what is not carried [mm], and what is late or not carried [s]; no world lasts so long."""
NEWTONS: Final = (0.5, 1.0, 2.0, 5.0, 10.0)
OUTCOMES: Final = {"arrived": "#2a7f62", "late": "#9ccfb8", "short": "#e9c46a", "lost": "#c8553d"}
"""With the colours of the picture."""
NOTHING: Final = 1e-6
"""What the table shows as 0."""


def compare(folders: Sequence[Path], out: Path) -> tuple[list[list[str]], str]:
    """Write what `write` writes of some results, in worlds that all of them have; return its lines, and where it is.

    Several folders of one law, for instance shards, count as one.

    Raises:
        InputError: a folder holds no result, two of a law differ, or no world is in all of them.
    """
    laws = joined(folders)
    lines = write(laws, out)
    (out / "compare.html").write_text(page(lines, (out / "compare.png").read_bytes()), encoding="utf-8")
    return lines, ", ".join(str(out / f"compare.{suffix}") for suffix in ("html", "png", "json"))


def table_for(console: Console, lines: Sequence[Sequence[str]]) -> Table:
    """Return the table for a terminal: where it is too narrow for all columns, those of `NARROW`."""
    whole = _table(lines, HEAD)
    wide = console.options.update(max_width=WIDE)
    return whole if console.measure(whole, options=wide).maximum <= console.width else _table(lines, NARROW)


def _table(lines: Sequence[Sequence[str]], names: Sequence[str]) -> Table:
    shown = Table(title=f"{SUITE}: medians; what is lost or short counts as infinite")
    for name in names:
        shown.add_column(Text(name), justify="left" if name in ("law", "grip") else "right", no_wrap=name != "law")
    for line in lines:
        cells = dict(zip(HEAD, line, strict=True))
        shown.add_row(*(cells[name] for name in names))
    return shown


def write(laws: Sequence[LawRows], out: Path) -> list[list[str]]:
    """Write compare.png and the table as compare.json; return the table's lines."""
    lines = [line for arms in (1, 2) for line in lines_of(laws, arms)]
    out.mkdir(parents=True, exist_ok=True)
    (out / "compare.png").write_bytes(png(laws))
    content = {"suite": SUITE, "digest": DIGEST, "laws": [dict(zip(HEAD, line, strict=True)) for line in lines]}
    (out / "compare.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    return lines


def joined(folders: Sequence[Path]) -> list[LawRows]:
    """Return the result of each law.

    Raises:
        InputError: see `compare`.
    """
    found: dict[tuple[str, str], LawRows] = {}
    for folder in folders:
        one = read_result(folder)
        track = one.rows[0]["track"] if one.rows else ""
        before = found.get((one.name, track))
        if before is not None and before.source != one.source:
            raise InputError(f"folder {folder}", got=f"{one.label} of source {one.source}", expected=before.source)
        rows = one.rows if before is None else (*before.rows, *one.rows)
        unique = {(row["arms"], row["world"]): row for row in rows}
        found[one.name, track] = replace(one, rows=(*unique.values(),))
    if not any(common(list(found.values()), arms) for arms in (1, 2)):
        raise InputError("folders", got="no world that all of them have", expected="results of the same worlds")
    return list(found.values())


def common(laws: Sequence[LawRows], arms: int) -> frozenset[str]:
    """Return the worlds with so many arms that all laws have; of two arms, all laws that have any."""
    sets = [{row["world"] for row in law.rows if row["arms"] == str(arms)} for law in laws]
    return frozenset.intersection(*(frozenset(one) for one in sets if one)) if any(sets) else frozenset()


def lines_of(laws: Sequence[LawRows], arms: int) -> list[list[str]]:
    """Return a line of the table for each law: the tracks by themselves, in each first what carries most."""
    worlds, lines = common(laws, arms), []
    for law in laws:
        rows = [row for row in law.rows if row["arms"] == str(arms) and row["world"] in worlds]
        if not rows:
            continue
        arrived, late, short, lost = outcomes(rows)
        medians = [median(counted(law, metric, arms, worlds)) * scale for metric, scale, _ in SHOWN]
        name = f"{law.label} (oracle)" if law.oracle else law.label
        counts = map(str, (arms, len(rows), arrived + late, lost, short, late))
        lines.append(
            (
                (rows[0]["track"], law.oracle, lost + short, medians[0]),
                [name, rows[0]["track"], *counts, *map(cell, medians)],
            )
        )
    return [cells for _, cells in sorted(lines, key=lambda line: line[0])]


def counted(law: LawRows, metric: str, arms: int, worlds: frozenset[str]) -> Array:
    """Return a metric of each world; infinite where the object is not carried, but for what does not depend on that."""
    values = law.values(metric, arms, worlds)
    if metric.startswith(("squeeze", "step", "effort")):
        return values
    rows = [row for row in law.rows if row["arms"] == str(arms) and row["world"] in worlds]
    return np.where([not carried(row) for row in rows], math.inf, values)


def outcomes(rows: Sequence[Row]) -> tuple[int, int, int, int]:
    """Return how many rows have each of `OUTCOMES`, in that order."""
    lost, kept = sum(row["outcome"] in LOST for row in rows), [row for row in rows if carried(row)]
    arrived = sum(math.isfinite(float(row["arrival_s"])) for row in kept)
    return arrived, len(kept) - arrived, len(rows) - len(kept) - lost, lost


def carried(row: Row) -> bool:
    """Return whether the object has come with the pad, to `SHORT_M` from the goal."""
    return row["outcome"] not in (*LOST, "stays") and float(row["final_error_m"]) <= SHORT_M


def median(values: Array) -> float:
    """Return the median of numbers some of which are infinite: one of them, the upper of two in the middle."""
    return float(np.quantile(values, 0.5, method="higher"))


def cell(value: float) -> str:
    """Return a number with three digits."""
    return ("0" if abs(value) < NOTHING else f"{value:.3g}") if math.isfinite(value) else "inf"


def png(laws: Sequence[LawRows]) -> bytes:
    """Return what became of the worlds with one arm, slip against squeeze, and slip against arrival.

    A law is its medians, bars are quartiles; laws are drawn a little beside each other where they are the same.
    """
    worlds = common(laws, 1)
    laws = sorted((law for law in laws if worlds), key=lambda law: (law.rows[0]["track"], law.label), reverse=True)
    figure, (bars, *axes) = plt.subplots(1, 3, figsize=(16.0, 4.8), constrained_layout=True)
    for k, law in enumerate(laws):
        _draw_outcomes(bars, k, [row for row in law.rows if row["arms"] == "1" and row["world"] in worlds])
    bars.set_yticks(range(len(laws)), [f"{law.label} ({law.rows[0]['track']})" for law in laws])
    bars.set(xlabel="worlds")
    handles = [Patch(color=colour) for colour in OUTCOMES.values()]
    bars.legend(handles, OUTCOMES, ncols=4, loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False)
    pairs = (("squeeze_peak_n", "peak squeeze [N]", math.inf), ("arrival_s", "arrival [s]", ARRIVES_NEVER))
    for axis, (metric, label, most) in zip(axes, pairs, strict=True):
        for k, law in enumerate(laws):
            beside = k - 0.5 * (len(laws) - 1)
            x = np.fmin(counted(law, metric, 1, worlds), most)
            x = x + 0.07 * beside if metric == "arrival_s" else x * 1.015**beside
            y = np.fmin(1e3 * counted(law, "slip_path_m", 1, worlds), NOT_CARRIED)
            (x1, x2, x3), (y1, y2, y3) = (np.quantile(v, QUARTILES, method="higher") for v in (x, y))
            marker = "s" if law.rows[0]["track"] == "capped" else "o"
            if not math.isfinite(x2 + y2):
                continue  # no world was carried: the bars of outcomes show it
            spread = {"yerr": [[y2 - y1], [y3 - y2]], "xerr": [[x2 - x1], [x3 - x2]]}
            axis.errorbar([x2], [y2], **spread, fmt=marker, color=f"C{k}", label=law.label, lw=0.9, ms=5)
        axis.set(xlabel=label, ylabel="slip of the pad on the object, path [mm]")
        axis.set_yscale("symlog", linthresh=0.1)
        axis.set_yticks([0, 0.1, 1, 10, 100, NOT_CARRIED], ["0", "0.1", "1", "10", "100", "not carried"])
        axis.grid(alpha=0.3)
    axes[0].set_xscale("log")
    axes[0].set_xticks(NEWTONS, [f"{force:g}" for force in NEWTONS])
    axes[0].minorticks_off()
    seconds = np.arange(0.0, ARRIVES_NEVER, 2.0)
    axes[1].set_xticks([*seconds, ARRIVES_NEVER], [*(f"{t:g}" for t in seconds), "never"])
    points, labels = axes[1].get_legend_handles_labels()
    figure.legend(points[::-1], labels[::-1], fontsize="x-small", ncols=5, loc="outside lower right")
    figure.suptitle(f"{SUITE}, {len(worlds)} worlds with one arm; medians and quartiles, squares have capped grip")
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=80)
    plt.close(figure)
    return buffer.getvalue()


def _draw_outcomes(axis: Axes, k: int, rows: Sequence[Row]) -> None:
    """Draw how many rows have each of `OUTCOMES`, as one bar."""
    left = 0
    for count, colour in zip(outcomes(rows), OUTCOMES.values(), strict=True):
        axis.barh(k, count, left=left, color=colour)
        left += count


def page(lines: Sequence[Sequence[str]], picture: bytes) -> str:
    """Return the page as HTML."""
    return document(
        SUITE,
        "<p>Medians over the worlds that all laws have; where the object is lost or left short it counts as infinite, "
        "and where it is late its arrival does. lost: the object, or the law failed. short: more than 20 mm from the "
        "goal at the end. late: nearer, but not to 1 mm and 0.5 degrees. "
        "peak and mean: of the squeeze. Laws with capped grip and with free grip are not ranked together: slip can be "
        "bought by squeeze, and by time.</p>",
        '<p><img alt="slip against squeeze and arrival" src="data:image/png;base64,'
        f'{base64.b64encode(picture).decode()}"></p>',
        table(HEAD, lines),
    )
