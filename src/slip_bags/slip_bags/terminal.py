"""What people see in a terminal: the report on a bag, and the summary of a recording."""

from __future__ import annotations

import datetime
import sys
from typing import Any

import click
from rich.console import Console, Group
from rich.table import Table
from rich.text import Text

from slip_bags.info import BagReport


def print_report(report: BagReport) -> None:
    """Show a report as text and tables."""
    head = Table.grid(padding=(0, 2))
    for label, value in _head(report):
        head.add_row(Text(label, style="bold"), Text(value))
    table = Table(box=None, header_style="bold", pad_edge=False)
    table.add_column("topic", overflow="fold")
    for column in ("messages", "Hz", "gap ms", "lost", "back", "repeated"):
        table.add_column(column, justify="right")
    offers = Table(box=None, header_style="bold", pad_edge=False)
    for column in ("topic", "type", "QoS"):
        offers.add_column(column, overflow="fold")
    for topic in report.topics:
        cells = (topic.largest_gap_ms, topic.lost, topic.stamps_backward, topic.stamps_repeated)
        rate = "-" if topic.rate_hz is None else f"{topic.rate_hz:.2f}"
        table.add_row(topic.name, str(topic.message_count), rate, *map(_cell, cells))
        offers.add_row(topic.name, topic.type_name.replace("/msg/", "/"), topic.qos)
    notes = (Text(f"note: {note}", style="yellow") for note in report.notes)
    Console().print(Group(head, Text(""), table, Text(""), offers, *notes))


def _head(report: BagReport) -> list[tuple[str, str]]:
    rows = [
        ("bag", report.path),
        ("files", ", ".join(report.files)),
        ("size", f"{report.size_bytes / 2**20:.2f} MiB, compression {report.compression}"),
        ("messages", f"{report.message_count} in {report.duration_s:.3f} s"),
    ]
    if report.start_ns is not None:
        start = datetime.datetime.fromtimestamp(report.start_ns // 10**9, datetime.UTC)
        rows.append(("start", f"{start:%Y-%m-%d %H:%M:%S}.{report.start_ns % 10**9:09d} UTC"))
    if report.attachments:
        rows.append(("attachments", ", ".join(f"{name} ({size} B)" for name, size in report.attachments.items())))
    rows += [(key, value) for key, value in report.custom_data.items() if key != "recorder"]
    return rows


def _cell(value: float | None) -> str:
    if value is None:
        return "-"
    return f"{value:.2f}" if isinstance(value, float) else str(value)


def print_summary(summary: dict[str, Any]) -> None:
    """Show what a recording counted, per topic and in total."""
    if sys.stderr.isatty():
        click.echo(err=True)  # end the line that showed the counters
    table = Table(box=None, header_style="bold", pad_edge=False)
    table.add_column("topic", overflow="fold")
    for column in ("messages", "lost", "missed at start", "queue peak"):
        table.add_column(column, justify="right")
    for name, topic in summary["topics"].items():
        lost = "unknown" if topic["lost"] is None else str(topic["lost"])
        peak = f"{topic['largest_batch']}/{summary['queue_depth']}"
        table.add_row(name, str(topic["messages"]), lost, str(topic["missed_at_start"]), peak)
    Console().print(table)
    for name in summary["never_published"]:
        click.echo(f"never published: {name}")
    click.echo(f"{summary['bag']}: {summary['messages']} messages, {summary['lost']} lost")
