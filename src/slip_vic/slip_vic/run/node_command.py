"""How bridge, controller and recorder are started as processes: parameter files and commands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from slip_core.params import ParameterModel
from slip_vic.run.processes import python_module
from slip_vic.run.recording import recorder_command
from slip_vic.scenarios.scenario import NODES, Law, Mode, Scenario, load_scenario, ros_parameter_file

MODULES: Final = {name: f"{node}.main" for name, (node, _) in NODES.items()}
"""What runs as a process."""


def parameter_arguments(name: str, params: ParameterModel, folder: Path) -> list[str]:
    """Write a node's parameter file into `folder`; return the ROS arguments that name it."""
    return ["--params-file", str(_parameter_file(name, params, folder))]


def node_command(name: str, params: ParameterModel, folder: Path, *words: str) -> list[str]:
    """Return the command of a node whose parameter file is written into `folder`; words: further ROS arguments."""
    return python_module(MODULES[name], "--ros-args", *parameter_arguments(name, params, folder), *words)


def run_parameters(scenario: Scenario, recording: bool) -> tuple[ParameterModel, ParameterModel]:
    """Return the parameters of controller and bridge, each of which waits for the other one and the recorder."""
    counts = {"expected_subscribers": 2 if recording else 1}
    ready = replace(
        scenario,
        controllers={name: params.model_copy(update=counts) for name, params in scenario.controllers.items()},
        bridges={name: params.model_copy(update=counts) for name, params in scenario.bridges.items()},
    )
    return ready.controller, ready.bridge


@dataclass(frozen=True, slots=True)
class LaunchPlan:
    """What a launch file starts: parameter files of the nodes, and the recorder's command.

    bridge: None where a real arm takes its place. recorder: empty where nothing is recorded.
    """

    controller: Path
    bridge: Path | None
    recorder: list[str]


def launch_plan(
    folder: Path,
    *,
    scenario: str,
    law: Law,
    mode: Mode,
    seed: int,
    assignments: Sequence[str],
    urdf: str,
    namespace: str,
    bag: str,
    with_bridge: bool,
) -> LaunchPlan:
    """Write the files of one run into `folder`; the arguments are those of ``slip_vic.launch.py``.

    Raises:
        InputError: as `load_scenario`, or parameters and URDF that do not fit.
    """
    loaded = load_scenario(
        scenario,
        law=law,
        mode=mode,
        seed=seed,
        assignments=assignments,
        urdf_file=Path(urdf) if urdf else None,
    )
    loaded.check()
    controller_params, bridge_params = run_parameters(loaded, recording=bool(bag))
    return LaunchPlan(
        controller=_parameter_file("controller", controller_params, folder),
        bridge=_parameter_file("bridge", bridge_params, folder) if with_bridge else None,
        recorder=recorder_command(loaded, Path(bag), folder, namespace) if bag else [],
    )


def _parameter_file(name: str, params: ParameterModel, folder: Path) -> Path:
    path = folder / f"{name}.yaml"
    path.write_text(ros_parameter_file(params, NODES[name][0]), encoding="utf-8")
    return path
