"""A controller of velocities over DDS: its topics, what ros2_control's controllers get, and how it ends."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Any

import numpy as np

from slip_vic.scenarios.scenario import NODES, load, ros_parameter_file
from test.support.ros import Processes, wait_until

PERIOD = ("control_period_s=0.004", "bridge.duration_s=1e6")
MODULES = {"controller": "slip_vic_controller.main", "bridge": "slip_sim_bridge.main"}
SOME = 50


def test_velocities_end_at_zero(processes: Processes, tmp_path: Path, ros_node: Any) -> None:
    from rclpy.executors import SingleThreadedExecutor
    from sensor_msgs.msg import JointState
    from std_msgs.msg import Float64MultiArray

    stamped: list[Any] = []
    plain: list[list[float]] = []
    moving: tuple[set[tuple[float, ...]], set[tuple[float, ...]]] = (set(), set())

    def take_stamped(message: Any) -> None:
        stamped.append(message)
        moving[0].add(tuple(message.velocity))

    def take_plain(message: Any) -> None:
        plain.append(list(message.data))
        moving[1].add(tuple(message.data))

    ros_node.create_subscription(JointState, "velocity_command", take_stamped, 1000)
    ros_node.create_subscription(Float64MultiArray, "velocity_controller/commands", take_plain, 1000)
    scenario = load("paper_planar", law="governed", mode="realtime", drive="velocity_500", set=PERIOD)
    started = {}
    for name, module in MODULES.items():
        path = tmp_path / f"{name}.yaml"
        path.write_text(ros_parameter_file(getattr(scenario, name), NODES[name][0]))
        started[name] = processes.python(name, "-m", module, "--ros-args", "--params-file", path)
    executor = SingleThreadedExecutor(context=ros_node.context)
    executor.add_node(ros_node)

    def see(condition: Any, what: str) -> None:
        wait_until(lambda: executor.spin_once(0.02) or condition(), what)

    try:
        see(lambda: len(moving[0] & moving[1]) > SOME, "the same velocities on both topics")
        commands = [message for message in stamped if len(message.velocity)]
        assert all(len(message.effort) == len(message.position) == 0 for message in commands)
        assert np.isfinite([message.velocity for message in commands]).all()
        assert ros_node.count_publishers("/effort_command") == 0
        assert processes.stop(started["controller"], signal.SIGINT) == 0, started["controller"].tail()
        see(lambda: not any(plain[-1]) and not any(stamped[-1].velocity), "zero velocity at the end")
    finally:
        executor.remove_node(ros_node)
