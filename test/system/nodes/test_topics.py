"""What travels on the topics: every one is recorded, and a reference from outside is followed."""

import itertools
import math
import signal
import time
from collections.abc import Callable
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
    listed = {f"/{name.lstrip('/')}" for name, _ in recorded_topics(noisy_run.scenario)}
    with Bag(noisy_run.bag) as opened:
        assert listed == set(opened.topics)


def follow_trajectories(ros_node: Any, spun: Any, off: Callable[[], float]) -> None:
    """Send a planner's joint trajectory that waits where the arm is, and one for other joints."""
    from sensor_msgs.msg import JointState
    from std_msgs.msg import String
    from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

    states: list[JointState] = []
    said: list[str] = []
    ros_node.create_subscription(JointState, "joint_states", lambda m: states.append(m), 10)
    ros_node.create_subscription(String, "controller/goal", lambda m: said.append(m.data), 10)
    publisher = ros_node.create_publisher(JointTrajectory, "joint_trajectory", 10)
    wait_until(lambda: spun(lambda: states and publisher.get_subscription_count()), "joint states", 60.0)
    here = list(states[-1].position)
    points = [JointTrajectoryPoint(positions=here), JointTrajectoryPoint(positions=here)]
    points[1].time_from_start.nanosec = 200_000_000
    for names, line in ((["no_joint"] * len(here), "trajectory refused"), (states[-1].name, "trajectory reached")):
        message, sent_s = JointTrajectory(joint_names=names, points=points), [-math.inf]

        def answered(message: Any = message, sent_s: list[float] = sent_s, line: str = line) -> bool:
            """Send it again, as a person does, where a busy machine had the law wait just then."""
            if time.monotonic() - sent_s[0] > 5.0:
                sent_s[0] = time.monotonic()
                publisher.publish(message)
            return any(line in text for text in said)

        wait_until(lambda: spun(answered), line, 60.0, lambda: f"{said}")
    assert abs(off()) < REACHED_M


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
    follow_trajectories(ros_node, spun, lambda: poses[-1].pose.position.x - target)
    executor.remove_node(ros_node)
    assert rclpy.ok(context=ros_node.context)
    assert processes.stop(controller, signal.SIGINT) == 0
