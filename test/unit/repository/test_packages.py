"""Each package is a valid ROS package and declares exactly what it imports."""

import ast
import re
import runpy
import sys
import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
import setuptools

import slip_vic
from slip_core.topics import TOPICS

SRC = Path(__file__).parents[3] / "src"
PACKAGES = sorted(path.name for path in SRC.iterdir() if (path / "setup.py").exists())

# Import name: distribution on PyPI, key of rosdep (None: rosdep has none, it comes from PyPI alone).
LIBRARIES = {
    "click": ("click", "python3-click"),
    "llvmlite": ("llvmlite", None),
    "lz4": ("lz4", None),
    "matplotlib": ("matplotlib", "python3-matplotlib"),
    "mcap": ("mcap", None),
    "mcap_ros2": ("mcap-ros2-support", "mcap-ros2-support"),
    "mujoco": ("mujoco", "python3-mujoco-pip"),
    "numba": ("numba", "python3-numba"),
    "numpy": ("numpy", "python3-numpy"),
    "pandas": ("pandas", "python3-pandas"),
    "pinocchio": ("pin", "pinocchio"),
    "pydantic": ("pydantic", "python3-pydantic"),
    "rich": ("rich", "python3-rich"),
    "scipy": ("scipy", "python3-scipy"),
    "xacro": ("xacro", "xacro"),
    "yaml": ("pyyaml", "python3-yaml"),
    "zstandard": ("zstandard", None),
}
# Of an extra alone: the command that needs one of these says how to install it.
EXTRAS = {"optuna", "trimesh", "websockets"}
# Keys that rosdep resolves on Ubuntu 24.04: rosdep/*.yaml and jazzy/distribution.yaml of github.com/ros/rosdistro at
# 8468e88ccd523427f9131e39d2af0938f1c298b2 (2026-08-22). Look a key up there before adding it.
ROSDEP = {
    "mcap-ros2-support", "python3-click", "python3-matplotlib", "python3-mujoco-pip", "python3-numba",
    "python3-numpy", "python3-pandas", "python3-pydantic", "python3-pytest", "python3-rich",
    "python3-scipy", "python3-yaml",
}  # fmt: skip
JAZZY = {
    "ament_index_python", "builtin_interfaces", "diagnostic_msgs", "geometry_msgs",
    "joint_state_publisher_gui", "launch", "launch_ros", "lifecycle_msgs", "nav_msgs", "pinocchio",
    "rcl_interfaces", "rclpy", "robot_state_publisher", "rosgraph_msgs", "rosidl_parser", "rviz2", "sensor_msgs",
    "std_msgs", "std_srvs", "trajectory_msgs", "xacro",
}  # fmt: skip
# What a package loads without an import statement: message classes by name, the URDF that scenarios name by package://.
UNSEEN = {
    "slip_msgs_py": {row.type.partition("/")[0] for row in TOPICS.values()},
    "slip_vic": {"slip_description"},
    "slip_description": {"joint_state_publisher_gui", "robot_state_publisher", "rviz2"},
}


def imported(text: str) -> set[str]:
    """Return the top-level names that a source text imports, without the standard library."""
    found = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add(str(node.module).partition(".")[0])
    return found - set(sys.stdlib_module_names)


def needed(name: str) -> set[str]:
    texts = [path.read_text() for path in (SRC / name / name).rglob("*.py")]
    texts += [path.read_text() for path in (SRC / name / "launch").glob("*.launch.py")]
    return set().union(UNSEEN.get(name, set()), *map(imported, texts)) - {name} - EXTRAS


def wheels(imports: set[str]) -> set[str]:
    """Return what pip must know: libraries and sisters; ROS itself is declared in package.xml alone."""
    return {LIBRARIES[one][0] for one in imports & set(LIBRARIES)} | (imports & set(PACKAGES))


def ros_keys(imports: set[str]) -> set[str]:
    """Return what rosdep and colcon must know."""
    return {LIBRARIES[one][1] for one in imports & set(LIBRARIES)} - {None} | (imports - set(LIBRARIES))


def setup_arguments(name: str, monkeypatch: pytest.MonkeyPatch) -> dict:
    arguments: dict = {}
    monkeypatch.setattr(setuptools, "setup", arguments.update)
    monkeypatch.chdir(SRC / name)
    runpy.run_path("setup.py")
    return arguments


def scripts_of(arguments: dict) -> list[str]:
    return arguments.get("entry_points", {}).get("console_scripts", [])


