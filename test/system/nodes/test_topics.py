"""What travels on the topics: every one is recorded, and a reference from outside is followed."""

import itertools
import signal
from pathlib import Path
from typing import Any

import pytest

from slip_bags.reader import Bag
from slip_vic.run.commands import recorded_topics
from test.support.ros import Processes, wait_until
from test.system.conftest import Recording

CONFIG = Path(__file__).parents[3] / "config" / "paper_planar"
REACHED_M = 2e-4  # the impedance has 4 time constants to settle on a 2 mm step


@pytest.mark.smoke
def test_every_topic_is_recorded(noisy_run: Recording) -> None:
    listed = {f"/{name.lstrip('/')}" for name in recorded_topics(noisy_run.scenario)}
    found = set(Bag(noisy_run.bag).topics)
    assert found < listed
    assert {"/joint_states", "/slip_velocity", "/slip_truth", "/effort_command", "/controller/ledger"} < found
    assert {"/velocity_command", "/slip_flag", "/controller/goal"} < listed - found, "nobody publishes them"


def test_reference_topic_is_followed(processes: Processes, ros_node: Any) -> None:
    """Started alone, from the files in config/, in real time: the documented way onto a robot."""
    from geometry_msgs.msg import PoseStamped, Quaternion, Transform, Vector3
    from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

    bridge_options = ["-p", "mode:=realtime", "-p", "duration_s:=1e6", "-p", "control_period_s:=0.01"]
    processes.python(
        "bridge", "-m", "slip_sim_bridge.main", "--ros-args", "--params-file", CONFIG / "bridge.yaml", *bridge_options
    )
    changes = ("mode:=realtime", "trajectory.kind:=topic", "gains.k_s:=50.0", "control_period_s:=0.01")
    controller = processes.python(
        "controller", "-m", "slip_vic_controller.main", "--ros-args", "--params-file",
        CONFIG / "controller_vic_realtime.yaml", *itertools.chain.from_iterable(("-p", one) for one in changes),
    )  # fmt: skip
    poses: list[PoseStamped] = []
    ros_node.create_subscription(PoseStamped, "controller/ee_pose", poses.append, 10)
    publisher = ros_node.create_publisher(MultiDOFJointTrajectory, "reference", 10)
    import rclpy
    from rclpy.executors import SingleThreadedExecutor

    executor = SingleThreadedExecutor(context=ros_node.context)
    executor.add_node(ros_node)

    def spun(condition: Any) -> bool:
        executor.spin_once(timeout_sec=0.01)
        return bool(condition())

    wait_until(lambda: spun(lambda: poses), "the first pose", 60.0)
    start = poses[0].pose
    target = start.position.x + 0.002
    pose = Transform(
        translation=Vector3(x=target, y=start.position.y, z=start.position.z),
        rotation=Quaternion(x=start.orientation.x, y=start.orientation.y, z=start.orientation.z, w=start.orientation.w),
    )
    message = MultiDOFJointTrajectory(points=[MultiDOFJointTrajectoryPoint(transforms=[pose])])

    def arrived() -> bool:
        publisher.publish(message)
        return abs(poses[-1].pose.position.x - target) < REACHED_M

    wait_until(lambda: spun(arrived), "the end-effector at the reference", 60.0)
    executor.remove_node(ros_node)
    assert rclpy.ok(context=ros_node.context)
    assert processes.stop(controller, signal.SIGINT) == 0
