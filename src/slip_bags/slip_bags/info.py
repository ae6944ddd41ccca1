"""Contents of a bag: its topics with rates and losses, its attachments and custom data."""

from __future__ import annotations

import datetime
from collections.abc import Iterator

from slip_bags.reader import Bag
from slip_core.errors import printable
from slip_core.files.plain_yaml import parse_json


def report(bag: Bag) -> Iterator[str]:
    """Yield what the index of a bag states, as lines of text.

    Raises:
        InputError: damaged metadata or attachments.
    """
    start_ns, end_ns = bag.span_ns or (0, 0)
    duration_s = 1e-9 * (end_ns - start_ns)
    yield printable(f"bag {bag.path}: {bag.file.name}, {bag.size_bytes / 2**20:.2f} MiB")
    start = datetime.datetime.fromtimestamp(start_ns // 10**9, datetime.UTC)
    since = f" from {start:%Y-%m-%d %H:%M:%S} UTC" if bag.span_ns else ""
    yield f"{bag.message_count} messages in {duration_s:.3f} s{since}"
    for name, data in bag.attachments.items():
        yield printable(f"attachment {name}, {len(data)} B")
    for key, value in bag.custom_data.items():
        if key != "recorder":
            yield printable(f"{key}: {value}")
    lost = recorded_losses(bag)
    for name, topic in bag.topics.items():
        rate = f"{topic.message_count / duration_s:.2f} Hz" if duration_s > 0.0 else "no rate"
        qos = "; ".join(sorted({f"{each.reliability}, {each.durability}" for each in topic.qos})) or "no QoS"
        missing = f"{lost[name]} lost" if name in lost else "losses unknown"
        yield printable(f"{name} [{topic.type_name}]: {topic.message_count} messages, {rate}, {missing}, {qos}")


def recorded_losses(bag: Bag) -> dict[str, int]:
    """Return how many messages of a topic the recorder knows to be lost; topics where it knows it."""
    try:
        topics = parse_json(bag.custom_data.get("recorder", "{}"))["topics"]
        return {name: int(item["lost"]) for name, item in topics.items() if item["lost"] is not None}
    except (ValueError, AttributeError, TypeError, KeyError):
        return {}
