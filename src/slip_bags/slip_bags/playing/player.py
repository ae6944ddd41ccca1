"""Publish a bag's messages as they were recorded: same bytes, same spacing."""

from __future__ import annotations

import gc
import importlib
import re
import sys
import time
from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from slip_bags.format import TopicInfo
from slip_bags.patterns import check_patterns
from slip_bags.playing.prefetch import Prefetch
from slip_bags.playing.schedule import Schedule
from slip_bags.reader import Bag
from slip_bags.typedefs import split_type_name
from slip_core.errors import InputError

PRELOAD_BYTES: Final = 256 << 20  # of the file; some three times that in memory
DEPTH: Final = 1000
SWITCH_INTERVAL_S: Final = 1e-4
ACKNOWLEDGE_S: Final = 1
RATE_STEP: Final = 1.1
SETTLE_S: Final = 0.5
MATCH_LIMIT_S: Final = 5.0


@dataclass(frozen=True, slots=True)
class PlayOptions:
    """What to play and how; times in seconds of the bag, from its start."""

    rate: float = 1.0
    loop: bool = False
    start_offset_s: float = 0.0
    duration_s: float | None = None
    topics: tuple[str, ...] = ()
    regex: str = ""
    exclude_regex: str = ""
    remaps: Mapping[str, str] = field(default_factory=dict)
    clock_hz: float = 0.0
    start_paused: bool = False


class Due(NamedTuple):
    """One message to send."""

    log_time_ns: int
    publisher: Publisher
    data: bytes


@dataclass(frozen=True, slots=True)
class PlayResult:
    """What was played; timing errors are publish time minus due time [us]."""

    messages: int
    loops: int
    completed: bool
    error_p50_us: float
    error_p99_us: float
    error_max_us: float


class Controls:
    """What the user does while playing; the default is no user."""

    def poll(self, player: Player) -> None:
        """Called every few milliseconds; may pause, step, change the rate or stop."""

    def progress(self, player: Player, bag_time_ns: int) -> None:
        """Called after messages; must be quick."""


