"""One arm's part of a node that has several arms: its relative topics lie below a prefix."""

from __future__ import annotations

from typing import Any

from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription


class NodePart:
    """Behaves as the node, but for the names of topics.

    Args:
        node: the node.
        prefix: what stands before relative names, e.g. ``left/``; empty changes nothing.
    """

    def __init__(self, node: Node, prefix: str) -> None:
        self._node, self._prefix = node, prefix

    def __getattr__(self, name: str) -> Any:
        return getattr(self._node, name)

    def _below(self, topic: str) -> str:
        return topic if topic.startswith(("/", "~")) else self._prefix + topic

    def create_publisher(self, msg_type: type, topic: str, *rest: Any, **options: Any) -> Publisher:
        """Create a publisher as the node does."""
        return self._node.create_publisher(msg_type, self._below(topic), *rest, **options)

    def create_subscription(self, msg_type: type, topic: str, *rest: Any, **options: Any) -> Subscription:
        """Create a subscription as the node does."""
        return self._node.create_subscription(msg_type, self._below(topic), *rest, **options)

    def get_fully_qualified_name(self) -> str:
        """Return the node's name with the arm behind it."""
        arm = self._prefix.rstrip("/")
        return f"{self._node.get_fully_qualified_name()}/{arm}".rstrip("/")
