"""Parameter files and reference pages, made from the declarations so that they cannot drift."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from slip_core.errors import InputError
from slip_core.params import ParameterInfo, ParameterModel, flatten, parameter_infos
from slip_core.topics import markdown_table
from slip_vic.scenarios import scenario_names
from slip_vic.scenarios.scenario import NODES, load_scenario, ros_parameter_file

HEAD: Final = """\
# {}: made by `slip-vic params`; edit the scenario, or your own copy.
# What differs from the defaults, which docs/parameters.md lists.
"""


def config_files(scenarios: list[str] | None = None) -> dict[str, str]:
    """Return every file of ``config/``: relative path -> text, for bridge and both controllers of each scenario.

    The variable impedance controller has a second one for real time, which is the one for a real arm.

    Args:
        scenarios: their names; None: all that come with the suite.
    """
    files = {}
    for name in scenarios or scenario_names(1):
        made = {
            f"controller_{kind}": load_scenario(name, law=kind).controller for kind in ("classical", "vic", "governed")
        }
        made["controller_vic_realtime"] = load_scenario(name, mode="realtime").controller
        for file, params in {**made, "bridge": load_scenario(name).bridge}.items():
            node = NODES["bridge" if file == "bridge" else "controller"][0]
            files[f"{Path(name).stem}/{file}.yaml"] = HEAD.format(name) + ros_parameter_file(
                params, node, complete=False
            )
    return files


def check_writable(file: Path) -> None:
    """Check that a file can be written; one that is there stays as it is.

    Raises:
        InputError: it cannot.
    """
    there = file.exists()
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with file.open("a", encoding="utf-8"):
            pass  # that it opens is what is checked
        if not there:
            file.unlink()
    except OSError as error:
        raise InputError(f"output {file}", got=error, expected="a file that can be written") from None


def write_files(folder: Path, files: dict[str, str]) -> None:
    """Write files below `folder`.

    Raises:
        InputError: where the folder cannot be written.
    """
    try:
        for name, text in files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"output folder {folder}", got=error, expected="a folder that can be written") from None


def commented_file(params: ParameterModel, node_name: str, also: Sequence[str] = ()) -> str:
    """Return the ROS parameter file of a node with a comment on every line: what it is, its unit, its range.

    Args:
        params: the values; those that are the defaults are left out.
        node_name: whose file it is.
        also: names of parameters that are written even where they have their defaults.
    """
    values, defaults = flatten(params), flatten(type(params)())
    lines = [f"/**/{node_name}:", "  ros__parameters:"]
    for info in parameter_infos(type(params)):
        value = values[info.name]
        if (value == defaults[info.name] and info.name not in also) or value == []:
            continue
        unit = f" [{info.unit}]" if info.unit else ""
        choices = _range(info) if "one_of" in info.bounds else ""
        said = f"{' '.join(info.description.split())}{unit}{f' ({choices})' if choices else ''}"
        lines.append(f"    # {said}")
        lines.append(f"    {info.name}: {json.dumps(value)}")
    return "\n".join(lines) + "\n"


def parameter_page() -> str:
    """Return docs/parameters.md."""
    parts = [
        "# Parameters\n\nMade by `slip-vic params --reference` from the declarations in the code; a test holds it true."
        "\nA parameter marked *live* can be changed while the node runs; the others are read at start."
    ]
    for node_name, model in NODES.values():
        parts.append(f"## {node_name}\n\n{_table(model)}")
    parts.append(
        "## Several arms\n\nBridge and controller with `arms: [left, right]` have their parameters above for each\n"
        "arm, below `left.` and `right.`; what describes the world, and what one process does for all, is equal in all."
    )
    return "\n\n".join(parts) + "\n"


def topic_page() -> str:
    """Return docs/topics.md."""
    return (
        "# Topics\n\nMade by `slip-vic params --reference` from `slip_core.topics`; a test holds it true.\n"
        "Names are relative: a namespace moves the whole system. Two arms on one object (docs/governor.md) have\n"
        "each of these below `left/` and below `right/`, but for those marked *one*, which are there once for both.\n"
        "Contact 1 and further ones of a multi-contact grasp use `contact_1/wrench`, `contact_1/slip_velocity` and so\n"
        "on. The controller subscribes best effort in real time, so that a sensor driver's best-effort topics match,\n"
        "and reliable in lockstep.\n\n"
        f"{markdown_table()}\n"
    )


def _table(model: type[ParameterModel]) -> str:
    lines = ["| parameter | default | unit | range | live | meaning |", "|---|---|---|---|---|---|"]
    for info in parameter_infos(model):
        default = _shown(info.default)
        cells = (f"`{info.name}`", default, info.unit, _range(info), "live" if info.runtime else "", info.description)
        lines.append(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |")
    return "\n".join(lines)


def _shown(value: object) -> str:
    if isinstance(value, tuple):
        return f"`{list(value)}`"
    return f"`{value}`" if value != "" else "(empty)"


def _range(info: ParameterInfo) -> str:
    if "one_of" in info.bounds:
        return ", ".join(str(choice) for choice in info.bounds["one_of"])
    words = {"gt": ">", "ge": ">=", "lt": "<", "le": "<=", "min_length": "length >=", "max_length": "length <="}
    return ", ".join(f"{words[name]} {value:g}" for name, value in info.bounds.items() if name in words)
