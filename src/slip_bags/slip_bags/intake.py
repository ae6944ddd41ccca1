"""Take raw messages with their times and sequence numbers out of a subscription, without decoding.

`rclpy` hands these only to its own executors; the method they call is used here directly (fast: no executor,
no callback), and where a version lacks it, a callback on an executor of our own does the same more slowly.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Any, NamedTuple, Protocol

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy


class Arrival(NamedTuple):
    """One received message: when it was received and sent [ns], its number at its publisher, its CDR bytes."""

    received_ns: int
    sent_ns: int
    sequence: int
    data: bytes


class Intake(Protocol):
    """A subscription that is drained instead of calling back."""

    def drain(self) -> Iterator[Arrival]:
        """Yield what is there now."""

    def publisher_count(self) -> int:
        """Matched publishers."""

    def close(self) -> None:
        """Unsubscribe."""


def recording_qos(depth: int, *, reliable: bool, transient_local: bool) -> QoSProfile:
    """Return the QoS a recorder asks for: deep, and no stronger than what every publisher offers."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if transient_local else DurabilityPolicy.VOLATILE,
    )


def open_intake(node: Node, message_class: type, topic: str, qos: QoSProfile) -> Intake:
    """Subscribe raw, in the fastest way this rclpy offers."""
    direct = DirectIntake(node, message_class, topic, qos)
    if direct.works():
        return direct
    direct.close()
    return ExecutorIntake(node, message_class, topic, qos)


class DirectIntake:
    """Takes from the subscription handle; its node must not be added to an executor."""

    def __init__(self, node: Node, message_class: type, topic: str, qos: QoSProfile) -> None:
        self._node = node
        self._class = message_class
        self._subscription = node.create_subscription(message_class, topic, _never, qos, raw=True)
        self._pending: deque[Arrival] = deque()

    def works(self) -> bool:
        """Try one take; what it may have brought is kept."""
        try:
            self._pending.extend(self._take(limit=1))
        except (AttributeError, TypeError, KeyError):
            return False
        return True

    def drain(self) -> Iterator[Arrival]:
        """Yield what is there now."""
        while self._pending:
            yield self._pending.popleft()
        yield from self._take(limit=None)

    def publisher_count(self) -> int:
        """Matched publishers."""
        return int(self._subscription.get_publisher_count())

    def close(self) -> None:
        """Unsubscribe."""
        self._node.destroy_subscription(self._subscription)

    def _take(self, limit: int | None) -> Iterator[Arrival]:
        taken = 0
        handle = self._subscription.handle
        with handle:
            take = handle.take_message
            while limit is None or taken < limit:
                result = take(self._class, True)
                if result is None:
                    return
                yield _arrival(*result)
                taken += 1


class ExecutorIntake:
    """Takes through a two-argument callback on an executor of its own; good for some ten topics."""

    def __init__(self, node: Node, message_class: type, topic: str, qos: QoSProfile) -> None:
        self._arrivals: deque[Arrival] = deque()
        self._node = Node(
            f"_intake_{id(self):x}",
            context=node.context,
            start_parameter_services=False,
            enable_rosout=False,
            use_global_arguments=False,
        )

        def receive(data: Any, info: Any) -> None:
            self._arrivals.append(_arrival(data, info))

        self._subscription = self._node.create_subscription(message_class, topic, receive, qos, raw=True)
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(self._node)

    def drain(self) -> Iterator[Arrival]:
        """Yield what is there now."""
        empty = 0
        while empty < 2:  # one call may only end the round of the one before
            before = len(self._arrivals)
            self._executor.spin_once(timeout_sec=0.0)
            empty = empty + 1 if len(self._arrivals) == before else 0
        while self._arrivals:
            yield self._arrivals.popleft()

    def publisher_count(self) -> int:
        """Matched publishers."""
        return int(self._subscription.get_publisher_count())

    def close(self) -> None:
        """Unsubscribe."""
        self._executor.remove_node(self._node)
        self._executor.shutdown()
        self._node.destroy_node()


def _arrival(data: bytes, info: Any) -> Arrival:
    return Arrival(
        info["received_timestamp"], info["source_timestamp"], info["publication_sequence_number"] or 0, bytes(data)
    )


def _never(_: object) -> None:
    """The callback that nothing calls."""
