"""Runs with two arms as one picture and as tables of numbers."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from slip_vic.pair.measures import COLUMNS

PANELS = (
    ("slip [mm]", 1e3, ("slip_left_m", "slip_right_m")),
    ("internal force [N]", 1.0, ("internal_n",)),
    ("internal moment [N m]", 1.0, ("moment_n_m",)),
    ("load / friction limit", 1.0, ("load_left", "load_right")),
    ("object off its reference [mm]", 1e3, ("path_m",)),
)
STYLES = ("-", "--")


def write_series(folder: Path, title: str, series: Mapping[str, Sequence[tuple[float, ...]]]) -> None:
    """Write pair.png and `<law>.csv` with `COLUMNS`."""
    folder.mkdir(parents=True, exist_ok=True)
    for law, rows in series.items():
        with (folder / f"{law}.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(COLUMNS)
            writer.writerows(rows)
    write_picture(folder / "pair.png", title, series)


def write_picture(path: Path, title: str, series: Mapping[str, Sequence[tuple[float, ...]]]) -> None:
    """Write the picture of some runs; solid lines are the left pad's, broken ones the right pad's."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(len(PANELS), 1, sharex=True, figsize=(9.0, 12.0), layout="constrained")
    for k, (law, rows) in enumerate(series.items()):
        numbers = dict(zip(COLUMNS, np.array(rows).T, strict=True))
        for axis, (label, scale, names) in zip(axes, PANELS, strict=True):
            axis.set_ylabel(label)
            for style, name in zip(STYLES, names, strict=False):
                shown = law if name == names[0] else None
                axis.plot(numbers["time_s"], scale * numbers[name], style, color=f"C{k}", label=shown, linewidth=1.0)
    axes[0].set_title(title)
    axes[0].set_yscale("symlog", linthresh=0.1)
    axes[0].legend(fontsize="small", ncols=3)
    axes[-1].set_xlabel("time [s]")
    figure.savefig(path, dpi=110)
    pyplot.close(figure)
