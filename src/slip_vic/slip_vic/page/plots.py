"""The plots of the page: which series of a run stand in which plot, under what title and unit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from slip_core.arrays import Array
from slip_vic.page.packing import Packer
from slip_vic.page.runs import MODES, Arm, Run


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
    Plot("mode", "mode", "", steps=MODES),
)
EFFORT: Final = "effort"


class Variant(NamedTuple):
    """What a plot shows: its label and unit, and per arm the number of run and arm with the values (N,)."""

    label: str
    unit: str
    rows: tuple[tuple[int, int, Array], ...]


def plot_series(runs: Sequence[Run]) -> list[tuple[Plot, list[Variant]]]:
    """Return all plots of some runs with what they show, in the order of the page."""
    arms = [(number, place, arm) for number, run in enumerate(runs) for place, arm in enumerate(run.arms)]
    found = []
    for plot in PLOTS:
        rows = tuple((number, place, arm.values[plot.name]) for number, place, arm in arms if plot.name in arm.values)
        if rows:
            found.append((plot, [Variant("", plot.unit, rows)]))
    share = Variant("most loaded joint", "% of limit", tuple((n, p, _share(arm)) for n, p, arm in arms))
    joints = [
        Variant(arms[0][2].joint_names[joint], "N m", tuple((n, p, arm.efforts[:, joint]) for n, p, arm in arms))
        for joint in range(min(arm.efforts.shape[1] for _, _, arm in arms))
    ]
    found.insert(max(0, len(found) - 1), (Plot(EFFORT, "joint effort", ""), [share, *joints]))
    return found


def describe_plots(runs: Sequence[Run], packer: Packer, *, empty: bool = False) -> list[dict[str, Any]]:
    """Return the plots that have anything to show, or all, as the page's script reads them.

    A plot: name, title, unit, mark, steps, note, variants; a variant: label, unit and one series per arm with the
    number of its run and arm.
    """
    found = []
    for plot, variants in plot_series(runs):
        if empty or any(np.isfinite(values).any() for variant in variants for _, _, values in variant.rows):
            shown = [
                {
                    "label": label,
                    "unit": unit,
                    "series": [{"run": n, "arm": place, "values": packer.add(values)} for n, place, values in rows],
                }
                for label, unit, rows in variants
            ]
            found.append({**plot._asdict(), "variants": shown})
    return found


def _share(arm: Arm) -> Array:
    limits = np.array([limit or np.inf for limit in arm.effort_limits])
    return np.max(100.0 * np.abs(arm.efforts) / limits, axis=1)
