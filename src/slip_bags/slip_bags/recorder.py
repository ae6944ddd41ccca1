"""The recorder: find topics, subscribe with fitting QoS, drain everything every `POLL_S` into a bag.

No executor and no decoding. The order in the file is the order of reception. A topic's QoS list and type
hash are those at its first discovery.
"""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import Any, Final

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rclpy.type_hash import TypeHash

from slip_bags.format import QosProfile, RawMessage, TopicInfo
from slip_bags.typedefs import find_definition
from slip_bags.writer import BagWriter, StorageError
from slip_core.errors import InputError
from slip_msgs_py import events
from slip_msgs_py.qos import message_class, profile

QUEUE_DEPTH: Final = 10_000  # messages per topic that wait for the recorder: 10 s at 1 kHz
POLL_S: Final = 0.02  # between two polls
DISCOVERY_S: Final = 0.1  # between two discoveries, once every requested topic is found
FLUSH_S: Final = 1.0
MIN_FREE_BYTES: Final = 64 << 20
_LAST_S: Final = 0.1  # for what is still on its way at the end


@dataclass(slots=True)
class LossCounter:
    """Count the messages that were published and not received: exact while one publisher sends at a time.

    A publisher numbers its messages 1, 2, 3 ..., and they are taken in the order of sending. They do not name their
    publisher, so with two at once nothing can be said and `lost` is None. What the first publisher sent before the
    first received message is not lost.
    """

    received: int = 0
    lost: int | None = 0
    _last: int = 0

    def add(self, sequence: int) -> None:
        """Count one received message; number 0 is of a middleware that does not number."""
        self.received += 1
        if sequence == 0:
            self.lost = None
        elif self._last and sequence > self._last and self.lost is not None:
            self.lost += sequence - self._last - 1
        self._last = sequence  # a lower number is of the next publisher, again from 1


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
    """

    def __init__(self, node: Node, kind: type, name: str, requested: QoSProfile) -> None:
        self.kind, self.name, self.requested = kind, name, requested
        self.publishers, self.loss = 0, LossCounter()
        self.subscription = node.create_subscription(kind, name, lambda _: None, requested, raw=True)
        self._last_ns = 0

    def drain(self) -> Iterator[RawMessage]:
        """Yield what is there now, in the order of sending and with times that do not go back.

        What was lost on its way and sent again makes those behind it wait, though they were received before it.
        """
        handle = self.subscription.handle
        with handle:
            while (taken := handle.take_message(self.kind, True)) is not None:
                data, info = taken
                self._last_ns = max(self._last_ns, info["received_timestamp"])
                number = info["publication_sequence_number"] or 0
                self.loss.add(number)
                yield RawMessage(self.name, self._last_ns, info["source_timestamp"], number, bytes(data))


class Recorder:
    """Records from `node` (in no executor) into `writer`.

    Args:
        node: a node of the caller; only subscriptions are made on it.
        writer: the open bag.
        topics: names of the topics to record.
        everything: record every topic, except hidden ones (a part of the name starts with an underscore).
        warn: called with one line where a topic is not recorded as requested.
    """

    def __init__(
        self, node: Node, writer: BagWriter, topics: Sequence[str], *, everything: bool, warn: Callable[[str], None]
    ) -> None:
        self._node, self._writer, self._warn = node, writer, warn
        self._named = {node.resolve_topic_name(name) for name in topics}
        self._everything = everything
        self._topics: dict[str, RawSubscription] = {}
        self._warned: set[str] = set()
        self._next_discovery = 0.0

    @property
    def ready(self) -> bool:
        """Whether every topic requested by name has a publisher, and all of them are matched."""
        return all(
            (topic := self._topics.get(name)) is not None
            and topic.subscription.get_publisher_count() >= max(topic.publishers, 1)
            for name in self._named
        )

    def poll(self) -> None:
        """Discover where due, drain all topics, write in order of reception.

        Raises:
            StorageError: the disk refuses.
        """
        now = time.monotonic()
        if now >= self._next_discovery:
            self._discover()
            self._next_discovery = now + (DISCOVERY_S if self.ready else POLL_S)
        messages = [message for topic in self._topics.values() for message in topic.drain()]
        for message in sorted(messages, key=attrgetter("log_time_ns")):
            self._writer.write(*message)

    def finish(self) -> dict[str, Any]:
        """Drain a last time and unsubscribe; return the summary. The bag stays open."""
        end = time.monotonic() + _LAST_S
        while time.monotonic() < end:
            self.poll()
            time.sleep(POLL_S)
        for topic in self._topics.values():
            self._node.destroy_subscription(topic.subscription)
        return self.summary()

    def totals(self) -> tuple[int, int]:
        """Return the messages received and the messages known to be lost."""
        counters = [topic.loss for topic in self._topics.values()]
        return sum(counter.received for counter in counters), sum(counter.lost or 0 for counter in counters)

    def summary(self) -> dict[str, Any]:
        """Return the counters of the run, per topic and total; `lost` is None where it is unknown."""
        counters = {name: LossCounter() for name in self._named}
        counters |= {name: topic.loss for name, topic in self._topics.items()}
        messages, lost = self.totals()
        each = {name: {"messages": one.received, "lost": one.lost} for name, one in sorted(counters.items())}
        return {"messages": messages, "lost": lost, "topics": each}

    def _discover(self) -> None:
        for name, type_names in self._node.get_topic_names_and_types():
            wanted = name in self._named or (self._everything and "/_" not in name)
            if wanted and name not in self._topics:
                self._find(name, type_names)
        for name, topic in self._topics.items():
            # The number of publishers is cheap to read, their QoS is not.
            if self._node.count_publishers(name) != topic.publishers:
                infos = self._node.get_publishers_info_by_topic(name)
                topic.publishers = len(infos)
                if len(infos) > 1:
                    topic.loss.lost = None
                offered, heard = _common([info.qos_profile for info in infos]), _common([topic.requested])
                if any(now < before for now, before in zip(offered, heard, strict=True)):
                    self._warn_once(f"topic {name}: a publisher that offers a weaker QoS than the first is not heard")

    def _find(self, name: str, type_names: Sequence[str]) -> None:
        """Subscribe to a topic that has a publisher."""
        infos = self._node.get_publishers_info_by_topic(name)
        if not infos:
            return
        if len(type_names) > 1:
            self._warn_once(f"topic {name} has several types ({', '.join(type_names)}): not recorded")
            return
        try:
            definition, kind = find_definition(type_names[0]), message_class(type_names[0])
        except InputError as error:
            self._warn_once(f"topic {name} is not recorded: {error}")
            return
        hashes = {_hash_text(info) for info in infos}
        type_hash = hashes.pop() if len(hashes) == 1 else ""
        self._writer.add_topic(TopicInfo(name, type_names[0], tuple(map(_offer, infos)), type_hash), definition)
        reliable, latched = _common([info.qos_profile for info in infos])
        requested = profile(QUEUE_DEPTH, reliable=reliable, latched=latched)
        self._topics[name] = RawSubscription(self._node, kind, name, requested)

    def _warn_once(self, text: str) -> None:
        if text not in self._warned:
            self._warned.add(text)
            self._warn(text)


def record(
    node: Node,
    output: Path,
    topics: Sequence[str],
    stop: Callable[[], bool],
    *,
    everything: bool = False,
    custom_data: Mapping[str, str] | None = None,
    attachments: Mapping[str, bytes] | None = None,
) -> dict[str, Any]:
    """Record until `stop` returns True; return the summary, which the bag has too.

    Args:
        node: a node in no executor.
        output: folder of the new bag.
        topics: names of the topics to record.
        stop: polled every `POLL_S`.
        everything: record every topic that appears.
        custom_data: texts for ``metadata.yaml``.
        attachments: files stored in the bag, by name.

    Raises:
        InputError: the output exists.
        StorageError: the disk is full or refuses.
    """
    writer = BagWriter(output, custom_data, attachments)
    try:
        warn = partial(events.warn, "recorder")
        recorder = Recorder(node, writer, topics, everything=everything, warn=warn)
        announced, next_flush = False, time.monotonic() + FLUSH_S
        while not stop():
            recorder.poll()
            if not announced and recorder.ready:
                announced = True
                events.emit("ready")
            if time.monotonic() >= next_flush:
                _flush(writer)
                next_flush = time.monotonic() + FLUSH_S
                messages, lost = recorder.totals()
                events.emit("status", messages=messages, lost=lost)
            time.sleep(POLL_S)
        summary = recorder.finish()
        writer.custom_data["recorder"] = json.dumps(summary)
        return {"bag": str(output), **summary}
    finally:
        writer.close()


def _flush(writer: BagWriter) -> None:
    free = shutil.disk_usage(writer.folder).free
    if free < MIN_FREE_BYTES:
        raise StorageError(
            f"bag {writer.folder}: {free >> 20} MiB left on the disk, less than {MIN_FREE_BYTES >> 20}; "
            "recording stopped, bag closed and readable"
        )
    writer.flush()


def _common(profiles: Sequence[QoSProfile]) -> tuple[bool, bool]:
    """Return whether every one is reliable, and whether every one is transient local."""
    return (
        all(each.reliability == ReliabilityPolicy.RELIABLE for each in profiles),
        all(each.durability == DurabilityPolicy.TRANSIENT_LOCAL for each in profiles),
    )


def _hash_text(info: TopicEndpointInfo) -> str:
    """Return the RIHS01 text of a publisher's type hash, "" where it is not known."""
    text = str(TypeHash(version=info.topic_type_hash.version, value=bytes(info.topic_type_hash.value)))
    return text if text.startswith("RIHS") else ""


def _offer(info: TopicEndpointInfo) -> QosProfile:
    return QosProfile(info.qos_profile.reliability.name.lower(), info.qos_profile.durability.name.lower())
