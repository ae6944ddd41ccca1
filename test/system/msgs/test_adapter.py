"""An adapter as a process over DDS: a driver's messages become the controller's, here only, until it is to end."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from test.support.ros import Processes, wait_until
from test.system.nodes.test_sockets import assert_loopback_only

ADAPTER = Path(__file__).parents[3] / "examples" / "tactile_adapters" / "adapter.py"


def test_a_driver_s_flag_becomes_the_controller_s(processes: Processes, ros_node: Any) -> None:
    seen: list[JointState] = []
    ros_node.create_subscription(JointState, "slip_flag", seen.append, 10)
    driver = ros_node.create_publisher(Bool, "slipping", qos_profile_sensor_data)
    executor = SingleThreadedExecutor(context=ros_node.context)
    executor.add_node(ros_node)
    adapter = processes.python("adapter", str(ADAPTER), "bool")

    def told(slips: bool) -> bool:
        driver.publish(Bool(data=slips))
        executor.spin_once(timeout_sec=0.02)
        return bool(seen) and seen[-1].position[0] == float(slips)

    for slips in (True, False):
        wait_until(lambda slips=slips: told(slips), f"slip_flag {slips}", seen=adapter.tail)
    assert seen[-1].name == ["slip"]
    assert rclpy.time.Time.from_msg(seen[-1].header.stamp).nanoseconds > 0
    assert_loopback_only(adapter.pid)
    assert processes.stop(adapter, signal.SIGTERM) == 0, adapter.tail()
    assert list(adapter.lines) == []


def test_an_adapter_without_its_vendor_s_messages_says_what_to_build(processes: Processes) -> None:
    adapter = processes.python("adapter", str(ADAPTER), "xela")
    assert processes.wait_end(adapter) == 2
    (line,) = adapter.lines
    assert line.startswith("error: message xela_server_ros2/msg/SensStream")
