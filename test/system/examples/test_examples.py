"""Every example runs with the command that it begins with, and says what it is there to say."""

import ast
import json
import re
import runpy
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from test.support.ros import Processes

ROOT = Path(__file__).parents[3]
FOLDER = ROOT / "examples"
SCRIPTS = sorted(path.name for path in FOLDER.glob("*.py"))
LONGEST, SHORTEST = 60, 10
TICKS = 2000
SAID = {
    "run_and_plot.py": r"classical +ok: slip 3\d\.\d\d mm.*governed +ok: slip 0\.00 mm",
    "law_on_arrays.py": r"0 +400\.0 +0\.00",
    "your_law.py": r"classical +ok: slip.*yours +ok: slip",
    "gym_env.py": r"return -\d.*slip \d.*kept",
    "own_friction.py": r"as the scenario has it +\d.*LuGre.*small pad",
    "own_sensor.py": r"ideal +ok.*my_sensor +ok.*vision_25",
    "own_arm.py": r"governed: ok, slip 0\.\d\d mm",
    "two_arms.py": r"classical +\w+ +slip.*vic +ok +slip.*governed +ok +slip",
    "retime.py": r"slip 3\d\.\d mm.*arrival 2\.\d+ s; the path as given takes 2\.150 s",
    "read_bag.py": r"slips faster than 1 mm/s for [01]\.\d\d of 1\.00 s",
}


@pytest.mark.parametrize("name", SCRIPTS)
def test_an_example_is_short_and_begins_with_its_command(name: str) -> None:
    assert SHORTEST <= len((FOLDER / name).read_text().splitlines()) <= LONGEST
    assert str(ast.get_docstring(ast.parse((FOLDER / name).read_text()))).startswith(f"python examples/{name}")


@pytest.mark.parametrize("name", SAID)
def test_an_example_runs(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if name == "gym_env.py":
        pytest.importorskip("gymnasium", reason="the extra `gym`")
    folder = {
        "run_and_plot.py": ["paper_planar", str(tmp_path)],
        "own_sensor.py": [str(tmp_path)],
        "retime.py": [str(tmp_path)],
    }
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr("sys.argv", [f"examples/{name}", *folder.get(name, [])])
    runpy.run_path(f"examples/{name}", run_name="__main__")
    assert re.search(SAID[name], capsys.readouterr().out, re.DOTALL)


def test_the_cartesian_impedance_node_carries_the_pane_to_its_goal(processes: Processes, ros_node: Any) -> None:
    """Where the object is at the end, as the simulator publishes it, against the pose that no slip at all gives."""
    from nav_msgs.msg import Odometry
    from rclpy.executors import SingleThreadedExecutor

    seen: list[Odometry] = []
    subscription = ros_node.create_subscription(Odometry, "object_state", seen.append, 10000)
    executor = SingleThreadedExecutor(context=ros_node.context)
    executor.add_node(ros_node)
    parameters = ROOT / "config" / "glass_transport" / "bridge.yaml"
    words = ["--ros-args", "--params-file", parameters, "-p", f"duration_s:={1e-3 * TICKS}"]
    bridge = processes.python("bridge", "-m", "slip_sim_bridge.main", *words)
    while not subscription.get_publisher_count():  # time runs once the node is there: not before we listen
        assert bridge.poll() is None, bridge.tail()
        executor.spin_once(timeout_sec=0.1)
    node = processes.python("node", FOLDER / "cartesian_impedance_node.py")
    taken = -1
    while bridge.poll() is None or len(seen) > taken:  # also what is still in the queue at the end
        taken = len(seen)
        executor.spin_once(timeout_sec=1.0)
    assert len(seen) == TICKS
    assert processes.wait_end(bridge) == 0, bridge.tail()
    assert "LOST" not in bridge.tail()
    (start, turned), (end, at_end) = (pose_of(seen[k]) for k in (0, -1))
    turn = Rotation.from_rotvec([0.0, 0.0, 0.5])
    pad = start + turned.apply([0.0, 0.03, 0.0])
    np.testing.assert_allclose(end, turn.apply(start - pad) + pad + np.array([0.1, 0.45, 0.0]), atol=1e-3)
    assert (at_end * (turn * turned).inv()).magnitude() < 0.01
    assert processes.stop(node, signal.SIGINT) == 0


def pose_of(message: Any) -> tuple[np.ndarray, Rotation]:
    at, q = message.pose.pose.position, message.pose.pose.orientation
    return np.array([at.x, at.y, at.z]), Rotation.from_quat([q.x, q.y, q.z, q.w])


def test_the_notebook_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    cells = json.loads((FOLDER / "notebook.ipynb").read_text())["cells"]
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    assert all(not cell.get("outputs") for cell in cells), "no outputs are kept"
    monkeypatch.chdir(ROOT)
    exec("\n".join(code), {"__name__": "__main__"})
