"""The frozen worlds, and the rows of the code that they were frozen with."""

from __future__ import annotations

import csv
import gzip
import json
from pathlib import Path
from typing import Final

from slip_vic.experiments.run import Row
from slip_vic.experiments.world import World

FOLDER: Final = Path(__file__).parents[2] / "frozen"
WORLDS, ROWS = FOLDER / "worlds.jsonl.gz", FOLDER / "rows.csv.gz"


def worlds_of(prefix: str = "") -> list[World]:
    """Return the worlds of the sets whose names begin so."""
    with gzip.open(WORLDS, "rt", encoding="utf-8") as file:
        worlds = [World(**row | {"settings": tuple(row["settings"])}) for row in map(json.loads, file)]
    return [world for world in worlds if world.set.startswith(prefix)]


def base_rows() -> list[Row]:
    """Return the rows of the code that the worlds were frozen with."""
    with gzip.open(ROWS, "rt", newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))
