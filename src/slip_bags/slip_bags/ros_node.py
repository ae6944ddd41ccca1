"""A ROS node for one command: started, and always taken down."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator

import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from slip_msgs_py.environment import choose_transport


def request_realtime() -> bool:
    """Ask for real-time priority for this process and the threads it starts from now on; return whether it was given.

    Before ROS starts, so that its threads inherit it; without the privilege nothing changes.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(os.sched_get_priority_min(os.SCHED_FIFO)))
    except (OSError, AttributeError):  # not permitted, or not on this system
        return False
    return True


@contextlib.contextmanager
def ros_node(name: str, namespace: str = "/") -> Iterator[Node]:
    """Give a bare node in a context of its own; the command line is not read, signals are left alone."""
    choose_transport()
    context = rclpy.Context()
    rclpy.init(args=[], context=context, signal_handler_options=SignalHandlerOptions.NO)
    try:
        bare = {"start_parameter_services": False, "enable_rosout": False}
        node = Node(name, namespace=namespace, context=context, **bare)
        try:
            yield node
        finally:
            node.destroy_node()
    finally:
        rclpy.try_shutdown(context=context)
