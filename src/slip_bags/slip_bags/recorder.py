"""The recorder: find topics, subscribe with fitting QoS, drain everything every `POLL_S` into a bag.

No executor and no decoding. The order in the file is the order of reception. A topic's QoS list is that of its first
discovery.
"""

from __future__ import annotations

import functools
import json
import re
import time
from collections.abc import Callable, Iterator, Sequence
from operator import attrgetter
from typing import Final

from rclpy.node import Node
from rclpy.qos import QoSCompatibility, QoSProfile, qos_check_compatible

from slip_bags.format import BagMessage, QosProfile, TopicInfo
from slip_bags.writer import BagWriter
from slip_core.errors import InputError
from slip_core.files.resources import read_text
from slip_msgs_py.environment import warn
from slip_msgs_py.qos import message_class, profile

QUEUE_DEPTH: Final = 10_000  # messages per topic that wait for the recorder: 10 s at 1 kHz
POLL_S: Final = 0.02  # between two polls
DISCOVERY_S: Final = 0.1  # between two discoveries
FLUSH_S: Final = 1.0
_DELIMITER: Final = "\n" + "=" * 80 + "\nMSG: "
_LAST_S: Final = 0.1  # for what is still on its way at the end


@functools.cache
def find_definition(type_name: str) -> str:
    """Return the text of ``pkg/msg/Type`` as rosbag2 stores it: depth first, dependencies sorted, each once.

    Raises:
        InputError: the name is not of this form or the type is not installed.
    """
    package, _, name = type_name.partition("/msg/")
    texts: dict[str, str] = {}
    left = [(package, name)]
    while left:
        package, name = left.pop()
        if f"{package}/{name}" not in texts:
            fields = message_class(f"{package}/msg/{name}").get_fields_and_field_types()
            text = read_text(f"package://{package}/msg/{name}.msg", f"message type {package}/msg/{name}")
            texts[f"{package}/{name}"] = f"{_DELIMITER}{package}/{name}\n{text}" if texts else text
            left += sorted(set(re.findall(r"(\w+)/(\w+)", " ".join(fields.values()))), reverse=True)
    return "".join(texts.values())


class RawSubscription:
    """Takes raw messages of one topic with their times and numbers, without decoding; its node must be in no executor.

    `rclpy` hands these only to its own executors; the method they call is used here directly.

    Args:
        node: owner of the subscription.
        kind: class of the messages.
        name: of the topic.
        requested: of its publishers.

    Attributes:
        publishers: how many there are.
        lost: messages that were published and not received, counted while one publisher sends at a time: publishers
            number their messages 1, 2, 3 ... without their names. What the first one sent before the first received
            message is not lost.
    """

    def __init__(self, node: Node, kind: type, name: str, requested: QoSProfile) -> None:
        self.kind, self.name, self.requested = kind, name, requested
        self.publishers = self.lost = 0
        self.subscription = node.create_subscription(kind, name, lambda _: None, requested, raw=True)
        self._last_ns = self._last = 0

    def drain(self) -> Iterator[BagMessage]:
        """Yield what is there now, in the order of sending and with times that do not go back.

        What was lost on its way and sent again makes those behind it wait, though they were received before it.
        """
        handle = self.subscription.handle
        with handle:
            while (taken := handle.take_message(self.kind, True)) is not None:
                data, info = taken
                self._last_ns = max(self._last_ns, info["received_timestamp"])
                number = info["publication_sequence_number"] or 0  # 0: a middleware that does not number
                if self.publishers <= 1 and 0 < self._last < number:
                    self.lost += number - self._last - 1
                self._last = number  # a lower number is of the next publisher, again from 1
                yield BagMessage(self.name, self._last_ns, info["source_timestamp"], number, bytes(data))


class Recorder:
    """Records from `node` (in no executor) into `writer`.

    Args:
        node: a node of the caller; only subscriptions are made on it.
        writer: the open bag.
        topics: names of the topics to record.
        everything: record every topic, except hidden ones (a part of the name starts with an underscore).
    """

    def __init__(self, node: Node, writer: BagWriter, topics: Sequence[str], *, everything: bool) -> None:
        self._node, self._writer = node, writer
        self._named = {node.resolve_topic_name(name) for name in topics}
        self._everything = everything
        self._topics: dict[str, RawSubscription] = {}
        self._refused: set[str] = set()
        self._next_discovery = 0.0

    def poll(self) -> None:
        """Discover where due, drain all topics, write in order of reception.

        Raises:
            StorageError: the disk refuses.
        """
        if time.monotonic() >= self._next_discovery:
            self._discover()
            self._next_discovery = time.monotonic() + DISCOVERY_S
        messages = [message for topic in self._topics.values() for message in topic.drain()]
        for message in sorted(messages, key=attrgetter("log_time_ns")):
            self._writer.write(*message)

    def run(self, stop: Callable[[], bool]) -> tuple[int, int]:
        """Record until `stop` returns True; return the messages received and lost; the bag has the lost ones by topic.

        Raises:
            StorageError: the disk refuses.
        """
        next_flush = time.monotonic() + FLUSH_S
        while not stop():
            self.poll()
            if time.monotonic() >= next_flush:
                self._writer.flush()
                next_flush = time.monotonic() + FLUSH_S
            time.sleep(POLL_S)
        time.sleep(_LAST_S)
        self.poll()
        lost = {name: topic.lost for name, topic in self._topics.items() if topic.lost}
        self._writer.custom_data["lost"] = json.dumps(lost)
        return self._writer.counts.total(), sum(lost.values())

    def _discover(self) -> None:
        for name, type_names in self._node.get_topic_names_and_types():
            wanted = name in self._named or (self._everything and "/_" not in name)
            if wanted and name not in self._topics and name not in self._refused:
                self._find(name, type_names)
        for name, topic in self._topics.items():
            # The number of publishers is cheap to read, their QoS is not.
            if self._node.count_publishers(name) != topic.publishers:
                infos = self._node.get_publishers_info_by_topic(name)
                topic.publishers = len(infos)
                checks = [qos_check_compatible(info.qos_profile, topic.requested)[0] for info in infos]
                if QoSCompatibility.ERROR in checks:
                    text = "a publisher that offers a weaker QoS than the first is not heard"
                    warn("recorder", f"topic {name}: {text}")

    def _find(self, name: str, type_names: Sequence[str]) -> None:
        """Subscribe to a topic that has a publisher."""
        offers = [info.qos_profile for info in self._node.get_publishers_info_by_topic(name)]
        if not offers:
            return
        try:
            if len(type_names) > 1:
                raise InputError("type", got=", ".join(type_names), expected="one")
            definition, kind = find_definition(type_names[0]), message_class(type_names[0])
        except InputError as error:
            self._refused.add(name)
            warn("recorder", f"topic {name} is not recorded: {error}")
            return
        qos = tuple(QosProfile(one.reliability.name.lower(), one.durability.name.lower()) for one in offers)
        self._writer.add_topic(TopicInfo(name, type_names[0], qos), definition)
        requested = profile(
            QUEUE_DEPTH,
            reliable=all(one.reliability == "reliable" for one in qos),
            latched=all(one.durability == "transient_local" for one in qos),
        )
        self._topics[name] = RawSubscription(self._node, kind, name, requested)
