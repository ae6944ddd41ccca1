"""Publish a bag's messages as they were recorded: same bytes, same spacing."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from typing import Final

from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.publisher import Publisher

from slip_bags.format import QosProfile
from slip_bags.reader import Bag
from slip_core.errors import InputError, printable
from slip_msgs_py.environment import warn
from slip_msgs_py.node_main import deliver
from slip_msgs_py.qos import message_class, profile

DEPTH: Final = 1000
MATCH_LIMIT_S: Final = 5.0
_SLICE_S: Final = 0.02  # longest sleep: a signal ends the wait after it
_ACKNOWLEDGE_S: Final = 1.0


def play(node: Node, bag: Bag, topics: Collection[str], *, rate: float, loop: bool, stop: Callable[[], bool]) -> int:
    """Play to the end of the bag, or until `stop` returns True; return the number of messages.

    Playing starts when every topic has a subscriber, after `MATCH_LIMIT_S` at the latest. A topic is offered as its
    publishers did where they agree, else reliable and volatile.

    Args:
        node: a node in no executor.
        bag: the open bag.
        topics: names of the topics to play; empty means all.
        rate: bag seconds per second.
        loop: start again at the end.
        stop: polled before each message.

    Raises:
        InputError: nothing to play, no such topic, or damaged data.
    """
    publishers: dict[str, Publisher] = {}
    for topic in [bag.topic(name) for name in topics] or bag.topics.values():
        offer = topic.qos[0] if len(set(topic.qos)) == 1 else QosProfile()
        latched = offer.durability == "transient_local"
        qos = profile(DEPTH, reliable=offer.reliability != "best_effort", latched=latched)
        try:
            publishers[topic.name] = node.create_publisher(message_class(topic.type_name), topic.name, qos)
        except (InputError, InvalidTopicNameException) as error:
            why = str(error).partition(":\n")[0]
            warn("player", f"topic {printable(topic.name)} is not played: {printable(why)}")
    if bag.span_ns is None or not publishers:
        raise InputError(f"bag {bag.path}", got="no message that can be played", expected="at least one")
    end_s = time.monotonic() + MATCH_LIMIT_S
    while not all(publisher.get_subscription_count() for publisher in publishers.values()):
        if stop() or time.monotonic() > end_s:
            break
        time.sleep(_SLICE_S)
    played = 0
    while True:
        start_s = 0.0
        for message in bag.raw(publishers):
            start_s = start_s or time.perf_counter()  # once the first chunk is open, which takes time
            due_s = start_s + (message.log_time_ns - bag.span_ns[0]) * 1e-9 / rate
            while not stop() and (left_s := due_s - time.perf_counter()) > 0.0:
                time.sleep(min(left_s, _SLICE_S))
            if stop():
                return played
            publishers[message.topic].publish(message.value)
            played += 1
        if not loop:
            break
    deliver(node, _ACKNOWLEDGE_S)
    return played
