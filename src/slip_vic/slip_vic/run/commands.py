"""The commands that start bridge, controller and recorder as processes, with the files that they read."""

from __future__ import annotations

import json
from pathlib import Path

from slip_core.arms import prefix_of
from slip_core.errors import InputError
from slip_core.files.resources import read_text
from slip_core.params import ParameterModel
from slip_core.topics import EVENTS, TOPICS
from slip_vic.run.processes import python_module
from slip_vic.run.versions import git_revision, versions
from slip_vic.scenarios.scenario import NODES, Scenario, ros_parameter_file
from slip_vic_controller.params.controller_params import ControllerParams


def recorded_topics(scenario: Scenario) -> list[str]:
    """Return the topics that processes of this scenario may publish; those without a publisher stay out of a bag."""
    rows = [row for row in TOPICS.values() if row.publisher != "user" and (scenario.several or not row.several)]
    names = (row.name if row.common else prefix_of(arm) + row.name for row in rows for arm in scenario.controllers)
    return [*dict.fromkeys(names), EVENTS]


def recorder_command(scenario: Scenario, bag: Path, folder: Path, namespace: str) -> list[str]:
    """Return the command of the recorder process; attachments are written into `folder` first."""
    attachments = {f"{name or 'arm'}.urdf": urdf for name, urdf in scenario.placed.items()}
    attachments["scenario.yaml"] = scenario.text
    for key, params in (("controller", scenario.controller), ("bridge", scenario.bridge)):
        attachments[f"{key}.params.yaml"] = ros_parameter_file(params, NODES[key][0])
    arguments = ["record", "--out", str(bag), *recorded_topics(scenario)]
    for name, text in attachments.items():
        path = folder / f"attachment.{name}"
        path.write_text(text, encoding="utf-8")
        arguments += ["--attach", name, str(path)]
    custom = {
        "scenario": scenario.name,
        "law": scenario.law,
        "seed": str(scenario.seed),
        "versions": json.dumps(dict(versions())),
        "git_revision": git_revision(),
    }
    for key, value in custom.items():
        arguments += ["--custom-data", key, value]
    if namespace:
        arguments += ["--namespace", namespace]
    return python_module("slip_bags.cli", *arguments)


def node_command(name: str, params: ParameterModel, folder: Path, *words: str) -> list[str]:
    """Return the command of a node whose parameter file is written into `folder`; words: further ROS arguments."""
    node, path = NODES[name][0], folder / f"{name}.yaml"
    path.write_text(ros_parameter_file(params, node), encoding="utf-8")
    return python_module(f"{node}.main", "--ros-args", "--params-file", str(path), *words)


def native_command(exported: Path, params: ControllerParams, *words: str) -> list[str]:
    """Return the command of the controller node of a `slip-vic export`; words: further ROS arguments.

    Raises:
        InputError: it is not built, or was built for other parameters.
    """
    node, own = exported / "build" / "slip_vic_node", params.model_copy(update={"expected_subscribers": 1})
    if not node.exists():
        expected = "the node of an export"
        raise InputError(f"{node}", got="no such file", expected=expected, fix="cmake, see docs/native.md")
    given = read_text(f"{exported}/controller.yaml", f"parameters of {exported}")
    if given != ros_parameter_file(own, NODES["controller"][0]):
        fix = "export it with the same options"
        raise InputError(f"{exported}", got="other parameters", expected="those of the controller in this run", fix=fix)
    subscribers = f"expected_subscribers:={params.expected_subscribers}"
    return [str(node.resolve()), str(exported), "--ros-args", "-p", subscribers, *words]
