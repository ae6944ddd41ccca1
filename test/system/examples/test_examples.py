"""Every example runs with the command that it begins with, and says what it is there to say."""

import ast
import json
import re
import runpy
import signal
from pathlib import Path

import pytest

from test.support.ros import Processes, wait_until

ROOT = Path(__file__).parents[3]
FOLDER = ROOT / "examples"
SCRIPTS = sorted(path.name for path in FOLDER.glob("*.py"))
LONGEST, SHORTEST = 60, 10
SAID = {
    "run_and_plot.py": r"classical +ok: slip 3\d\.\d\d mm.*governed +ok: slip 0\.00 mm",
    "law_on_arrays.py": r"0 +400\.0 +0\.00",
    "own_law.py": r"classical +ok: slip.*own +\w+: slip.*largest effort",
    "your_law.py": r"classical +ok: slip.*yours +ok: slip",
    "gym_env.py": r"return -\d.*slip \d.*kept",
    "own_friction.py": r"as the scenario has it +\d.*LuGre.*small pad",
    "own_sensor.py": r"ideal +ok.*my_sensor +ok.*vision_25",
    "own_arm.py": r"governed: ok, slip 0\.\d\d mm",
    "two_arms.py": r"classical +\w+ +slip.*vic +ok +slip.*governed +ok +slip",
    "retime.py": r"slip 3\d\.\d mm.*arrival 2\.\d+ s; the path as given takes 2\.150 s",
    "read_bag.py": r"slips faster than 1 mm/s for [01]\.\d\d of 2\.00 s",
}


def docstring(name: str) -> str:
    return ast.get_docstring(ast.parse((FOLDER / name).read_text())) or ""


@pytest.mark.parametrize("name", SCRIPTS)
def test_an_example_is_short_and_begins_with_its_command(name: str) -> None:
    assert SHORTEST <= len((FOLDER / name).read_text().splitlines()) <= LONGEST
    assert docstring(name).startswith(f"python examples/{name}")


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


def test_the_joint_pd_node_answers_every_joint_state(processes: Processes) -> None:
    node = processes.python("node", FOLDER / "joint_pd_node.py")
    parameters = ROOT / "config" / "paper_planar" / "bridge.yaml"
    words = ["--ros-args", "--params-file", parameters, "-p", "duration_s:=1.1"]
    bridge = processes.python("bridge", "-m", "slip_sim_bridge.main", *words)
    assert processes.wait_end(bridge) == 0, bridge.tail()
    wait_until(lambda: "1001 joint states answered" in node.tail(), "a second of answers", seen=node.tail)
    assert float(re.findall(r"([\d.]+) rad from the start", node.tail())[-1]) < 1e-3
    assert "LOST" not in bridge.tail()
    assert processes.stop(node, signal.SIGINT) == 0


def test_the_notebook_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    cells = json.loads((FOLDER / "notebook.ipynb").read_text())["cells"]
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    assert all(not cell.get("outputs") for cell in cells), "no outputs are kept"
    monkeypatch.chdir(ROOT)
    exec("\n".join(code), {"__name__": "__main__"})
