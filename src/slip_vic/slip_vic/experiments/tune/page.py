"""The page about a search: what less slip costs, and what is left of it on seeds that the search did not see."""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatter

from slip_vic.document import document, drawn, table
from slip_vic.experiments.rows import Row
from slip_vic.experiments.tune.search import Search, Trial
from slip_vic.experiments.tune.space import slip_of

DEFAULT, TUNED, OTHER, BEYOND = "#c44e52", "#1f6fb2", "#6e6e6e", "#b0b0b0"


@dataclass(frozen=True, slots=True)
class Found:
    """What a search gave. trials: all; best: the chosen one; rows of the default and of the best on unseen seeds."""

    trials: Sequence[Trial]
    best: Trial
    unseen_default: Sequence[Row]
    unseen_best: Sequence[Row]


def worst_mm(rows: Sequence[Row]) -> float:
    """Return the worst slip of some runs [mm], turning included; infinite where one is not ok."""
    return max(1e3 * slip_of(row) if row["outcome"] == "ok" else float("inf") for row in rows)


def page(search: Search, found: Found, title: str, command: str) -> str:
    """Return the page as HTML; it needs nothing else."""
    default, best = found.trials[0], found.best
    scores = [
        [name, number(a), number(b)]
        for name, a, b in (
            ("worst slip [mm]", 1e3 * default.score.slip, 1e3 * best.score.slip),
            ("effort rate, rms, worst [N m/s]", default.score.effort_rate, best.score.effort_rate),
            ("latest arrival [s]", default.score.arrival, best.score.arrival),
            ("runs not ok", default.score.failed, best.score.failed),
            ("worst slip on unseen seeds [mm]", worst_mm(found.unseen_default), worst_mm(found.unseen_best)),
        )
    ]
    parameters = [
        [one.name, number(one.default), number(best.values[one.name]), f"{number(one.low)} to {number(one.high)}"]
        for one in search.space
    ]
    unseen = []
    for mismatch in dict.fromkeys(world.mismatch for world in search.worlds):
        pair = [
            [row for row in rows if row["mismatch"] == mismatch] for rows in (found.unseen_default, found.unseen_best)
        ]
        unseen.append([mismatch, *(number(worst_mm(rows)) for rows in pair), str(len(pair[0]))])
    bounds = search.bounds
    return document(
        title,
        f"<p>Trial {best.number} of {len(found.trials)}. Slip is that of the pad on the object at the end of a run, "
        "turning counted with 30 mm a radian; the worst of all cases counts. Allowed in each world: "
        f"{bounds.effort_rate:g} times the default's worst effort rate, and {bounds.later_s:g} s later arrival.</p>",
        table(("", "default", "tuned"), scores),
        _trade_off(found),
        "<h2>Parameters of the controller</h2>",
        table(("", "default", "tuned", "searched"), parameters),
        "<h2>Seeds that the search did not see</h2>",
        "<p>Worst slip [mm].</p>",
        table(("mismatch", "default", "tuned", "runs each"), unseen),
        "<h2>Made by</h2>",
        f"<pre>{html.escape(command)}</pre>",
    )


def number(value: float) -> str:
    """Return a number in words that fit a table."""
    return f"{value:.4g}"


def _trade_off(found: Found) -> str:
    """Return slip over effort rate, and the best cost so far, as SVG."""
    figure = Figure(figsize=(11.0, 4.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    default, best = found.trials[0], found.best
    for label, colour, marker, members in (
        ("beyond the bounds", BEYOND, "x", [t for t in found.trials if t.score.excess > 0.0]),
        ("within", OTHER, "o", [t for t in found.trials if t.score.excess == 0.0]),
        ("default", DEFAULT, "s", [default]),
        (f"tuned (trial {best.number})", TUNED, "D", [best]),
    ):
        x, y = [t.score.effort_rate for t in members], [1e3 * t.score.slip for t in members]
        left.scatter(x, y, c=colour, marker=marker, label=label)
    left.set(xlabel="effort rate, rms, worst case [N m/s]", ylabel="worst slip [mm]", xscale="log", yscale="log")
    left.legend()
    costs = [trial.cost for trial in found.trials]
    right.plot(costs, ".", color=OTHER, label="each trial")
    right.step(
        range(len(costs)), [min(costs[: k + 1]) for k in range(len(costs))], where="post", color=TUNED, label="best"
    )
    right.set(xlabel="trial", ylabel="cost [mm]", yscale="log")
    right.legend()
    for axis in (left, right):
        axis.grid(alpha=0.3)
    for one in (left.xaxis, left.yaxis, right.yaxis):  # 6, not 6 x 10^0
        one.set_major_formatter(LogFormatter())
        one.set_minor_formatter(LogFormatter(minor_thresholds=(1.5, 0.5)))
    return drawn(figure)
