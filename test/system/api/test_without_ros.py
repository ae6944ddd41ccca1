"""The Python API in a process that cannot import ROS."""

import subprocess
import sys

SCRIPT = """
import sys
for name in ("rclpy", "rcl_interfaces", "sensor_msgs", "std_msgs", "geometry_msgs", "rosgraph_msgs"):
    sys.modules[name] = None  # whoever imports it gets an ImportError
import slip_vic
assert "numpy" not in sys.modules, "names are loaded when they are first used"
run = slip_vic.load("paper_planar", law="vic", sensor="vision_60", set=["bridge.duration_s=0.05"]).run()
assert run.outcome == "ok", run
assert len(run.frame()) == 50
run.page(sys.argv[1] + "/run.html")
run.plot(sys.argv[1] + "/run.png")
print(len(slip_vic.read_bag("bags/paper_planar_vic", "/slip_truth")))
"""


def test_everything_of_the_api_works_without_ros(tmp_path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(tmp_path)], capture_output=True, text=True, timeout=170, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["2000"]
    assert (tmp_path / "run.html").stat().st_size > 100_000
