"""The nodes as processes over DDS: start, run, stop, missing peers, wrong QoS, bad parameters, namespaces."""

import signal
import time
from pathlib import Path

import pytest

from slip_vic.scenarios.scenario import NODES, load, ros_parameter_file
from test.support.ros import Processes

BRIDGE, CONTROLLER = "slip_sim_bridge.main", "slip_vic_controller.main"


@pytest.fixture
def params(tmp_path: Path):
    """Write the parameter files of paper_planar, with assignments, and return the ROS arguments of a node."""

    def write(node: str, *assignments: str, mode: str = "lockstep") -> list[str]:
        scenario = load("paper_planar", law="vic", mode=mode, set=assignments)
        path = tmp_path / f"{node}.yaml"
        path.write_text(ros_parameter_file(getattr(scenario, node), NODES[node][0]))
        return ["--ros-args", "--params-file", str(path)]

    return write


@pytest.mark.smoke
def test_lockstep_run_ends(processes: Processes, params) -> None:
    controller = processes.python("controller", "-m", CONTROLLER, *params("controller"))
    bridge = processes.python("bridge", "-m", BRIDGE, *params("bridge", "bridge.duration_s=0.2"))
    assert processes.wait_end(bridge) == 0, bridge.tail()
    assert bridge.results["ticks"] == 200
    assert processes.stop(controller, signal.SIGINT) == 0
    assert controller.results["cycles"] == 200


@pytest.mark.smoke
def test_signal_ends_both_nodes(processes: Processes, params) -> None:
    number = signal.SIGTERM  # SIGINT ends the nodes of most other tests
    controller = processes.python("controller", "-m", CONTROLLER, *params("controller"))
    bridge = processes.python("bridge", "-m", BRIDGE, *params("bridge", "bridge.duration_s=1000.0"))
    processes.wait_event(bridge, "progress")
    assert processes.stop(bridge, number) == 0, bridge.tail()
    assert processes.stop(controller, number) == 0, controller.tail()


@pytest.mark.parametrize(
    ("module", "after_s", "number"),
    [
        (BRIDGE, 0.2, signal.SIGTERM), (BRIDGE, 1.5, signal.SIGINT), (CONTROLLER, 0.2, signal.SIGTERM),
        (CONTROLLER, 2.0, signal.SIGINT),
    ],
)  # fmt: skip
def test_signal_during_start(processes: Processes, module: str, after_s: float, number: int) -> None:
    """Python itself takes the signal before the first line of ours has run: then it is that signal which ends it.

    So early it is SIGTERM: of SIGINT Python makes an exception, and while `site` reads its files an error of it.
    """
    node = processes.python("node", "-m", module)
    time.sleep(after_s)
    assert processes.stop(node, number) in (0, -number), node.tail()


def test_dead_controller_is_reported(processes: Processes, params) -> None:
    controller = processes.python("controller", "-m", CONTROLLER, *params("controller"))
    bridge = processes.python(
        "bridge", "-m", BRIDGE, *params("bridge", "bridge.duration_s=1000.0", "bridge.lockstep_timeout_s=0.5")
    )
    processes.wait_event(bridge, "progress")
    processes.kill(controller)
    assert processes.wait_end(bridge) == 1
    (line,) = [line for line in bridge.lines if line.startswith("error:")]
    assert "no effort_command for tick" in line


def test_wrong_qos_is_named(processes: Processes, params, ros_node) -> None:
    from rclpy.qos import QoSProfile, ReliabilityPolicy
    from sensor_msgs.msg import JointState

    ros_node.create_publisher(
        JointState, "effort_command", QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    )
    bridge = processes.python("bridge", "-m", BRIDGE, *params("bridge", "bridge.peer_timeout_s=6.0"))
    assert processes.wait_end(bridge) == 1
    (line,) = [line for line in bridge.lines if line.startswith("error:")]
    assert "QoS-compatible" in line
    assert "Best effort publisher and reliable subscription" in line


BAD = [
    (CONTROLLER, "-p gains.ks:=5.0", ["gains.ks", "gains.k_s"]),
    (CONTROLLER, "-p ee_frame:=hand_of_god", ["hand_of_god"]),
    (BRIDGE, "-p friction.model:=glue", ["friction.model", "stribeck"]),
    (BRIDGE, "--params-file /dev/zero", ["no regular file", "/dev/zero"]),
]


@pytest.mark.smoke
def test_bad_parameter_exits_with_2(processes: Processes) -> None:
    """All at once: each ends by itself, before it has a node."""
    nodes = [processes.python(words[0], "-m", module, "--ros-args", *given.split()) for module, given, words in BAD]
    for node, (_, _, words) in zip(nodes, BAD, strict=True):
        assert processes.wait_end(node) == 2, node.tail()
        lines = list(node.lines)
        assert len(lines) == 1, node.tail()
        assert lines[0].startswith("error: ")
        assert all(word in lines[0] for word in words), lines[0]
