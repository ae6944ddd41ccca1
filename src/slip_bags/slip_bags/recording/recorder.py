"""The recorder: find topics, subscribe with fitting QoS, drain everything every `POLL_S` into a bag.

No executor and no decoding. The order in the file is the order of reception. A topic's QoS list and type
hash are frozen when its first message is written.
"""

from __future__ import annotations

import functools
import importlib
import re
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace
from operator import itemgetter
from typing import Any, Final

from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rclpy.type_hash import TypeHash

from slip_bags.format import QosProfile, TopicInfo
from slip_bags.patterns import check_patterns
from slip_bags.reader import RawMessage
from slip_bags.recording.loss_counter import LossCounter
from slip_bags.recording.raw_subscription import Arrival
from slip_bags.recording.subscription import Offer, TopicSubscription
from slip_bags.transforms import Transforms, tf_topic
from slip_bags.typedefs import MessageDefinition, find_definition, split_type_name
from slip_bags.writer import BagWriter
from slip_core.errors import InputError

POLL_S: Final = 0.02  # between two polls
DISCOVERY_EAGER_S: Final = 0.02  # while a requested topic is missing
DISCOVERY_S: Final = 0.1  # while any topic may still appear
LOOK_S: Final = 0.5  # for publishers that took another's place unnoticed
_QUIET_S: Final = 0.03  # nothing for so long: nothing more is under way
_LAST_S: Final = 0.5
_UNANNOUNCED_S: Final = 1.0  # a message may precede the discovery data of its publisher by less than this


@dataclass(frozen=True, slots=True)
class Selection:
    """What to record: topics by name (with type where known), or all that match."""

    topics: tuple[tuple[str, str | None], ...] = ()
    everything: bool = False
    regex: str = ""
    exclude_regex: str = ""
    include_hidden: bool = False

    def check(self) -> None:
        """Find what is wrong before anything is made.

        Raises:
            InputError: a type that is not installed, or a regular expression that is none.
        """
        for _, type_name in self.topics:
            if type_name is not None:
                find_definition(type_name)
        check_patterns(regex=self.regex, exclude_regex=self.exclude_regex)

    def wants(self, topic: str) -> bool:
        """Whether a discovered topic is to be recorded."""
        if self.exclude_regex and re.search(self.exclude_regex, topic):
            return False
        if any(topic == name for name, _ in self.topics):
            return True
        if not self.include_hidden and any(part.startswith("_") for part in topic.split("/")):
            return False
        return self.everything or bool(self.regex and re.search(self.regex, topic))


@dataclass(slots=True)
class _Topic:
    """One recorded topic."""

    name: str
    definition: MessageDefinition
    subscription: TopicSubscription
    announced: bool = False
    held: list[Arrival] = field(default_factory=list)
    held_since: float = 0.0
    largest_batch: int = 0
    loss: LossCounter = field(default_factory=LossCounter)