class Player:
    """Plays one bag on a node that is in no executor.

    Args:
        node: publishers are made on it.
        bag: the open bag.
        options: what and how.
        controls: the user.
        warn: called with one line where a topic cannot be played.

    Raises:
        InputError: nothing to play, no such topic, a start beyond the end.
    """

    def __init__(
        self, node: Node, bag: Bag, options: PlayOptions, controls: Controls, warn: Callable[[str], None]
    ) -> None:
        self._node, self._bag, self._options, self._controls = node, bag, options, controls
        span = bag.span_ns
        if span is None:
            raise InputError(f"bag {bag.path}", got="no messages", expected="something to play")
        self.start_ns = span[0] + round(options.start_offset_s * 1e9)
        self.end_ns = span[1]
        if options.duration_s is not None:
            self.end_ns = min(self.end_ns, self.start_ns + round(options.duration_s * 1e9))
        if self.start_ns > span[1]:
            got = f"{options.start_offset_s:g} s"
            raise InputError("--start-offset", got=got, expected=f"at most {(span[1] - span[0]) * 1e-9:.3f} s")
        self._publishers: dict[str, Publisher] = {}
        for name in self._selected():
            publisher = self._publisher(bag.topics[name], warn)
            if publisher is not None:
                self._publishers[name] = publisher
        if not self._publishers:
            raise InputError(f"bag {bag.path}", got="no topic that can be played", expected="at least one")
        self._clock = None
        if options.clock_hz > 0.0:
            self._clock = node.create_publisher(Clock, "/clock", QoSProfile(depth=10))
        self.schedule = Schedule(self.start_ns, options.rate)
        self.stopping = False
        self.steps = 0
        self.played = 0
        self.loops = 0
        self._errors = array("q")
        self._next_clock_ns = self.start_ns

    @property
    def topics(self) -> list[str]:
        """The topics of the bag that are played."""
        return list(self._publishers)

    @property
    def heard(self) -> bool:
        """Whether every topic has a matched subscriber."""
        return all(publisher.get_subscription_count() for publisher in self._publishers.values())

    @property
    def matched(self) -> bool:
        """Whether every subscription that is known for our topics is matched."""
        return all(
            publisher.get_subscription_count() >= self._node.count_subscribers(publisher.topic_name)
            for publisher in self._publishers.values()
        )

    def run(self) -> PlayResult:
        """Play to the end, or until `stopping` is set.

        Raises:
            InputError: damaged data, when it is reached.
        """
        interval = sys.getswitchinterval()
        collecting = gc.isenabled()
        preloaded = list(self._messages()) if self._bag.size_bytes < PRELOAD_BYTES else None
        gc.collect()
        gc.disable()
        sys.setswitchinterval(SWITCH_INTERVAL_S)
        try:
            completed = self._play(preloaded)
        finally:
            sys.setswitchinterval(interval)
            if collecting:
                gc.enable()
        self._wait_acknowledged()
        errors = np.frombuffer(self._errors, dtype=np.int64) * 1e-3 if self._errors else np.zeros(1)
        p50, p99 = np.percentile(errors, (50, 99))
        return PlayResult(self.played, self.loops, completed, float(p50), float(p99), float(errors.max()))

    def _play(self, preloaded: list[Due] | None) -> bool:
        self.schedule = Schedule(self.start_ns, self._options.rate)
        if self._options.start_paused:
            self.schedule.pause()
        while True:
            self._next_clock_ns = self.start_ns
            if not (self._send_all(preloaded) if preloaded is not None else self._send_read_ahead()):
                return False
            if not self._wait(self.end_ns, may_step=False):
                return False
            self.loops += 1
            if not self._options.loop:
                return True
            self.schedule.restart(self.start_ns)

    def _send_read_ahead(self) -> bool:
        source = Prefetch(self._messages())
        try:
            return self._send_all(source)
        finally:
            source.close()

    def _send_all(self, messages: Iterable[Due]) -> bool:
        for message in messages:
            if not self._wait(message.log_time_ns, may_step=True):
                return False
            if not self.schedule.paused:
                self._errors.append(self.schedule.lateness(message.log_time_ns))
            message.publisher.publish(message.data)
            self.played += 1
            self._controls.progress(self, message.log_time_ns)
        return True

    def _wait(self, bag_time_ns: int, *, may_step: bool) -> bool:
        """Wait until this time is due, publishing the time on ``/clock``; False where playing shall stop."""
        schedule = self.schedule
        while True:
            self._controls.poll(self)
            if self.stopping:
                return False
            if schedule.paused and self.steps and may_step:
                self.steps -= 1
                schedule.restart(bag_time_ns)
                self._tell_time(bag_time_ns)
                return True
            target = bag_time_ns if self._clock is None else min(bag_time_ns, self._next_clock_ns)
            if not schedule.wait(target):
                continue
            if target == bag_time_ns:
                return True
            self._tell_time(target)
            self._next_clock_ns = target + round(1e9 * schedule.rate / self._options.clock_hz)

    def _tell_time(self, bag_time_ns: int) -> None:
        if self._clock is not None:
            message = Clock()
            message.clock.sec, message.clock.nanosec = divmod(bag_time_ns, 10**9)
            self._clock.publish(message)

    def _messages(self) -> Iterator[Due]:
        for message in self._bag.raw(self._publishers, start_ns=self.start_ns, end_ns=self.end_ns):
            yield Due(message.log_time_ns, self._publishers[message.topic], message.data)

    def _selected(self) -> list[str]:
        check_patterns(regex=self._options.regex, exclude_regex=self._options.exclude_regex)
        options, names = self._options, list(self._bag.topics)
        if options.topics or options.regex:
            wanted = {self._bag.topic(name).name for name in options.topics}
            names = [name for name in names if name in wanted or (options.regex and re.search(options.regex, name))]
        if options.exclude_regex:
            names = [name for name in names if not re.search(options.exclude_regex, name)]
        if options.clock_hz > 0.0:
            names = [name for name in names if name != "/clock"]
        return names

    def _publisher(self, topic: TopicInfo, warn: Callable[[str], None]) -> Publisher | None:
        try:
            package, kind = split_type_name(topic.type_name)
            message_class = getattr(importlib.import_module(f"{package}.msg"), kind)
        except (InputError, ImportError, AttributeError) as error:
            warn(f"topic {topic.name} is not played: {error}")
            return None
        remaps = self._options.remaps
        name = remaps.get(topic.name, remaps.get(topic.name.lstrip("/"), topic.name))
        return self._node.create_publisher(message_class, name, playing_qos(topic))

    def _wait_acknowledged(self) -> None:
        """Give reliable subscribers the time to take the last messages before the publishers vanish."""
        for publisher in self._publishers.values():
            publisher.wait_for_all_acked(Duration(seconds=ACKNOWLEDGE_S))


def playing_qos(topic: TopicInfo) -> QoSProfile:
    """Return what the publishers offered where they agree, else reliable and volatile."""
    offers = {(qos.reliability, qos.durability) for qos in topic.qos}
    reliability, durability = offers.pop() if len(offers) == 1 else ("reliable", "volatile")
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=DEPTH,
        reliability=ReliabilityPolicy.BEST_EFFORT if reliability == "best_effort" else ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if durability == "transient_local" else DurabilityPolicy.VOLATILE,
    )


def wait_for_discovery(player: Player, delay_s: float, stop: Callable[[], bool], *, everybody: bool) -> None:
    """Wait until the subscriptions that are known are matched, and `delay_s` on top.

    At least `SETTLE_S`, so that they can become known; with `everybody` until each topic has one, however long.
    """
    start = time.monotonic()
    while not stop():
        elapsed = time.monotonic() - start
        if elapsed >= SETTLE_S and (player.heard if everybody else player.matched or elapsed >= MATCH_LIMIT_S):
            break
        time.sleep(0.01)
    end = time.monotonic() + delay_s
    while not stop() and time.monotonic() < end:
        time.sleep(0.01)