def package_xml(name: str) -> ET.Element:
    return ET.parse(SRC / name / "package.xml").getroot()


def test_install_order_of_the_run_script() -> None:
    text = (SRC.parent / "run").read_text()
    order = text.partition("PACKAGES=(")[2].partition(")")[0].split()
    assert sorted(order) == PACKAGES
    for position, name in enumerate(order):
        assert needed(name) & set(PACKAGES) <= set(order[:position]), name


@pytest.mark.parametrize("name", PACKAGES)
def test_setup_declares_what_is_imported(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    declared = set(setup_arguments(name, monkeypatch)["install_requires"])
    assert declared == {"setuptools"} | wheels(needed(name))


@pytest.mark.parametrize("name", PACKAGES)
def test_package_xml_declares_what_is_imported(name: str) -> None:
    assert {node.text for node in package_xml(name).findall("exec_depend")} == ros_keys(needed(name))


@pytest.mark.parametrize("name", PACKAGES)
def test_rosdep_keys(name: str) -> None:
    """`rosdep install` ends at the first key that it does not have."""
    root = package_xml(name)
    keys = {node.text for node in root if node.tag.endswith("depend")}
    assert keys <= ROSDEP | JAZZY | set(PACKAGES)
    alone = {LIBRARIES[one][0] for one in needed(name) & set(LIBRARIES) if LIBRARIES[one][1] is None}
    said = str(root.findtext("description")).partition("From PyPI, because rosdep has no key: ")[2].rstrip(".")
    assert {word for word in said.split(", ") if word} == alone


@pytest.mark.parametrize("name", PACKAGES)
def test_console_scripts_lead_to_functions(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for line in scripts_of(setup_arguments(name, monkeypatch)):
        module, _, function = line.partition("=")[2].strip().partition(":")
        text = (SRC / name / Path(*module.split("."))).with_suffix(".py").read_text()
        assert f"def {function}(" in text, line


@pytest.mark.parametrize("name", PACKAGES)
def test_package_xml_is_ament_python(name: str) -> None:
    root = package_xml(name)
    assert root.tag == "package"
    assert root.get("format") == "3"
    for tag in ("name", "version", "description", "maintainer", "license"):
        assert (root.findtext(tag) or "").strip(), tag
    assert root.findtext("name") == name
    assert root.find("maintainer").get("email")
    assert root.findtext("export/build_type") == "ament_python"


@pytest.mark.parametrize("name", PACKAGES)
def test_package_has_what_ament_needs(name: str) -> None:
    folder = SRC / name
    assert (folder / "resource" / name).is_file()
    assert (folder / name / "py.typed").is_file()
    assert f"$base/lib/{name}" in (folder / "setup.cfg").read_text()
    assert re.search(r'extras_require=\{\s*"test": \["pytest"\]', (folder / "setup.py").read_text())


def project() -> dict:
    """Return the [project] and the setuptools part of the root's pyproject.toml: what pip makes one wheel of."""
    return tomllib.loads((SRC.parent / "pyproject.toml").read_text())


def test_wheel_has_all_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    built = project()["tool"]["setuptools"]
    assert sorted(built["packages"]["find"]["where"]) == [f"src/{name}" for name in PACKAGES]
    shared = built["package-data"]["*"]
    for name in PACKAGES:
        own = setup_arguments(name, monkeypatch)["package_data"][name]
        assert sorted(own) == sorted([*shared, *built["package-data"].get(name, [])]), name


def test_wheel_declares_dependencies(monkeypatch: pytest.MonkeyPatch) -> None:
    built = project()["project"]
    arguments = [setup_arguments(name, monkeypatch) for name in PACKAGES]
    declared = set().union(*(one["install_requires"] for one in arguments))
    assert set(built["dependencies"]) == declared - {"setuptools"} - set(PACKAGES)
    scripts = {f"{name} = {where}" for name, where in built["scripts"].items()}
    assert scripts == {line for one in arguments for line in scripts_of(one)}
    ros = [line for line in (SRC.parent / "requirements.in").read_text().splitlines() if line.startswith("ros-")]
    assert built["optional-dependencies"]["ros"] == ros


def test_versions_agree() -> None:
    versions = {package_xml(name).findtext("version") for name in PACKAGES}
    assert versions == {project()["project"]["version"], slip_vic.__version__}
    assert len(versions) == 1
    (version,) = versions
    assert all(f'version="{version}"' in (SRC / name / "setup.py").read_text() for name in PACKAGES)
