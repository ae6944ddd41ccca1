"""Publish a bag's messages as they were recorded: same bytes, same spacing."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Collection
from typing import Final

from rclpy.duration import Duration
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile

from slip_bags.format import TopicInfo
from slip_bags.reader import Bag
from slip_core.errors import InputError, printable
from slip_msgs_py.qos import message_class, profile

DEPTH: Final = 1000
MATCH_LIMIT_S: Final = 5.0
_SLICE_S: Final = 0.02  # longest sleep: a signal ends the wait after it
_ACKNOWLEDGE_S: Final = 1


def play(
    node: Node,
    bag: Bag,
    topics: Collection[str],
    *,
    rate: float,
    loop: bool,
    stop: Callable[[], bool],
    warn: Callable[[str], None],
) -> int:
    """Play to the end of the bag, or until `stop` returns True; return the number of messages.

    Playing starts when every topic has a subscriber, after `MATCH_LIMIT_S` at the latest.

    Args:
        node: a node in no executor.
        bag: the open bag.
        topics: names of the topics to play; empty means all.
        rate: bag seconds per second.
        loop: start again at the end.
        stop: polled before each message.
        warn: called with one line where a topic cannot be played.

    Raises:
        InputError: nothing to play, no such topic, or damaged data.
    """
    publishers: dict[str, Publisher] = {}
    for topic in [bag.topic(name) for name in topics] or bag.topics.values():
        try:
            publishers[topic.name] = node.create_publisher(
                message_class(topic.type_name), topic.name, playing_qos(topic)
            )
        except (InputError, InvalidTopicNameException) as error:
            why = str(error).partition(":\n")[0]
            warn(f"topic {printable(topic.name)} is not played: {why}")
    if bag.span_ns is None or not publishers:
        raise InputError(f"bag {bag.path}", got="no message that can be played", expected="at least one")
    _wait_matched(publishers, stop)
    played = 0
    while True:
        messages = bag.raw(publishers)
        first = list(itertools.islice(messages, 1))  # to open a chunk takes time
        start_s = time.perf_counter()
        for message in itertools.chain(first, messages):
            due_s = start_s + (message.log_time_ns - bag.span_ns[0]) * 1e-9 / rate
            while not stop() and (left_s := due_s - time.perf_counter()) > 0.0:
                time.sleep(min(left_s, _SLICE_S))
            if stop():
                return played
            publishers[message.topic].publish(message.data)
            played += 1
        if not loop:
            break
    for publisher in publishers.values():  # the last messages may still be on their way
        publisher.wait_for_all_acked(Duration(seconds=_ACKNOWLEDGE_S))
    return played


def _wait_matched(publishers: dict[str, Publisher], stop: Callable[[], bool]) -> None:
    end = time.monotonic() + MATCH_LIMIT_S
    while not stop() and time.monotonic() < end:
        if all(publisher.get_subscription_count() for publisher in publishers.values()):
            return
        time.sleep(_SLICE_S)


def playing_qos(topic: TopicInfo) -> QoSProfile:
    """Return what the publishers offered where they agree, else reliable and volatile."""
    offers = {(each.reliability, each.durability) for each in topic.qos}
    reliability, durability = offers.pop() if len(offers) == 1 else ("reliable", "volatile")
    return profile(DEPTH, reliable=reliability != "best_effort", latched=durability == "transient_local")
