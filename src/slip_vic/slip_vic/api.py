"""What is called first from Python: a scenario by its name, a recorded bag as tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

    from slip_vic.scenarios.scenario import Law, Mode, Scenario


def load(
    name_or_file: str | Path,
    *,
    law: Law = "governed",
    sensor: str | Path = "",
    drive: str | Path = "",
    gripper: str | Path = "",
    seed: int = 0,
    mode: Mode = "lockstep",
    set: Sequence[str] | Mapping[str, Any] = (),
    urdf: str | Path | None = None,
    parameters: Mapping[str, Any] | Path | None = None,
) -> Scenario:
    """Return a scenario, ready to run.

        scenario = slip_vic.load("paper_planar", law="vic", sensor="vision_60", set=["object.mass=0.6"])
        scenario.bridge.grip.force          # the parameters of both sides
        scenario.controller.gains.k_s
        run = scenario.run()

    Args:
        name_or_file: see `scenario_names()`, or a YAML file.
        law: classical, vic, governed or governed_follow.
        sensor: slip sensor, see `preset_names("sensors")`, or a YAML file; empty: the scenario's own.
        drive: the arm's drives and encoders, see `preset_names("drives")`, or a YAML file; empty: ideal.
        gripper: see `preset_names("grippers")`, or a YAML file; empty: ideal.
        seed: of the sensors' noise.
        mode: lockstep, or realtime for nodes.
        set: overrides, as on the command line or as a mapping: ["object.mass=0.6"], {"controller.gains.k_s": 500}.
        urdf: another arm.
        parameters: of the controller: by dotted name, or a parameter file, e.g. of `slip-vic tune`.

    Raises:
        InputError: an unknown name (the nearest are offered), a bad value, a file that cannot be read.
    """
    from slip_vic.scenarios.scenario import load_scenario

    return load_scenario(
        str(name_or_file), law=law, mode=mode, seed=seed, sensor=str(sensor), drive=str(drive), gripper=str(gripper),
        assignments=set, urdf=urdf, parameters=parameters,
    )  # fmt: skip


def read_bag(path: str | Path, topic: str | None = None) -> pd.DataFrame:
    """Return a topic of a bag as a table, one row per message; without a topic, the table of its topics.

        slip_vic.read_bag("bags/paper_planar_vic")
        slip_vic.read_bag("bags/paper_planar_vic", "/joint_states")

    Raises:
        InputError: no bag, a damaged one, or no such topic (the nearest are offered).
    """
    import pandas as pd

    from slip_bags.frame import dataframe
    from slip_bags.reader import Bag

    with Bag(Path(path)) as bag:
        if topic is None:
            rows = [(name, info.type_name, info.message_count) for name, info in bag.topics.items()]
            return pd.DataFrame(rows, columns=["topic", "type", "messages"])
        return dataframe(bag, topic)
