"""The commands that start bridge, controller and recorder as processes, with the files that they read."""

from __future__ import annotations

import json
from pathlib import Path

from slip_core.errors import InputError
from slip_core.params import ParameterModel
from slip_core.topics import TOPICS
from slip_core.types import INTERFACES
from slip_vic.run.processes import python_module
from slip_vic.run.versions import git_revision, versions
from slip_vic.scenarios.scenario import NODES, Scenario, ros_parameter_file
from slip_vic_controller.params.node_params import ControllerNodeParams

SLIP_TOPICS = {"slip_velocity": "twist", "slip_displacement": "displacement", "slip_flag": "flag"}


def recorded_topics(scenario: Scenario) -> list[tuple[str, str]]:
    """Return (name, type) of every topic that this scenario's processes publish."""
    rows = [row for row in TOPICS.values() if row.publisher != "user"]
    if not scenario.several:
        rows = [row for row in rows if not row.several]
    found = []
    for row in rows:
        for prefix, controller in scenario.arms[:1] if row.common else scenario.arms:
            if row.name not in _absent(controller):
                found.append((row.name if row.common else prefix + row.name, row.type))
    return found


def _absent(controller: ControllerNodeParams) -> set[str]:
    """Return the topics that a controller with these parameters, and its bridge, do not have."""
    absent = {"controller/timing", "bridge/timing"} if controller.mode == "lockstep" else {"lockstep_tick"}
    absent |= SLIP_TOPICS.keys() - {name for name, kind in SLIP_TOPICS.items() if kind == controller.slip_input}
    if controller.trajectory.kind not in ("goal", "topic"):
        absent |= {"controller/goal", "controller/reference_used"}
    if controller.grip.control != "follow":
        absent.add("grip_command")
    others = {*INTERFACES} - {controller.command.interface}
    absent |= {f"{kind}_{name}" for kind in others for name in ("command", "controller/commands")}
    if not controller.estimates_joints:
        absent.add("controller/joint_estimate")
    if not controller.publish_effort_array:
        absent.add("effort_controller/commands")
    return absent


def recorder_command(scenario: Scenario, bag: Path, folder: Path, namespace: str) -> list[str]:
    """Return the command of the recorder process; attachments are written into `folder` first."""
    attachments = {f"{name or 'arm'}.urdf": urdf for name, urdf in scenario.placed.items()}
    attachments["scenario.yaml"] = scenario.text
    for key, params in (("controller", scenario.controller), ("bridge", scenario.bridge)):
        attachments[f"{key}.params.yaml"] = ros_parameter_file(params, NODES[key][0])
    arguments = ["record", "--out", str(bag)]
    arguments += [name for name, _ in recorded_topics(scenario)]
    for name, text in attachments.items():
        path = folder / f"attachment.{name}"
        path.write_text(text, encoding="utf-8")
        arguments += ["--attach", f"{name}={path}"]
    custom = {
        "scenario": scenario.name,
        "law": scenario.law,
        "seed": str(scenario.seed),
        "versions": json.dumps(dict(versions())),
        "git_revision": git_revision(),
    }
    for key, value in custom.items():
        arguments += ["--custom-data", f"{key}={value}"]
    if namespace:
        arguments += ["--namespace", namespace]
    return python_module("slip_bags.cli", *arguments)


def node_command(name: str, params: ParameterModel, folder: Path, *words: str) -> list[str]:
    """Return the command of a node whose parameter file is written into `folder`; words: further ROS arguments."""
    node, path = NODES[name][0], folder / f"{name}.yaml"
    path.write_text(ros_parameter_file(params, node), encoding="utf-8")
    return python_module(f"{node}.main", "--ros-args", "--params-file", str(path), *words)


def native_command(exported: Path, params: ControllerNodeParams, *words: str) -> list[str]:
    """Return the command of the controller node of a `slip-vic export`; words: further ROS arguments.

    Raises:
        InputError: it is not built, or its parameters are others.
    """
    node, own = exported / "build" / "slip_vic_node", params.model_copy(update={"expected_subscribers": 1})
    if not node.exists():
        expected = "the node of an export"
        raise InputError(f"{node}", got="no such file", expected=expected, fix="cmake, see docs/native.md")
    if (exported / "controller.yaml").read_text(encoding="utf-8") != ros_parameter_file(own, NODES["controller"][0]):
        fix = "export it with the same options"
        raise InputError(f"{exported}", got="other parameters", expected="those of the controller in this run", fix=fix)
    subscribers = f"expected_subscribers:={params.expected_subscribers}"
    return [str(node.resolve()), str(exported), "--ros-args", "-p", subscribers, *words]
