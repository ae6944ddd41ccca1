"""The plots of the page: which series of a run stand in which plot, under what title and unit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from slip_bringup.web.packing import Packer
from slip_bringup.web.runs import MODES, Arm, Run
from slip_core.arrays import Array


@dataclass(frozen=True, slots=True)
class Plot:
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
    Plot("error_mm", "tracking error", "mm"),
    Plot("error_deg", "tracking error, angle", "deg"),
    Plot("stiffness", "stiffness, softest axis", "N/m"),
    Plot("stiffness_turning", "stiffness, softest rotation", "N m/rad"),
    Plot("gate", "gate", "", note="tanh(alpha |v_s|): 0 = sticks, 1 = the law gives way to the object"),
    Plot("mode", "mode", "", steps=MODES),
)
EFFORT: Final = "effort"


def describe_plots(runs: Sequence[Run], packer: Packer) -> list[dict[str, Any]]:
    """Return the plots that have anything to show, as the page's script reads them.

    A plot: name, title, unit, mark, steps, note, variants; a variant: label, unit and one series per arm with the
    number of its run and arm.
    """
    arms = [(number, place, arm) for number, run in enumerate(runs) for place, arm in enumerate(run.arms)]
    described = []
    for plot in PLOTS:
        rows = [(number, place, arm.values[plot.name]) for number, place, arm in arms if plot.name in arm.values]
        if any(np.isfinite(values).any() for _, _, values in rows):
            described.append(_described(plot, [_variant("", plot.unit, rows, packer)]))
    if any(np.isfinite(arm.efforts).any() for _, _, arm in arms):
        share = _variant("most loaded joint", "% of limit", [(n, p, _share(arm)) for n, p, arm in arms], packer)
        joints = [
            _variant(
                arms[0][2].joint_names[joint], "N m", [(n, p, arm.efforts[:, joint]) for n, p, arm in arms], packer
            )
            for joint in range(min(arm.efforts.shape[1] for _, _, arm in arms))
        ]
        described.insert(-1, _described(Plot(EFFORT, "joint effort", ""), [share, *joints]))
    return described


def _described(plot: Plot, variants: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        "name": plot.name,
        "title": plot.title,
        "mark": plot.mark,
        "steps": list(plot.steps),
        "note": plot.note,
        "variants": variants,
    }


def _variant(label: str, unit: str, rows: Sequence[tuple[int, int, Array]], packer: Packer) -> dict[str, Any]:
    series = [{"run": number, "arm": place, "values": packer.add(values)} for number, place, values in rows]
    return {"label": label, "unit": unit, "series": series}


def _share(arm: Arm) -> Array:
    limits = np.array([limit or np.inf for limit in arm.effort_limits])
    return np.max(100.0 * np.abs(arm.efforts) / limits, axis=1)