class Recorder:
    """Records from `node` (added to no executor) into `writer`.

    Args:
        node: a node of the caller; only subscriptions are made on it.
        writer: the open bag.
        selection: what to record.
        queue_depth: messages the middleware keeps per topic between two polls.
        warn: called with one line where something is not recorded as wished.
        ignored: topics that are not recorded although they match.
        transforms: whether `/tf` is made of joint states and odometry and written too.
    """

    def __init__(
        self,
        node: Node,
        writer: BagWriter,
        selection: Selection,
        *,
        queue_depth: int,
        warn: Callable[[str], None],
        ignored: Collection[str] = (),
        transforms: bool = False,
    ) -> None:
        self._node, self._writer, self._warn = node, writer, warn
        self._named = {node.resolve_topic_name(name): kind for name, kind in selection.topics}
        self._selection = replace(selection, topics=tuple(self._named.items()))
        self._depth = queue_depth
        self._ignored = {node.resolve_topic_name(name) for name in ignored}
        self._topics: dict[str, _Topic] = {}
        self._warned: set[str] = set()
        self._next_discovery = self._next_look = 0.0
        self._last_poll: float | None = None
        self._longest_gap_s = 0.0
        self._transforms = Transforms({}) if transforms else None
        self._transforms_made = 0
        for name, type_name in self._named.items():
            if type_name is not None:
                self._subscribe(name, type_name)

    @property
    def ready(self) -> bool:
        """Whether every topic asked for by name has a publisher, matched by the subscription that stays."""
        return all(name in self._topics and self._topics[name].subscription.matched for name in self._named)

    def poll(self) -> int:
        """Discover where due, drain all topics, write in order of reception; returns the number written."""
        now = time.monotonic()
        if self._last_poll is not None:
            self._longest_gap_s = max(self._longest_gap_s, now - self._last_poll)
        self._last_poll = now
        if now >= self._next_discovery:
            self._discover(now)
            self._next_discovery = now + (DISCOVERY_S if self.ready else DISCOVERY_EAGER_S)
        batch: list[tuple[int, str, Arrival]] = []
        for topic in self._topics.values():
            batch += [(arrival.received_ns, topic.name, arrival) for arrival in self._drain(topic, now)]
        batch.sort(key=itemgetter(0))
        for received_ns, name, arrival in batch:
            self._writer.write(name, received_ns, arrival.sent_ns, arrival.sequence, arrival.data)
            if self._transforms is not None:
                self._transform(self._transforms, name, arrival)
        return len(batch)

    def _transform(self, transforms: Transforms, name: str, arrival: Arrival) -> None:
        """Write what a message says of frames; what cannot be said costs a warning, not the recording."""
        raw = RawMessage(name, arrival.received_ns, arrival.sent_ns, arrival.sequence, arrival.data)
        try:
            for made in transforms.feed(raw):
                if not self._writer.has_topic(made.topic):
                    self._writer.add_topic(*tf_topic())
                self._transforms_made += 1
                self._writer.write(made.topic, made.log_time_ns, made.publish_time_ns, made.sequence, made.data)
        except InputError as error:
            self._warn_once(f"no more transforms: {error}")
            self._transforms = None

    def finish(self) -> dict[str, Any]:
        """Drain a last time, unsubscribe, announce topics without messages; returns the summary. The bag stays open."""
        now = time.monotonic()
        end, quiet = now + _LAST_S, now + _QUIET_S
        while (now := time.monotonic()) < min(quiet, end):
            if self.poll():
                quiet = now + _QUIET_S
            time.sleep(_QUIET_S / 10.0)
        for topic in self._topics.values():
            if topic.subscription.offers or topic.held:
                for arrival in self._release(topic):
                    self._writer.write(topic.name, arrival.received_ns, arrival.sent_ns, arrival.sequence, arrival.data)
            topic.subscription.close()
        return self.summary()

    def totals(self) -> tuple[int, int]:
        """Messages received and messages known to be lost."""
        counters = [topic.loss for topic in self._topics.values()]
        return sum(counter.received for counter in counters), sum(counter.lost or 0 for counter in counters)

    def summary(self) -> dict[str, Any]:
        """Counters of the run: per topic and total; `lost` is None where it cannot be known."""
        topics = {
            topic.name: {
                "messages": topic.loss.received,
                "lost": topic.loss.lost,
                "missed_at_start": topic.loss.missed_at_start,
                "largest_batch": topic.largest_batch,
            }
            for topic in sorted(self._topics.values(), key=lambda topic: topic.name)
        }
        messages, lost = self.totals()
        return {
            "messages": messages,
            "lost": lost,
            "lost_unknown": [name for name, topic in topics.items() if topic["lost"] is None],
            "never_published": [name for name in self._named if not self._published(name)],
            **({"transforms": self._transforms_made} if self._transforms_made else {}),
            "queue_depth": self._depth,
            "largest_batch": max((topic.largest_batch for topic in self._topics.values()), default=0),
            "longest_gap_ms": round(self._longest_gap_s * 1e3, 3),
            "topics": topics,
        }

    def _published(self, name: str) -> bool:
        topic = self._topics.get(name)
        return topic is not None and bool(topic.subscription.offers or topic.loss.received)

    def _discover(self, now: float) -> None:
        for name, type_names in self._node.get_topic_names_and_types():
            if name in self._ignored or name in self._topics:
                continue
            if self._selection.wants(name) and self._node.count_publishers(name):
                if len(type_names) == 1:
                    self._subscribe(name, type_names[0])
                else:
                    self._warn_once(f"topic {name} has several types ({', '.join(type_names)}): not recorded")
        whole = now >= self._next_look
        if whole:
            self._next_look = now + LOOK_S
        for topic in self._topics.values():
            # To ask for everything about every publisher costs more than to record; their number is cheap.
            if whole or self._node.count_publishers(topic.name) != len(topic.subscription.offers):
                topic.subscription.follow(now)
                topic.loss.see_publishers(len(topic.subscription.offers))

    def _subscribe(self, name: str, type_name: str) -> None:
        try:
            definition = find_definition(type_name)
            package, kind = split_type_name(type_name)
            message_class = getattr(importlib.import_module(f"{package}.msg"), kind)
        except (InputError, ImportError, AttributeError) as error:
            self._warn_once(f"topic {name} is not recorded: {error}")
            return

        def ask() -> tuple[Offer, ...]:
            return self._offers(name, type_name)

        subscription = TopicSubscription(self._node, message_class, name, self._depth, ask)
        self._topics[name] = _Topic(name, definition, subscription)
        if self._transforms is not None:
            self._transforms.add_topic(name, type_name)

    def _offers(self, name: str, type_name: str) -> tuple[Offer, ...]:
        infos = self._node.get_publishers_info_by_topic(name)
        fitting = tuple(_offer(info) for info in infos if info.topic_type == type_name)
        if len(fitting) != len(infos):
            self._warn_once(f"topic {name}: publishers of other types than {type_name} are not recorded")
        return fitting

    def _drain(self, topic: _Topic, now: float) -> list[Arrival]:
        arrivals = topic.subscription.drain(now)
        topic.largest_batch = max(topic.largest_batch, len(arrivals))
        for arrival in arrivals:
            topic.loss.add(arrival)
        return arrivals if topic.announced else self._announce(topic, arrivals, now)

    def _announce(self, topic: _Topic, arrivals: list[Arrival], now: float) -> list[Arrival]:
        """Write the topic into the bag with its first message; until its publisher is known, hold messages back."""
        if arrivals and not topic.held:
            topic.held_since = now
        topic.held += arrivals
        if not topic.held:
            return []
        if not topic.subscription.offers:
            topic.subscription.follow(now)
            if not topic.subscription.offers and now < topic.held_since + _UNANNOUNCED_S:
                return []
        return self._release(topic)

    def _release(self, topic: _Topic) -> list[Arrival]:
        if not topic.announced:
            self._writer.add_topic(self._topic_info(topic), topic.definition.text)
            topic.announced = True
        held, topic.held = topic.held, []
        return held

    def _topic_info(self, topic: _Topic) -> TopicInfo:
        """Describe a topic by its publishers, as rosbag2 does; where their hashes differ there is none."""
        offers, definition = topic.subscription.offers, topic.definition
        hashes = {offer.type_hash for offer in offers} or {definition.type_hash}
        type_hash = hashes.pop() if len(hashes) == 1 else ""
        if definition.type_hash not in (type_hash, ""):
            self._warn_once(f"topic {topic.name}: its publisher uses another version of {definition.name}")
        return TopicInfo(topic.name, definition.name, tuple(offer.qos for offer in offers), type_hash)

    def _warn_once(self, text: str) -> None:
        if text not in self._warned:
            self._warned.add(text)
            self._warn(text)


@functools.lru_cache
def _hash_text(version: int, value: bytes) -> str:
    return str(TypeHash(version=version, value=value))


def _offer(info: TopicEndpointInfo) -> Offer:
    """Turn rclpy's description of a publisher into ours."""
    qos, found = info.qos_profile, info.topic_type_hash
    type_hash = _hash_text(found.version, bytes(found.value))
    return Offer(
        gid=tuple(info.endpoint_gid),
        type_hash=type_hash if type_hash.startswith("RIHS") else "",
        qos=QosProfile(
            reliability=qos.reliability.name.lower(),
            durability=qos.durability.name.lower(),
            history=qos.history.name.lower(),
            depth=qos.depth,
            deadline_ns=qos.deadline.nanoseconds,
            lifespan_ns=qos.lifespan.nanoseconds,
            liveliness=qos.liveliness.name.lower(),
            liveliness_lease_ns=qos.liveliness_lease_duration.nanoseconds,
            avoid_ros_namespace_conventions=qos.avoid_ros_namespace_conventions,
        ),
    )
