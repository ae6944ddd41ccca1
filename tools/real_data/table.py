"""The small table of all runs that the project keeps, so that nothing but its making needs the raw files."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import NamedTuple

import numpy as np

from slip_core.arrays import Array
from slip_core.errors import InputError
from tools.real_data.runs import PadMotion, read_fields, read_object_motion, read_pad_motion, shear

DATA = Path(__file__).parents[2] / "docs" / "data"
TABLE = DATA / "real_runs.csv"
HEAD = """\
# Made by `python tools/real_runs.py table` from github.com/imanlab/proactive-slip-control, commit 73c84b0 (2022-09-13),
# MIT License, Copyright (c) 2022 Intelligent Manipulation Lab; Nazari, Mandil, Ghalamzan, CoRL 2022, arXiv 2209.06019.
# time [s], position [m] and acceleration [m/s^2] of the pads along the path; rotation [deg], ahead and down [mm] of the
# marker on the object relative to the hand, empty where it was not seen; shear of the skin [counts].
"""
NAMES = (
    "run", "time", "position", "acceleration", "rotation_deg", "ahead_mm", "down_mm",
    "shear_ahead", "shear_down", "shear_twist", "normal",
)  # fmt: skip
PLACES = (3, 5, 4, 3, 3, 3, 1, 1, 1, 1)


class Run(NamedTuple):
    """One run of the table; each array (n,)."""

    name: str
    time: Array  # s
    position: Array  # m
    acceleration: Array  # m/s^2
    rotation: Array  # deg, NaN where the marker was not seen; so the next two
    ahead: Array  # mm
    down: Array  # mm
    shear_ahead: Array  # counts
    shear_down: Array  # counts
    shear_twist: Array  # counts
    normal: Array  # counts

    @property
    def seen(self) -> Array:
        """Where the marker was seen; (n,) bool."""
        return np.isfinite(self.rotation)

    @property
    def kept(self) -> bool:
        """Whether the marker was seen to the end, so that the object was kept."""
        return bool(self.seen[-10:].any())

    def pads(self) -> PadMotion:
        """Return the motion of the pads."""
        return PadMotion(self.time, self.position, np.gradient(self.position, self.time), self.acceleration)


def make_table(raw: Path, out: Path) -> int:
    """Write the table of all runs below a folder; return how many.

    Raises:
        InputError: there is none.
    """
    folders = sorted(path.parent for path in raw.glob("*/robot_state.csv"))
    if not folders:
        raise InputError(f"folder {raw}", got="no */robot_state.csv", expected="the runs of the data set")
    out.parent.mkdir(parents=True, exist_ok=True)
    with out.open("w", newline="", encoding="utf-8") as file:
        file.write(HEAD)
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(NAMES)
        for folder in folders:
            pads, thing, load = read_pad_motion(folder), read_object_motion(folder), shear(read_fields(folder))
            numbers = (
                pads.time, pads.position, pads.acceleration,
                np.rad2deg(thing.rotation), 1e3 * thing.ahead, 1e3 * thing.down,
                load.ahead, load.down, load.twist, load.normal,
            )  # fmt: skip
            for row in zip(*numbers, strict=True):
                texts = (f"{n:.{d}f}" if np.isfinite(n) else "" for n, d in zip(row, PLACES, strict=True))
                writer.writerow([folder.name.removeprefix("data_sample_"), *texts])
    return len(folders)


def read_table(path: Path = TABLE) -> list[Run]:
    """Return the runs of a table, in its order."""
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    runs = []
    for name in dict.fromkeys(row["run"] for row in rows):
        own = [row for row in rows if row["run"] == name]
        runs.append(Run(name, *(np.array([float(row[c] or "nan") for row in own]) for c in NAMES[1:])))
    return runs
