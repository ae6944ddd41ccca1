"""The public names of `slip_vic`, and a recorded bag as tables."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from slip_bags.reader import Bag
from slip_core.errors import InputError
from slip_vic.experiments.law import Effort, Law, Pad, Seen, Setup
from slip_vic.presets import preset_names
from slip_vic.run.in_process import Tick
from slip_vic.run.run import Run
from slip_vic.scenarios import scenario_names
from slip_vic.scenarios.scenario import Scenario, load

__all__ = [
    "Effort",
    "InputError",
    "Law",
    "Pad",
    "Run",
    "Scenario",
    "Seen",
    "Setup",
    "Tick",
    "load",
    "preset_names",
    "read_bag",
    "scenario_names",
]


def read_bag(path: str | Path, topic: str | None = None) -> pd.DataFrame:
    """Return a topic of a bag as a table, one row per message; without a topic, the table of its topics.

        slip_vic.read_bag("bags/paper_planar_vic")
        slip_vic.read_bag("bags/paper_planar_vic", "/joint_states")

    Raises:
        InputError: no bag, a damaged one, or no such topic (the nearest are suggested).
    """
    bag = Bag(Path(path))
    if topic is None:
        rows = [(name, info.type_name, info.message_count) for name, info in bag.topics.items()]
        return pd.DataFrame(rows, columns=["topic", "type", "messages"])
    return bag.series(topic).dataframe()
