"""The Python API in a process that cannot import ROS."""

import subprocess
import sys

WITHOUT = """
import sys
for name in ("rclpy", "rcl_interfaces", "sensor_msgs", "std_msgs", "geometry_msgs", "rosgraph_msgs"):
    sys.modules[name] = None  # whoever imports it gets an ImportError
"""
SCRIPT = """
import slip_vic
assert "numpy" not in sys.modules, "names are loaded when they are first used"
run = slip_vic.load("paper_planar", law="vic", sensor="vision_60", set=["bridge.duration_s=0.05"]).run()
assert run.outcome == "ok", run
assert len(run.frame()) == 50
run.page(sys.argv[1] + "/run.html")
print(len(slip_vic.read_bag("bags/paper_planar_vic", "/slip_truth")))
from slip_vic.cli import main
sys.argv = ["slip-vic", "bag", "verify", "bags/paper_planar_vic"]
assert main() == 0
"""
COMMANDS = """
from slip_bags.cli import main as slip_bag
from slip_sim_bridge.main import main as bridge
from slip_vic.cli import main as slip_vic
from slip_vic_controller.main import main as controller
for program, words in [
    (slip_vic, ["watch"]), (slip_vic, ["bringup"]), (slip_vic, ["run"]), (slip_vic, ["demo"]),
    (slip_bag, ["play", "bags/paper_planar_vic"]), (slip_bag, ["record", "-a"]), (bridge, []), (controller, []),
]:
    sys.argv = ["program", *words]
    assert program() == 2, words
"""


def test_everything_of_the_api_works_without_ros(tmp_path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT + SCRIPT, str(tmp_path)],
        capture_output=True,
        text=True,
        timeout=170,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split()[:2] == ["1000", "identical:"]
    assert (tmp_path / "run.html").stat().st_size > 100_000


def test_what_needs_ros_says_so_in_one_line() -> None:
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT + COMMANDS], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    lines = done.stderr.splitlines()
    assert len(lines) == 8
    assert all(line.startswith("error: ROS 2: got no rclpy in this Python") for line in lines), lines
