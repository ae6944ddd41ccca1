"""Publish one topic at a given rate: ``python -m test.campaigns.attacks.flood TOPIC HZ SECONDS``."""

from __future__ import annotations

import sys
import time
from typing import Any

import rclpy
from rclpy.serialization import serialize_message

from slip_core.topics import topic
from slip_msgs_py.environment import choose_transport
from slip_msgs_py.qos import create_publisher, message_class

FOREIGN = "foreign"
"""frame_id of every message that an attacker sends, so that the monitor knows it."""
BURST_S = 0.005


def message(name: str) -> Any:
    """Return a message of a topic of the table, stamped now where it has a header, with numbers for seven joints."""
    made = message_class(topic(name).type)()
    if hasattr(made, "header"):
        made.header.frame_id = FOREIGN
        made.header.stamp.sec, made.header.stamp.nanosec = divmod(time.time_ns(), 1_000_000_000)
    if hasattr(made, "name"):
        made.name = [f"arm_joint{i}" for i in range(1, 8)]
        made.position = made.velocity = made.effort = [0.1] * 7
    return made


def main(name: str, rate_hz: float, seconds: float) -> int:
    """Publish; print the rate that was reached."""
    choose_transport()
    rclpy.init(args=[])
    node = rclpy.create_node("flood", start_parameter_services=False, enable_rosout=False)
    publisher = create_publisher(node, name)
    data, sent, began = serialize_message(message(name)), 0, time.monotonic()
    while (passed := time.monotonic() - began) < seconds:
        for _ in range(int(rate_hz * passed) - sent):
            publisher.publish(data)
            sent += 1
        time.sleep(BURST_S)
    print(f"{sent / passed:.0f} messages/s", flush=True)
    node.destroy_node()
    rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], float(sys.argv[2]), float(sys.argv[3])))
