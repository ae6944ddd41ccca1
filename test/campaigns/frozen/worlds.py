"""The frozen worlds and the rows of the code that they were frozen with, in today's names of parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import pandas as pd
import yaml

from slip_vic.experiments.rows import Row
from slip_vic.experiments.world import World, renamed

FOLDER: Final = Path(__file__).parents[2] / "frozen"
WORLDS, ROWS, RENAMED = FOLDER / "worlds.parquet", FOLDER / "rows.parquet", FOLDER / "renamed.yaml"


def frozen_worlds(prefix: str = "") -> list[World]:
    """Return the worlds of the sets whose names begin so."""
    table = yaml.safe_load(RENAMED.read_text(encoding="utf-8")) or {}
    worlds = [World.read(values) for values in pd.read_parquet(WORLDS).to_dict("records")]
    return [
        World.read({**_fields(world), "settings": renamed(world.settings, table)})
        for world in worlds
        if world.set.startswith(prefix)
    ]


def base_rows() -> list[Row]:
    """Return the rows of the code that the worlds were frozen with."""
    return pd.read_parquet(ROWS).astype(str).to_dict("records")


def _fields(world: World) -> dict[str, object]:
    return {name: getattr(world, name) for name in World.__slots__}
