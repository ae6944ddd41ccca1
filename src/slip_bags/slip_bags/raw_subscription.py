"""Take raw messages with their times and sequence numbers out of a subscription, without decoding.

`rclpy` hands these only to its own executors; the method they call is used here directly: no executor, no callback.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from rclpy.node import Node
from rclpy.qos import QoSProfile


class Arrival(NamedTuple):
    """One received message: when it could be taken and when it was sent [ns], its publisher's number, its CDR bytes."""

    received_ns: int
    sent_ns: int
    sequence: int
    data: bytes


class RawSubscription:
    """Takes from the subscription handle; its node must not be added to an executor."""

    def __init__(self, node: Node, message_class: type, topic: str, profile: QoSProfile) -> None:
        self._node = node
        self.kind = message_class
        self._subscription = node.create_subscription(message_class, topic, lambda _: None, profile, raw=True)
        self._last_ns = 0

    def drain(self) -> Iterator[Arrival]:
        """Yield what is there now, in the order of sending and with times that do not go back.

        What was lost on its way and sent again makes those behind it wait, though they were received before it.
        """
        handle = self._subscription.handle
        with handle:
            while (taken := handle.take_message(self.kind, True)) is not None:
                data, info = taken
                self._last_ns = max(self._last_ns, info["received_timestamp"])
                number = info["publication_sequence_number"] or 0
                yield Arrival(self._last_ns, info["source_timestamp"], number, bytes(data))

    def publisher_count(self) -> int:
        """Matched publishers."""
        return int(self._subscription.get_publisher_count())

    def close(self) -> None:
        """Unsubscribe."""
        self._node.destroy_subscription(self._subscription)
