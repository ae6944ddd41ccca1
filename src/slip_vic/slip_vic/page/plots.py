"""The plots of the page: which series of a run stand in which plot, under what title and unit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from slip_core.arrays import Array
from slip_vic.page.packing import Packer
from slip_vic.page.runs import MODES, series_of
from slip_vic.run.data import RunData


class Plot(NamedTuple):
    """One plot: the series of this name of every arm. `mark` is a level that is drawn; `steps` names whole numbers."""

    name: str
    title: str
    unit: str
    mark: float | None = None
    steps: tuple[str, ...] = ()
    note: str = ""


PLOTS: Final = (
    Plot("slip_mm", "slip displacement", "mm", note="how far the pad has moved on the object"),
    Plot("grip_command", "squeeze", "N", note="as commanded, sum over both pads"),
    Plot("slip_deg", "slip angle", "deg", note="how far the object has turned under the pad"),
    Plot("slip_speed", "slip speed", "mm/s"),
    Plot("load", "load ratio", "", mark=1.0, note="measured load over friction limit; at 1 the pad begins to slip"),
    Plot("internal_n", "internal force", "N", note="two arms: what the pads do to each other along the slip plane"),
    Plot("internal_nm", "internal moment", "N m", note="two arms: what the pads do to each other about their normal"),
    Plot("error_mm", "tracking error", "mm"),
    Plot("error_deg", "tracking error, angle", "deg"),
    Plot("stiffness", "stiffness, softest axis", "N/m"),
    Plot("stiffness_turning", "stiffness, softest rotation", "N m/rad"),
    Plot("gate", "gate", "", note="tanh(alpha |v_s|): 0 = sticks, 1 = the law gives way to the object"),
    Plot("effort", "effort, most loaded joint", "% of limit"),
    Plot("mode", "mode", "", steps=MODES),
)


def plot_series(runs: Sequence[RunData]) -> list[tuple[Plot, list[tuple[int, int, Array]]]]:
    """Return all plots of some runs on the grid, in the order of the page; of each arm its run's and its own number."""
    arms = [(number, place, series_of(arm)) for number, run in enumerate(runs) for place, arm in enumerate(run.arms)]
    shown = [(plot, [(n, place, own[plot.name]) for n, place, own in arms if plot.name in own]) for plot in PLOTS]
    return [(plot, rows) for plot, rows in shown if rows]


def describe_plots(runs: Sequence[RunData], packer: Packer, *, empty: bool = False) -> list[dict[str, Any]]:
    """Return the plots that have anything to show, or all, as the page's script reads them.

    A plot: name, title, unit, mark, steps, note, and one series per arm with the number of its run and arm.
    """
    return [
        {
            **plot._asdict(),
            "series": [{"run": n, "arm": place, "values": packer.add(values)} for n, place, values in rows],
        }
        for plot, rows in plot_series(runs)
        if empty or any(np.isfinite(values).any() for _, _, values in rows)
    ]
