"""What is inside a bag: per topic rates, gaps, losses and the order of stamps; as data and as a table."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Any

from slip_bags.reader import Bag, RawMessage
from slip_core.errors import InputError
from slip_core.stamps import stamp_of
from slip_msgs_py.messages.layout import Schema


@dataclass(slots=True)
class TopicReport:
    """One topic, measured over its messages in order of log time."""

    name: str
    type_name: str
    message_count: int
    qos: str
    rate_hz: float | None = None
    largest_gap_ms: float | None = None
    lost: int | None = None
    stamps_backward: int | None = None
    stamps_repeated: int | None = None


class _TopicScan:
    """Measures one topic while its messages pass by."""

    def __init__(self, report: TopicReport, stamp_offset: int | None) -> None:
        self._report = report
        self._stamp_offset = stamp_offset
        self._first = self._last = 0
        self._gap = 0
        self._count = 0
        self._stamp: int | None = None
        self._backward = self._repeated = 0
        self._sequence_first = self._sequence_last = 0
        self._increasing = True

    def add(self, message: RawMessage) -> None:
        if self._count:
            self._gap = max(self._gap, message.log_time_ns - self._last)
            self._increasing = self._increasing and message.sequence > self._sequence_last
        else:
            self._first, self._sequence_first = message.log_time_ns, message.sequence
        self._last, self._sequence_last = message.log_time_ns, message.sequence
        self._count += 1
        if self._stamp_offset is not None:
            self._add_stamp(message.data)

    def _add_stamp(self, data: bytes) -> None:
        assert self._stamp_offset is not None
        stamp = stamp_of(data, self._stamp_offset)
        if self._stamp is not None:
            self._backward += stamp < self._stamp
            self._repeated += stamp == self._stamp
        self._stamp = stamp

    def finish(self, recorded_loss: int | None) -> None:
        report = self._report
        if self._count > 1:
            if self._last > self._first:
                report.rate_hz = (self._count - 1) / (self._last - self._first) * 1e9
            report.largest_gap_ms = self._gap * 1e-6
        report.lost = recorded_loss
        if recorded_loss is None and self._count and self._increasing and self._sequence_first:
            report.lost = self._sequence_last - self._sequence_first + 1 - self._count
        if self._stamp_offset is not None:
            report.stamps_backward, report.stamps_repeated = self._backward, self._repeated


@dataclass(slots=True)
class BagReport:
    """The whole bag."""

    path: str
    files: list[str]
    size_bytes: int
    compression: str
    start_ns: int | None
    duration_s: float
    message_count: int
    topics: list[TopicReport]
    attachments: dict[str, int]
    custom_data: dict[str, str]
    notes: list[str]

    def as_json(self) -> str:
        """Return the report as JSON text."""
        return json.dumps(asdict(self), indent=2)


def bag_report(bag: Bag, *, scan: bool = True) -> BagReport:
    """Measure a bag; without `scan` only what the index says.

    Raises:
        InputError: damaged data.
    """
    reports = {
        name: TopicReport(name, info.type_name, info.message_count, _qos(info.qos)) for name, info in bag.topics.items()
    }
    if scan:
        scans = {name: _TopicScan(report, _stamp_offset(bag, name)) for name, report in reports.items()}
        for message in bag.raw():
            scans[message.topic].add(message)
        recorded = _recorded_losses(bag)
        for name, topic_scan in scans.items():
            topic_scan.finish(recorded.get(name))
    span = bag.span_ns
    return BagReport(
        path=str(bag.path),
        files=[file.path for file in bag.metadata.files] if bag.metadata else [bag.path.name],
        size_bytes=bag.size_bytes,
        compression=", ".join(name or "none" for name in bag.compressions) or "none",
        start_ns=span[0] if span else None,
        duration_s=(span[1] - span[0]) * 1e-9 if span else 0.0,
        message_count=bag.message_count,
        topics=list(reports.values()),
        attachments={name: len(data) for name, data in bag.attachments.items()},
        custom_data=dict(bag.custom_data),
        notes=_notes(bag),
    )


def _qos(profiles: Any) -> str:
    offers = sorted({f"{qos.reliability}, {qos.durability}" for qos in profiles})
    return "; ".join(offers) + (f" ({len(profiles)} publishers)" if len(profiles) > 1 else "")


def _stamp_offset(bag: Bag, topic: str) -> int | None:
    """Where the header stamp lies in every message of the topic; None where it has none or its place varies."""
    info = bag.topics[topic]
    if not info.message_count:
        return None
    try:
        first = next(bag.raw([topic]))
        layout = Schema.from_text(info.type_name, bag.schema_text(topic)).layout(first.data)
    except InputError:
        return None  # another encoding; the other measurements need no decoding
    place = next((leaf.offset for leaf in layout.leaves if leaf.path == "header.stamp.sec"), None)
    if place is None or any(offset < place for offset, _ in layout.sizes):
        return None
    return place


def _recorded_losses(bag: Bag) -> dict[str, int | None]:
    """What the recorder counted while it could still tell publishers apart."""
    try:
        topics = json.loads(bag.custom_data.get("recorder", "{}")).get("topics", {})
        return {name: item["lost"] for name, item in topics.items()}
    except (ValueError, AttributeError, TypeError, KeyError):
        return {}


def _notes(bag: Bag) -> list[str]:
    notes = []
    if bag.metadata is not None:
        stated = {topic.name: topic.message_count for topic in bag.metadata.topics}
        held = {name: info.message_count for name, info in bag.topics.items()}
        if {name: count for name, count in stated.items() if count} != {n: c for n, c in held.items() if c}:
            notes.append("metadata.yaml and the MCAP files count different messages; the files are shown")
        shared = set(stated) & set(held)
        if any(t.qos != bag.topics[t.name].qos for t in bag.metadata.topics if t.name in shared):
            notes.append("metadata.yaml and the MCAP files disagree about QoS: rosbags would skip those topics")
    if bag.custom_data.get("recovered") == "true":
        notes.append(f"recovered bag; losses: {bag.custom_data.get('recovery', 'unknown')}")
    return notes
