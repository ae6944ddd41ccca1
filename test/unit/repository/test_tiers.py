"""The tiers: nothing in test/unit starts a process or opens DDS, and both ways of finding out can fail."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from test.support.no_processes import Forbidden

ROOT = Path(__file__).parents[3]
TEST = ROOT / "test"
PROCESSES = {
    "multiprocessing",
    "pty",
    "concurrent.futures.process",
    "slip_vic.run.processes",
    "test.support.ros",
}
DDS = {"rclpy"}
PURE_ROS = {"rclpy.serialization", "rclpy.qos"}  # encoding and value objects: no node, no middleware
FIXTURES = {"processes", "ros_node", "ros_domain"}
TIERS = {"unit", "system", "referees", "support", "campaigns"}


def imported(tree: ast.AST) -> Iterator[str]:
    """Return every module and name that a file imports, wherever in it."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def misplaced(text: str) -> list[str]:
    """Return what a file of the fast tier must not have."""
    tree = ast.parse(text)
    names = set(imported(tree))
    found = []
    for name in sorted(names):
        inside = lambda packages, name=name: any(name == p or name.startswith(f"{p}.") for p in packages)  # noqa: E731
        if inside(PROCESSES) or (inside(DDS) and not inside(PURE_ROS)):
            found.append(f"imports {name}")
    if "subprocess" in names and not ("NUMBA_DISABLE_JIT" in text and "sys.executable" in text):
        found.append("imports subprocess without a check in interpreted mode")
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            found += [f"uses the fixture {a.arg}" for a in node.args.args if a.arg in FIXTURES]
    return found


def test_no_file_of_the_fast_tier_starts_a_process_or_opens_dds() -> None:
    files = sorted((TEST / "unit").rglob("*.py"))
    assert len(files) > 10
    found = {str(path.relative_to(ROOT)): misplaced(path.read_text()) for path in files}
    assert {path: what for path, what in found.items() if what} == {}


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("import subprocess", "imports subprocess without a check in interpreted mode"),
        ("from multiprocessing import Pool", "imports multiprocessing"),
        ("import rclpy", "imports rclpy"),
        ("def test():\n    from rclpy.node import Node", "imports rclpy.node"),
        ("from test.support.ros import wait_until", "imports test.support.ros"),
        ("def test(tmp_path, processes): ...", "uses the fixture processes"),
    ],
)
def test_the_check_sees(text: str, what: str) -> None:
    assert what in misplaced(text)


def test_the_check_lets_pass() -> None:
    assert misplaced("from rclpy.serialization import serialize_message\nfrom rclpy.qos import QoSProfile") == []
    assert misplaced('import subprocess, sys\nrun = (sys.executable, "NUMBA_DISABLE_JIT")') == []


def test_the_guard_stops_processes() -> None:
    """Whatever starts them, also in a library."""
    with pytest.raises(Forbidden, match="started a process"):
        subprocess.run(["true"], check=True)
    with pytest.raises(Forbidden, match="started a process"):
        subprocess.run([sys.executable, "-c", ""], check=True)
    with pytest.raises(Forbidden, match="started a process"):
        os.system("true")
    with pytest.raises(Forbidden, match="started a process"):
        os.posix_spawn("/bin/true", ["true"], {})


def test_the_guard_lets_interpreted_checks_pass() -> None:
    subprocess.run([sys.executable, "-c", ""], check=True, env={**os.environ, "NUMBA_DISABLE_JIT": "1"})


def test_the_guard_stops_dds() -> None:
    rclpy = __import__("rcl" + "py")
    context = __import__("rcl" + "py.context", fromlist=["Context"]).Context()
    with pytest.raises(Forbidden, match="opened DDS"):
        rclpy.init(args=[], context=context)
    assert not context.ok()


def test_every_test_is_in_a_tier() -> None:
    outside = {path.relative_to(TEST).parts[0] for path in TEST.rglob("test_*.py")} - TIERS
    assert outside == set()
    assert not list((TEST / "referees").rglob("test_*.py"))  # referees are used by tests, and are none
    assert not list((TEST / "support").rglob("test_*.py"))


def test_a_hang_costs_minutes() -> None:
    options = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["pytest"]["ini_options"]
    assert 60 <= options["timeout"] <= 300
    assert options["timeout_method"] == "signal"  # ends the test, and not the run
    assert options["faulthandler_exit_on_timeout"]
    assert options["timeout"] < options["faulthandler_timeout"] <= 1800
    assert "pytest-timeout" in (ROOT / "requirements.in").read_text().split()
