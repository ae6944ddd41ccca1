"""What is inside a bag: per topic rates, gaps, losses and the order of stamps; as data and as a table."""

from __future__ import annotations

import json
from array import array
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field

import numpy as np

from slip_bags.format import QosProfile
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


@dataclass(slots=True)
class _Scan:
    """Log time, sequence number and stamp of each message of a topic, as they pass by."""

    stamp_offset: int | None
    times: array[int] = field(default_factory=lambda: array("q"))
    sequences: array[int] = field(default_factory=lambda: array("q"))
    stamps: array[int] = field(default_factory=lambda: array("q"))

    def add(self, message: RawMessage) -> None:
        self.times.append(message.log_time_ns)
        self.sequences.append(message.sequence)
        if self.stamp_offset is not None:
            self.stamps.append(stamp_of(message.data, self.stamp_offset))

    def finish(self, report: TopicReport, recorded_loss: int | None) -> None:
        times, sequences, stamps = (
            np.array(part, dtype=np.int64) for part in (self.times, self.sequences, self.stamps)
        )
        report.lost = recorded_loss
        if len(times) > 1:
            if times[-1] > times[0]:
                report.rate_hz = float((len(times) - 1) / (times[-1] - times[0]) * 1e9)
            report.largest_gap_ms = float(np.diff(times).max() * 1e-6)
        if recorded_loss is None and len(times) and sequences[0] and (np.diff(sequences) > 0).all():
            report.lost = int(sequences[-1] - sequences[0]) + 1 - len(sequences)
        if self.stamp_offset is not None:
            steps = np.diff(stamps)
            report.stamps_backward, report.stamps_repeated = int((steps < 0).sum()), int((steps == 0).sum())


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
        scans = {name: _Scan(_stamp_offset(bag, name)) for name in reports}
        for message in bag.raw():
            scans[message.topic].add(message)
        recorded = _recorded_losses(bag)
        for name, topic_scan in scans.items():
            topic_scan.finish(reports[name], recorded.get(name))
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


def _qos(profiles: Sequence[QosProfile]) -> str:
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
