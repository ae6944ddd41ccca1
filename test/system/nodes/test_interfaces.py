"""Other slip sensors, a gripper that follows and goals, over DDS."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slip_bags.reader import Bag
from slip_vic.replay.run_data import read_run
from slip_vic.replay.verify import verify_run
from slip_vic.run.in_process import run_in_process
from slip_vic.scenarios.scenario import load_scenario
from test.support.ros import Processes, wait_until
from test.system.conftest import record

CONFIG = Path(__file__).parents[3] / "config" / "paper_planar"
LESS = ("bridge.friction.mu_s=0.2", "bridge.friction.mu_k=0.15", "bridge.sensors.slip.latency_s=0.01")
RUNS = {
    "flag": ("slip_input=flag", "controller.effort.gravity=include", "grip.control=follow", "grip.lag_s=0.02", *LESS),
    "displacement": ("slip_input=displacement", *LESS),
}


@pytest.mark.parametrize("kind", RUNS)
def test_a_run_over_dds_is_the_one_in_process_and_verifies(tmp_path: Path, kind: str) -> None:
    loaded = load_scenario("paper_planar", law="governed", assignments=(*RUNS[kind], "bridge.duration_s=0.3"))
    recording = record(tmp_path, loaded)
    with Bag(recording.bag) as bag:
        commands = [m.value for m in bag.messages("/effort_command")]
        grips = [m.value.data for m in bag.messages("/grip_command")] if "/grip_command" in bag.topics else []
        verdict = verify_run(read_run(bag, {}))
    ticks = list(run_in_process(loaded))
    assert [np.array(m.effort).tobytes() for m in commands] == [t.result.command.effort.tobytes() for t in ticks]
    assert verdict.text().startswith("identical: 300 cycles")
    assert grips == ([t.result.grip for t in ticks] if kind == "flag" else [])
    assert kind != "flag" or grips[-1] > 1.2 * grips[0]


def test_goals_by_topic(processes: Processes, ros_node: Any) -> None:
    """Nodes started alone in real time: one goal is reached, one that is none is refused in one line."""
    from geometry_msgs.msg import PoseStamped, Quaternion, Transform, Vector3
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.qos import DurabilityPolicy, QoSProfile
    from std_msgs.msg import String
    from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

    common = ["-p", "mode:=realtime", "-p", "control_period_s:=0.01"]
    bridge = [*common, "-p", "stop_after_duration:=false"]
    controller = [*common, "-p", "trajectory.kind:=goal", "-p", "gains.k_s:=50.0"]
    for name, options, parameters in (
        ("bridge", bridge, "bridge.yaml"), ("controller", controller, "controller_classical.yaml")
    ):  # fmt: skip
        module = "slip_sim_bridge.main" if name == "bridge" else "slip_vic_controller.main"
        processes.python(name, "-m", module, "--ros-args", "--params-file", CONFIG / parameters, *options)
    poses: list[PoseStamped] = []
    said: list[str] = []
    modes: list[str] = []
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    ros_node.create_subscription(String, "controller/mode", lambda m: modes.append(m.data), latched)
    ros_node.create_subscription(PoseStamped, "controller/ee_pose", poses.append, 10)
    ros_node.create_subscription(String, "controller/goal", lambda m: said.append(m.data), 10)
    publisher = ros_node.create_publisher(MultiDOFJointTrajectory, "goal", 10)
    executor = SingleThreadedExecutor(context=ros_node.context)
    executor.add_node(ros_node)

    def spun(condition: Any) -> bool:
        executor.spin_once(timeout_sec=0.01)
        return bool(condition())

    wait_until(lambda: spun(lambda: poses and publisher.get_subscription_count()), "the first pose", 60.0)
    start = poses[0].pose
    pose = Transform(
        translation=Vector3(x=start.position.x + 0.01, y=start.position.y, z=start.position.z),
        rotation=Quaternion(x=start.orientation.x, y=start.orientation.y, z=start.orientation.z, w=start.orientation.w),
    )
    point = MultiDOFJointTrajectoryPoint(transforms=[pose])
    point.time_from_start.sec = 1
    publisher.publish(MultiDOFJointTrajectory(points=[]))
    wait_until(
        lambda: spun(lambda: "goal refused: goal: got 0 points, expected one" in " ".join(said)), "refusal", 60.0
    )
    seen = lambda: f"goals: {said}, modes: {modes}"  # noqa: E731
    asked_s = [-math.inf]

    def reached() -> bool:
        """Ask again, as a person does, where a busy machine had the law wait just then."""
        if modes[-1:] == ["ACTIVE"] and time.monotonic() - asked_s[0] > 5.0:
            asked_s[0] = time.monotonic()
            publisher.publish(MultiDOFJointTrajectory(points=[point]))
        return any(line.endswith(" reached") for line in said)

    wait_until(lambda: spun(reached), "the goal", 60.0, seen)
    assert abs(poses[-1].pose.position.x - start.position.x - 0.01) < 2e-3
    executor.remove_node(ros_node)
