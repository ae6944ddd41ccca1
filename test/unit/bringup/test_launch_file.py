"""The launch file: what it names exists, and what it starts is what `slip-vic run` starts.

`launch` is not on PyPI, so the file is read as source text; what it computes is in `launch_plan`, which runs here.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import re
from collections.abc import Mapping
from pathlib import Path

import pytest
import yaml

from slip_core.arms import model_of_arms
from slip_core.errors import InputError
from slip_core.params import ParameterModel, build, flatten
from slip_sim_bridge.params import BridgeParams
from slip_vic.run.node_command import LaunchPlan, launch_plan, run_parameters
from slip_vic.run.recording import recorder_command
from slip_vic.scenarios.scenario import NODES, load_scenario
from slip_vic_controller.params.node_params import ControllerNodeParams

SRC = Path(__file__).parents[3] / "src"
FILES = sorted((SRC / "slip_vic" / "launch").glob("*.launch.py"))
ONE_ARM = {name: model for name, (_, model) in NODES.items()}
TWO_ARMS = {
    "controller": model_of_arms(ControllerNodeParams, ("left", "right")),
    "bridge": model_of_arms(BridgeParams, ("left", "right")),
}
# What launch and launch_ros of Jazzy offer (docs.ros.org); look a name up before adding it.
LAUNCH_API = {
    "launch": {"LaunchContext", "LaunchDescription"},
    "launch.actions": {
        "DeclareLaunchArgument", "EmitEvent", "ExecuteProcess", "OpaqueFunction", "RegisterEventHandler", "Shutdown",
    },
    "launch.event_handlers": {"OnProcessExit"},
    "launch.events": {"matches_action"},
    "launch.events.process": {"SignalProcess"},
    "launch.substitutions": {"LaunchConfiguration"},
    "launch_ros.actions": {"Node"},
}  # fmt: skip


def calls(tree: ast.AST, name: str) -> list[ast.Call]:
    return [n for n in ast.walk(tree) if isinstance(n, ast.Call) and isinstance(n.func, ast.Name) and n.func.id == name]


def keywords(call: ast.Call) -> dict[str, ast.expr]:
    return {str(keyword.arg): keyword.value for keyword in call.keywords}


def console_scripts(package: str) -> dict[str, str]:
    text = (SRC / package / "setup.py").read_text()
    return dict(re.findall(r'"([\w-]+) = ([\w.]+:\w+)"', text))


def problems(text: str) -> list[str]:
    """Return what a launch file names that does not exist."""
    tree = ast.parse(text)
    compile(tree, "launch file", "exec")
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and str(node.module).partition(".")[0] in ("launch", "launch_ros"):
            known = LAUNCH_API.get(str(node.module), set())
            found += [f"import {node.module}.{a.name}" for a in node.names if a.name not in known]
        elif isinstance(node, ast.ImportFrom) and str(node.module).startswith("slip_"):
            module = importlib.import_module(str(node.module))
            found += [f"import {node.module}.{a.name}" for a in node.names if not hasattr(module, a.name)]
    for call in calls(tree, "Node"):
        given = keywords(call)
        package, choice = ast.literal_eval(given["package"]), given["executable"]
        branches = [choice.body, choice.orelse] if isinstance(choice, ast.IfExp) else [choice]
        for executable in map(ast.literal_eval, branches):
            if not (SRC / package / "package.xml").is_file():
                found.append(f"package {package}")
            elif executable not in console_scripts(package):
                found.append(f"executable {executable} of {package}")
            else:
                module, _, function = console_scripts(package)[executable].partition(":")
                if f"def {function}" not in Path(SRC / package / (module.replace(".", "/") + ".py")).read_text():
                    found.append(f"function {function} of {module}")
    declared = {ast.literal_eval(call.args[0]) for call in calls(tree, "DeclareLaunchArgument")}
    used = {ast.literal_eval(call.args[0]) for call in calls(tree, "value")}
    found += [f"argument {name}" for name in declared ^ used]
    for call in calls(tree, "launch_plan"):
        wanted = set(inspect.signature(launch_plan).parameters) - {"folder"}
        found += [f"parameter {name} of launch_plan" for name in wanted ^ set(keywords(call))]
    return found


def test_there_is_one_and_it_has_an_entry() -> None:
    assert [path.name for path in FILES] == ["slip_vic.launch.py"]
    tree = ast.parse(FILES[0].read_text())
    assert "generate_launch_description" in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
    assert len(calls(tree, "Node")) == 2
    assert len(calls(tree, "launch_plan")) == 1


def test_it_is_installed() -> None:
    text = (SRC / "slip_vic" / "setup.py").read_text()
    for path in FILES:
        assert f'(f"share/{{NAME}}/launch", ["launch/{path.name}"])' in text


def test_everything_it_names_exists() -> None:
    for path in FILES:
        assert problems(path.read_text()) == []


@pytest.mark.parametrize(
    ("before", "after", "what"),
    [
        ('"slip_sim_bridge_node"', '"slip_bridge"', "executable slip_bridge of slip_sim_bridge"),
        ('package="slip_sim_bridge"', 'package="slip_bridge"', "package slip_bridge"),
        ("import launch_plan", "import launch_plans", "import slip_vic.run.node_command.launch_plans"),
        ("import matches_action", "import matches_node", "import launch.events.matches_node"),
        ('value("prefix")', 'value("prefixes")', "argument prefixes"),
        ("        with_bridge=", "        bridge=", "parameter with_bridge of launch_plan"),
    ],
)
def test_the_check_sees_what_does_not_exist(before: str, after: str, what: str) -> None:
    text = FILES[0].read_text()
    assert before in text
    assert what in problems(text.replace(before, after))


def test_defaults_and_choices_are_those_of_the_scenario() -> None:
    """Every default and every choice goes through, so that no launch fails for a name."""
    tree = ast.parse(FILES[0].read_text())
    arguments = {ast.literal_eval(call.args[0]): keywords(call) for call in calls(tree, "DeclareLaunchArgument")}
    defaults = {name: ast.literal_eval(given["default_value"]) for name, given in arguments.items()}
    assert all(ast.literal_eval(given["description"]) for given in arguments.values())
    for law in ast.literal_eval(arguments["law"]["choices"]):
        for mode in ast.literal_eval(arguments["mode"]["choices"]):
            load_scenario(defaults["scenario"], law=law, mode=mode, seed=int(defaults["seed"]))


def plan(folder: Path, **changes: object) -> LaunchPlan:
    given = {
        "scenario": "glass_transport", "law": "classical", "mode": "lockstep", "seed": 3,
        "assignments": ["object.mass=0.2"], "urdf": "", "namespace": "/left", "bag": str(folder / "bag"),
        "with_bridge": True, **changes,
    }  # fmt: skip
    return launch_plan(folder, **given)  # type: ignore[arg-type]


def read(path: Path, name: str, models: Mapping[str, type[ParameterModel]] = ONE_ARM) -> dict[str, object]:
    node, model = NODES[name][0], models[name]
    return flatten(build(model, yaml.safe_load(path.read_text())[f"/**/{node}"]["ros__parameters"], str(path)))


@pytest.mark.parametrize(
    ("name", "namespace", "models"),
    [("glass_transport", "/left", ONE_ARM), ("pane_two_arms_upright", "", TWO_ARMS)],
)
def test_the_plan_is_that_of_a_run(
    tmp_path: Path, name: str, namespace: str, models: Mapping[str, type[ParameterModel]]
) -> None:
    made = plan(tmp_path, scenario=name, namespace=namespace)
    scenario = load_scenario(name, law="classical", seed=3, assignments=["object.mass=0.2"])
    controller, bridge = run_parameters(scenario, recording=True)
    assert made.bridge is not None
    assert read(made.controller, "controller", models) == flatten(controller)
    assert read(made.bridge, "bridge", models) == flatten(bridge)
    assert made.recorder == recorder_command(scenario, tmp_path / "bag", tmp_path, namespace)


def test_without_bag_and_without_bridge(tmp_path: Path) -> None:
    made = plan(tmp_path, bag="", with_bridge=False)
    assert made.recorder == []
    assert made.bridge is None
    assert read(made.controller, "controller")["expected_subscribers"] == 1


def test_a_mistake_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="did you mean"):
        plan(tmp_path, scenario="glass_transprot")
    with pytest.raises(InputError, match="ee_frame"):
        plan(tmp_path, assignments=["ee_frame=tool"])
