"""The recorder: find topics, subscribe with fitting QoS, drain everything every few milliseconds into a bag.

No executor and no decoding. The order in the file is the order of reception. A topic's QoS list and type
hash are frozen when its first message is written.
"""

from __future__ import annotations

import importlib
import re
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from typing import Any, Final

from rclpy.node import Node

from slip_bringup.bags.format import QosProfile, TopicInfo
from slip_bringup.bags.intake import Arrival, Intake, open_intake, recording_qos
from slip_bringup.bags.loss import LossCounter
from slip_bringup.bags.typedefs import MessageDefinition, find_definition, split_type_name
from slip_bringup.bags.writer import BagWriter
from slip_msgs_py.errors import InputError

DISCOVERY_EAGER_S: Final = 0.02  # while a requested topic is missing
DISCOVERY_S: Final = 0.1  # while any topic may still appear
OVERLAP_S: Final = 0.5  # both subscriptions stay this long after the new one has matched
OVERLAP_LIMIT_S: Final = 5.0  # and not longer where a publisher never matches
_UNANNOUNCED_S: Final = 1.0  # a message may precede the discovery data of its publisher by less than this


@dataclass(frozen=True, slots=True)
class Selection:
    """What to record: topics by name (with type where known), or all that match."""

    topics: tuple[tuple[str, str | None], ...] = ()
    everything: bool = False
    regex: str = ""
    exclude_regex: str = ""
    include_hidden: bool = False

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
    """One subscribed topic."""

    name: str
    message_class: type
    definition: MessageDefinition
    intake: Intake
    strength: tuple[bool, bool]  # what is asked for: reliable, transient local
    requested: bool
    offers: tuple[QosProfile, ...] = ()
    publisher_hash: str = ""
    announced: bool = False
    retiring: Intake | None = None
    retire_at: float | None = None
    retire_latest: float = 0.0
    settled: bool = False  # whether the final subscription is the only one; until then messages may come twice
    seen: set[tuple[int, int]] = field(default_factory=set)
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
        clock: monotonic seconds, for discovery and overlap.
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
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._node, self._writer, self._warn, self._clock = node, writer, warn, clock
        named = tuple((node.resolve_topic_name(name), kind) for name, kind in selection.topics)
        self._selection = Selection(
            named, selection.everything, selection.regex, selection.exclude_regex, selection.include_hidden
        )
        self._depth = queue_depth
        self._ignored = {node.resolve_topic_name(name) for name in ignored}
        self._topics: dict[str, _Topic] = {}
        self._warned: set[str] = set()
        self._next_discovery = 0.0
        self._last_poll: float | None = None
        self._longest_gap_s = 0.0
        for name, type_name in named:
            if type_name is not None:
                self._subscribe(name, type_name, (False, False))

    @property
    def ready(self) -> bool:
        """Whether every topic asked for by name has a matched publisher on its final subscription."""
        for name, _ in self._selection.topics:
            topic = self._topics.get(name)
            if topic is None or not topic.offers or not topic.intake.publisher_count():
                return False
            if topic.retiring is not None and topic.retire_at is None:
                return False
        return True

    def poll(self) -> int:
        """Discover where due, drain all topics, write in order of reception; returns the number written."""
        now = self._clock()
        if self._last_poll is not None:
            self._longest_gap_s = max(self._longest_gap_s, now - self._last_poll)
        self._last_poll = now
        if now >= self._next_discovery:
            self._discover()
            self._next_discovery = now + (DISCOVERY_S if self.ready else DISCOVERY_EAGER_S)
        batch: list[tuple[int, str, Arrival]] = []
        for topic in self._topics.values():
            batch += [(arrival.received_ns, topic.name, arrival) for arrival in self._drain(topic, now)]
        batch.sort(key=_received)
        for _, name, arrival in batch:
            self._writer.write(name, arrival.received_ns, arrival.sent_ns, arrival.sequence, arrival.data)
        return len(batch)

    def finish(self) -> dict[str, Any]:
        """Drain a last time, unsubscribe, announce topics without messages; returns the summary. The bag stays open."""
        self.poll()
        for topic in self._topics.values():
            if topic.offers or topic.held:
                self._write_held(topic)
            for intake in filter(None, (topic.intake, topic.retiring)):
                intake.close()
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
        known = [topic["lost"] for topic in topics.values() if topic["lost"] is not None]
        return {
            "messages": sum(topic.loss.received for topic in self._topics.values()),
            "lost": sum(known),
            "lost_unknown": [name for name, topic in topics.items() if topic["lost"] is None],
            "never_published": [name for name, _ in self._selection.topics if not self._published(name)],
            "queue_depth": self._depth,
            "largest_batch": max((topic.largest_batch for topic in self._topics.values()), default=0),
            "longest_gap_ms": round(self._longest_gap_s * 1e3, 3),
            "topics": topics,
        }

    def _published(self, name: str) -> bool:
        topic = self._topics.get(name)
        return topic is not None and bool(topic.offers or topic.loss.received)

    def _discover(self) -> None:
        for name, type_names in self._node.get_topic_names_and_types():
            if name in self._ignored or name in self._topics:
                continue
            if self._selection.wants(name) and self._node.count_publishers(name):
                if len(type_names) != 1:
                    self._warn_once(f"topic {name} has several types ({', '.join(type_names)}): not recorded")
                    continue
                self._subscribe(name, type_names[0], self._strength(self._offers(name, type_names[0])[0]))
        for topic in self._topics.values():
            self._match(topic)

    def _subscribe(self, name: str, type_name: str, strength: tuple[bool, bool]) -> None:
        try:
            definition = find_definition(type_name)
            package, kind = split_type_name(type_name)
            message_class = getattr(importlib.import_module(f"{package}.msg"), kind)
        except (InputError, ImportError, AttributeError) as error:
            if any(name == wanted and kind is not None for wanted, kind in self._selection.topics):
                raise
            self._warn_once(f"topic {name} is not recorded: {error}")
            return
        requested = any(name == wanted for wanted, _ in self._selection.topics)
        self._topics[name] = _Topic(
            name, message_class, definition, self._open(name, message_class, strength), strength, requested
        )

    def _open(self, name: str, message_class: type, strength: tuple[bool, bool]) -> Intake:
        reliable, transient_local = strength
        qos = recording_qos(self._depth, reliable=reliable, transient_local=transient_local)
        return open_intake(self._node, message_class, name, qos)

    def _offers(self, name: str, type_name: str) -> tuple[tuple[QosProfile, ...], str]:
        """Return the QoS of every publisher of the topic, and their common type hash ("" where they disagree)."""
        infos = self._node.get_publishers_info_by_topic(name)
        fitting = [info for info in infos if info.topic_type == type_name]
        if len(fitting) != len(infos):
            self._warn_once(f"topic {name}: publishers of other types than {type_name} are not recorded")
        hashes = {str(info.topic_type_hash) for info in fitting}
        common = hashes.pop() if len(hashes) == 1 else ""
        return tuple(_profile(info.qos_profile) for info in fitting), common if common.startswith("RIHS") else ""

    def _match(self, topic: _Topic) -> None:
        """Follow the publishers that are there: ask for the strongest QoS that all of them offer."""
        offers, publisher_hash = self._offers(topic.name, topic.definition.name)
        topic.loss.see_publishers(len(offers))
        if not offers:
            return
        topic.offers = offers
        topic.publisher_hash = publisher_hash
        if publisher_hash and topic.definition.type_hash and publisher_hash != topic.definition.type_hash:
            self._warn_once(f"topic {topic.name}: its publisher uses another version of {topic.definition.name}")
        wanted = self._strength(offers)
        if topic.settled:  # a stronger subscription would bring latched messages a second time
            wanted = (wanted[0] and topic.strength[0], wanted[1] and topic.strength[1])
        if wanted != topic.strength and topic.retiring is None:
            topic.retiring, topic.strength, topic.settled = topic.intake, wanted, False
            topic.retire_latest = self._clock() + OVERLAP_LIMIT_S
            topic.intake = self._open(topic.name, topic.message_class, wanted)

    @staticmethod
    def _strength(offers: tuple[QosProfile, ...]) -> tuple[bool, bool]:
        return (
            bool(offers) and all(offer.reliability == "reliable" for offer in offers),
            bool(offers) and all(offer.durability == "transient_local" for offer in offers),
        )

    def _drain(self, topic: _Topic, now: float) -> list[Arrival]:
        arrivals = list(topic.intake.drain())
        settled = topic.settled
        if not settled:
            arrivals = self._settle(topic, arrivals, now)
        topic.largest_batch = max(topic.largest_batch, len(arrivals))
        for arrival in arrivals:
            topic.loss.add(arrival, ordered=settled)
        if topic.announced:
            return arrivals
        return self._announce(topic, arrivals, now)

    def _settle(self, topic: _Topic, arrivals: list[Arrival], now: float) -> list[Arrival]:
        """Drop what both subscriptions brought; retire the old one some time after the new one has matched."""
        if topic.retiring is not None:
            arrivals = [*topic.retiring.drain(), *arrivals]
        fresh = []
        for arrival in arrivals:
            key = (arrival.sent_ns, arrival.sequence)
            if key not in topic.seen:
                topic.seen.add(key)
                fresh.append(arrival)
        if topic.retiring is None:
            topic.settled = bool(topic.offers)
        elif topic.retire_at is None:
            if topic.intake.publisher_count() >= len(topic.offers) or now >= topic.retire_latest:
                topic.retire_at = now + OVERLAP_S
        elif now >= topic.retire_at:
            topic.retiring.close()
            topic.retiring, topic.retire_at, topic.settled = None, None, True
        if topic.settled:
            topic.seen.clear()
        return fresh

    def _announce(self, topic: _Topic, arrivals: list[Arrival], now: float) -> list[Arrival]:
        """Write the topic into the bag with its first message; until its publisher is known, hold messages back."""
        if arrivals and not topic.held:
            topic.held_since = now
        topic.held += arrivals
        if not topic.held:
            return []
        if not topic.offers:
            self._match(topic)
        if not topic.offers and now < topic.held_since + _UNANNOUNCED_S:
            return []
        return self._release(topic)

    def _release(self, topic: _Topic) -> list[Arrival]:
        if not topic.announced:
            type_hash = topic.publisher_hash if topic.offers else topic.definition.type_hash
            info = TopicInfo(topic.name, topic.definition.name, topic.offers, type_hash)
            self._writer.add_topic(info, topic.definition.text)
            topic.announced = True
        held, topic.held = topic.held, []
        return held

    def _write_held(self, topic: _Topic) -> None:
        for arrival in self._release(topic):
            self._writer.write(topic.name, arrival.received_ns, arrival.sent_ns, arrival.sequence, arrival.data)

    def _warn_once(self, text: str) -> None:
        if text not in self._warned:
            self._warned.add(text)
            self._warn(text)


def _received(item: tuple[int, str, Arrival]) -> int:
    return item[0]


def _profile(qos: Any) -> QosProfile:
    """Turn an rclpy profile into the stored form."""
    return QosProfile(
        reliability=qos.reliability.name.lower(),
        durability=qos.durability.name.lower(),
        history=qos.history.name.lower(),
        depth=qos.depth,
        deadline_ns=qos.deadline.nanoseconds,
        lifespan_ns=qos.lifespan.nanoseconds,
        liveliness=qos.liveliness.name.lower(),
        liveliness_lease_ns=qos.liveliness_lease_duration.nanoseconds,
        avoid_ros_namespace_conventions=qos.avoid_ros_namespace_conventions,
    )
