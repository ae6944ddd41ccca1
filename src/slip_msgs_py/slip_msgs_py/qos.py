"""QoS profiles made from the topic table."""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable
from typing import Any, TypeAlias

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from slip_core.errors import InputError
from slip_core.topics import topic
from slip_msgs_py.node_shell import NodePart

NodeLike: TypeAlias = Node | NodePart


def message_class(type_name: str) -> Any:
    """Return the generated class of ``pkg/msg/Type``.

    Raises:
        InputError: the name is not of this form, or the type is not installed.
    """
    match = re.fullmatch(r"([a-zA-Z]\w*)/msg/([a-zA-Z]\w*)", type_name)
    if match is None:
        raise InputError("message type", got=type_name, expected="package/msg/Name, e.g. sensor_msgs/msg/JointState")
    try:
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


def create_publisher(node: NodeLike, name: str, *, actual_name: str | None = None, events: bool = True) -> Publisher:
    """Create the publisher of a topic of the table, under another name where one contact of many needs it.

    Without `events` rclpy warns of no incompatible subscriber, and a destroyed publisher is gone at once: an executor
    keeps the events, and with them the publisher, until its next round.
    """
    row = topic(name)
    callbacks = PublisherEventCallbacks(use_default_callbacks=events)
    qos = profile(1 if row.latched else row.depth, reliable=True, latched=row.latched)
    return node.create_publisher(message_class(row.type), actual_name or name, qos, event_callbacks=callbacks)


def create_subscription(
    node: NodeLike,
    name: str,
    callback: Callable[[Any], None],
    *,
    depth: int,
    reliable: bool,
    actual_name: str | None = None,
    raw: bool = False,
) -> Subscription:
    """Create a subscription to a topic of the table; a raw one hands over bytes.

    `reliable` False accepts any publisher, also a real driver's best-effort sensor data; True never
    loses a message, which lockstep needs.
    """
    row = topic(name)
    qos = profile(1 if row.latched else depth, reliable=reliable or row.latched, latched=row.latched)
    return node.create_subscription(message_class(row.type), actual_name or name, callback, qos, raw=raw)
