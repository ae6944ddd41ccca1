"""The launch file that shows the arm, read as a text, because launch is not on PyPI: what it names is there."""

from __future__ import annotations

import ast
import xml.etree.ElementTree as ET
from pathlib import Path

import yaml

from slip_core.files.urdf import base_of, parse_urdf
from slip_description import urdf_text

PACKAGE = Path(__file__).parents[3] / "src" / "slip_description"
LAUNCH = PACKAGE / "launch" / "view_arm.launch.py"
# What launch, launch_ros and ament_index_python of Jazzy offer (docs.ros.org); look a name up before adding it.


def calls(name: str) -> list[ast.Call]:
    tree = ast.walk(ast.parse(LAUNCH.read_text()))
    return [node for node in tree if isinstance(node, ast.Call) and getattr(node.func, "id", "") == name]


def test_its_nodes_are_of_declared_packages() -> None:
    declared = {node.text for node in ET.parse(PACKAGE / "package.xml").getroot().findall("exec_depend")}
    packages = {
        ast.literal_eval(word.value) for node in calls("Node") for word in node.keywords if word.arg == "package"
    }
    assert packages == {"robot_state_publisher", "joint_state_publisher_gui", "rviz2"}
    assert packages <= declared


def test_urdf_launch_file_and_view_are_installed_in_share() -> None:
    setup = (PACKAGE / "setup.py").read_text()
    for folder, file in (
        ("urdf", "slip_description/urdf/arm.urdf"), ("launch", "launch/view_arm.launch.py"), ("rviz", "rviz/arm.rviz"),
    ):  # fmt: skip
        assert (PACKAGE / file).is_file()
        assert f'(f"share/{{NAME}}/{folder}"' in setup
        assert file.replace("slip_description/urdf", "{NAME}/urdf") in setup


def test_the_view_starts_from_the_base_of_the_arm() -> None:
    view = yaml.safe_load((PACKAGE / "rviz" / "arm.rviz").read_text())["Visualization Manager"]
    assert view["Global Options"]["Fixed Frame"] == base_of(parse_urdf(urdf_text()))
    (model,) = [shown for shown in view["Displays"] if shown["Class"].endswith("RobotModel")]
    assert model["Description Topic"] == {"Durability Policy": "Transient Local", "Value": "/robot_description"}
