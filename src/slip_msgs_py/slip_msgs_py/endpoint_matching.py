"""Waiting for peers: endpoints matched on both sides before the first message, and a clear line where they are not."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable

from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSCompatibility, qos_check_compatible
from rclpy.subscription import Subscription

FIRST_SAID_S, SAID_AGAIN_S = 1.0, 10.0


def missing_endpoints(
    node: Node, publishers: Iterable[tuple[Publisher, int]], subscriptions: Iterable[Subscription]
) -> list[str]:
    """Return one phrase per endpoint of a node that is not matched yet.

    Args:
        node: the node that owns them.
        publishers: (publisher, least number of subscribers).
        subscriptions: subscriptions that each need at least one publisher.
    """
    phrases = [
        f"{subscription.topic_name} has no {_adjective(node, subscription)}publisher"
        for subscription in subscriptions
        if subscription.get_publisher_count() < 1
    ]
    for publisher, least in publishers:
        count = publisher.get_subscription_count()
        if count < least:
            phrases.append(f"{publisher.topic_name} has {count} of {least} subscribers")
    return phrases


def _adjective(node: Node, subscription: Subscription) -> str:
    """Return what is wrong with publishers that are there but do not match: their QoS."""
    for info in node.get_publishers_info_by_topic(subscription.topic_name):
        verdict, reason = qos_check_compatible(info.qos_profile, subscription.qos_profile)
        if verdict == QoSCompatibility.ERROR:
            return f"QoS-compatible ({' '.join(reason.split()).rstrip(';')}) "
    return ""


class Waiting:
    """Logs what a node waits for: after a moment, and again every so often while that lasts.

    Args:
        report: takes the line.
    """

    def __init__(self, report: Callable[[str], object]) -> None:
        self._report = report
        self._next_s = time.monotonic() + FIRST_SAID_S

    def tell(self, missing: str) -> None:
        """Say what is missing, where it is time to."""
        if time.monotonic() >= self._next_s:
            self._next_s = time.monotonic() + SAID_AGAIN_S
            self._report(f"waits: {missing}")
