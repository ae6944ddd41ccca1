"""A ROS node for one command, which is always destroyed."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from slip_msgs_py.environment import choose_transport


@contextlib.contextmanager
def ros_node(name: str, namespace: str = "/", domain: int | None = None) -> Iterator[Node]:
    """Provide a bare node in its own context; it reads no command line and handles no signals.

    domain: ROS domain id; None: ROS_DOMAIN_ID.
    """
    choose_transport()
    context = rclpy.Context()
    rclpy.init(args=[], context=context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
    try:
        bare = {"start_parameter_services": False, "enable_rosout": False}
        node = Node(name, namespace=namespace, context=context, **bare)
        try:
            yield node
        finally:
            node.destroy_node()
    finally:
        rclpy.try_shutdown(context=context)
