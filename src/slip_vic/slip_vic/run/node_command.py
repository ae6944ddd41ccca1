"""How bridge and controller are started as processes: parameter file and command."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from slip_core.params import ParameterModel
from slip_msgs_py.realtime import ProcessOptions
from slip_vic.run.processes import python_module
from slip_vic.scenarios.scenario import NODES, ros_parameter_file

NO_OPTIONS: Final = ProcessOptions()


def node_command(
    name: str, params: ParameterModel, folder: Path, *words: str, process: ProcessOptions = NO_OPTIONS
) -> list[str]:
    """Return the command of a node whose parameter file is written into `folder`; words: further ROS arguments.

    process: cores, priority and memory, which are set before the node's module is imported.
    """
    node, path = NODES[name][0], folder / f"{name}.yaml"
    path.write_text(ros_parameter_file(params, node), encoding="utf-8")
    command = [f"{node}.main", "--ros-args", "--params-file", str(path), *words]
    options = process.arguments()
    return python_module("slip_msgs_py.realtime", *options, *command) if options else python_module(*command)
