"""QoS profiles made from the topic table, and endpoints that are matched on both sides before the first message."""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable, Iterable
from typing import Any, Final, TypeAlias

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSCompatibility, QoSProfile, ReliabilityPolicy, qos_check_compatible
from rclpy.subscription import Subscription

from slip_core.errors import InputError
from slip_core.files.resources import find_file
from slip_core.topics import topic
from slip_msgs_py.node_shell import NodePart

NodeLike: TypeAlias = Node | NodePart
SAID_AGAIN_S: Final = 10.0  # between two lines that say what a node waits for


def message_class(type_name: str) -> Any:
    """Return the generated class of ``pkg/msg/Type``.

    Raises:
        InputError: the name is not of this form, or the type is not installed.
    """
    match = re.fullmatch(r"([a-zA-Z]\w*)/msg/([a-zA-Z]\w*)", type_name)
    if match is None:
        raise InputError("message type", got=type_name, expected="package/msg/Name, e.g. sensor_msgs/msg/JointState")
    try:
        if not find_file(f"package://{match[1]}/msg/{match[2]}.msg").is_file():  # a bag may name any package
            raise ImportError("no such definition")
        return getattr(importlib.import_module(f"{match[1]}.msg"), match[2])
    except (ImportError, AttributeError) as error:
        raise InputError(f"message type {type_name}", got=error, expected="an installed message package") from None


def profile(depth: int, *, reliable: bool, latched: bool) -> QoSProfile:
    """Return the profile that keeps the last `depth` messages; latched: late subscribers get them too."""
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def create_publisher(node: NodeLike, name: str) -> Publisher:
    """Create the publisher of a topic of the table.

    It has no events: an executor keeps them, and with them a destroyed publisher, until its next round.
    """
    row = topic(name)
    qos = profile(1 if row.latched else row.depth, reliable=True, latched=row.latched)
    silent = PublisherEventCallbacks(use_default_callbacks=False)
    return node.create_publisher(message_class(row.type), name, qos, event_callbacks=silent)


def create_subscription(
    node: NodeLike, name: str, callback: Callable[[Any], None], *, depth: int, reliable: bool, raw: bool = False
) -> Subscription:
    """Create a subscription to a topic of the table; a raw one hands over bytes.

    `reliable` False accepts any publisher, also a real driver's best-effort sensor data; True never
    loses a message, which lockstep needs.
    """
    row = topic(name)
    qos = profile(1 if row.latched else depth, reliable=reliable or row.latched, latched=row.latched)
    return node.create_subscription(message_class(row.type), name, callback, qos, raw=raw)


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
