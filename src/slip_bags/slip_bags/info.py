"""Contents of a bag: its topics with rates and losses, its attachments and custom data."""

from __future__ import annotations

import datetime
import json
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from slip_bags.reader import Bag


def bag_report(bag: Bag) -> dict[str, Any]:
    """Return what the index of a bag states; `lost` is what the recorder counted, None where that is unknown.

    Raises:
        InputError: damaged metadata or attachments.
    """
    span = bag.span_ns
    duration_s = (span[1] - span[0]) * 1e-9 if span else 0.0
    lost = _recorded_losses(bag)
    return {
        "path": str(bag.path),
        "file": bag.file.name,
        "size_bytes": bag.size_bytes,
        "compression": ", ".join(name or "none" for name in bag.compressions) or "none",
        "start_ns": span[0] if span else None,
        "duration_s": duration_s,
        "message_count": bag.message_count,
        "topics": [
            {
                "name": name,
                "type_name": topic.type_name,
                "message_count": topic.message_count,
                "rate_hz": topic.message_count / duration_s if duration_s > 0.0 else None,
                "lost": lost.get(name),
                "qos": sorted({f"{qos.reliability}, {qos.durability}" for qos in topic.qos}),
            }
            for name, topic in bag.topics.items()
        ],
        "attachments": {name: len(data) for name, data in bag.attachments.items()},
        "custom_data": dict(bag.custom_data),
    }


def print_report(report: dict[str, Any]) -> None:
    """Print a report as text and a table."""
    head = Table.grid(padding=(0, 2))
    head.add_row("bag", printable(report["path"]))
    head.add_row("file", printable(report["file"]))
    head.add_row("size", printable(f"{report['size_bytes'] / 2**20:.2f} MiB, compression {report['compression']}"))
    head.add_row("messages", f"{report['message_count']} in {report['duration_s']:.3f} s")
    if report["start_ns"] is not None:
        start = datetime.datetime.fromtimestamp(report["start_ns"] // 10**9, datetime.UTC)
        head.add_row("start", f"{start:%Y-%m-%d %H:%M:%S} UTC")
    if report["attachments"]:
        listed = (f"{name} ({size} B)" for name, size in report["attachments"].items())
        head.add_row("attachments", printable(", ".join(listed)))
    for key, value in report["custom_data"].items():
        if key != "recorder":
            head.add_row(printable(key), printable(value))
    table = Table(box=None, pad_edge=False)
    for column in ("topic", "type", "QoS"):
        table.add_column(column, overflow="fold")
    for column in ("messages", "Hz", "lost"):
        table.add_column(column, justify="right")
    for topic in report["topics"]:
        rate = "-" if topic["rate_hz"] is None else f"{topic['rate_hz']:.2f}"
        lost = "-" if topic["lost"] is None else str(topic["lost"])
        texts = (printable(text) for text in (topic["name"], topic["type_name"], "; ".join(topic["qos"])))
        table.add_row(*texts, str(topic["message_count"]), rate, lost)
    console = Console()
    console.print(head)
    console.print()
    console.print(table)


def printable(text: str) -> Text:
    """Return a text from a file without control characters and markup: each is shown as its escape sequence."""
    return Text("".join(sign if sign.isprintable() else ascii(sign)[1:-1] for sign in text))


def _recorded_losses(bag: Bag) -> dict[str, int | None]:
    try:
        topics = json.loads(bag.custom_data.get("recorder", "{}"))["topics"]
        return {name: int(item["lost"]) for name, item in topics.items() if item["lost"] is not None}
    except (ValueError, AttributeError, TypeError, KeyError):
        return {}
