"""How bridge and controller are started as processes: parameter file and command."""

from __future__ import annotations

from pathlib import Path

from slip_bringup.processes import python_module
from slip_bringup.scenario import NODES, ros_parameter_file
from slip_core.params import ParameterModel


def node_module(name: str) -> str:
    """Return the module that runs a node; name: a key of `NODES`."""
    return f"{NODES[name][0]}.node"


def parameter_arguments(name: str, params: ParameterModel, folder: Path) -> list[str]:
    """Write a node's parameter file into `folder`; return the ROS arguments that name it."""
    path = folder / f"{name}.yaml"
    path.write_text(ros_parameter_file(params, NODES[name][0]), encoding="utf-8")
    return ["--params-file", str(path)]


def node_command(name: str, params: ParameterModel, folder: Path, *words: str) -> list[str]:
    """Return the command of a node whose parameter file is written into `folder`; words: further ROS arguments."""
    return python_module(node_module(name), "--ros-args", *parameter_arguments(name, params, folder), *words)
