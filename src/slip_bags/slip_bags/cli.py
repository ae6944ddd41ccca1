"""``slip-vic bag``: record, play, info, export, recover."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

from slip_bags.cli_ros import play, record
from slip_bags.tables import table_console
from slip_core.errors import InputError

_FOLDER = click.Path(path_type=Path)
_BAG = click.argument("bag_path", metavar="BAG", type=_FOLDER)


@click.group()
def bag() -> None:
    """Record, inspect, play, verify and export ROS 2 bags (rosbag2 folders with MCAP files)."""


bag.add_command(record)
bag.add_command(play)


@bag.command()
@_BAG
@click.option("--json", "as_json", is_flag=True, help="as JSON")
@click.option("--no-scan", is_flag=True, help="only what the index says: no rates, gaps and stamps")
@click.option("--attachment", metavar="NAME", help="write this attached file to stdout and nothing else")
def info(bag_path: Path, as_json: bool, no_scan: bool, attachment: str | None) -> None:
    """Show what a bag holds: topics, rates, gaps, losses, order of stamps, parameters."""
    from slip_bags.info import bag_report, print_report
    from slip_bags.reader import Bag
    from slip_core.errors import nearest

    with Bag(bag_path) as opened:
        if attachment is not None:
            if attachment not in opened.attachments:
                expected = nearest(attachment, opened.attachments)
                raise InputError(f"attachment {attachment}", got="no such attachment", expected=expected)
            sys.stdout.buffer.write(opened.attachments[attachment])
            return
        report = bag_report(opened, scan=not no_scan)
    if as_json:
        click.echo(report.as_json())
    else:
        print_report(report, table_console())


@bag.command()
@_BAG
@click.option("-o", "--output", type=_FOLDER, required=True, help="new folder: one file per topic")
@click.option("-t", "--topic", "topics", multiple=True, help="only this topic; repeatable")
@click.option("-f", "--format", "file_format", type=click.Choice(["csv", "parquet"]), default="csv", show_default=True)
def export(bag_path: Path, output: Path, topics: tuple[str, ...], file_format: Any) -> None:
    """Export topics as tables: CSV or Parquet, one row per message, one column per number."""
    from slip_bags.export import export as write_tables
    from slip_bags.reader import Bag

    with Bag(bag_path) as opened:
        written = write_tables(opened, topics, output, file_format)
    for path, rows in written:
        click.echo(f"{path}: {rows} rows")


@bag.command()
@_BAG
@click.option("-o", "--output", type=_FOLDER, help="new folder; default <BAG>_recovered")
@click.option("--compression", type=click.Choice(["zstd", "lz4", "none"]), default="zstd", show_default=True)
def recover(bag_path: Path, output: Path | None, compression: str) -> None:
    """Make a whole bag out of a killed, cut or damaged one; the original is not touched."""
    from slip_bags.recover import recover as run_recover

    target = output or bag_path.with_name(f"{bag_path.stem if bag_path.is_file() else bag_path.name}_recovered")
    report = run_recover(bag_path, target, compression)
    assert report.metadata is not None
    click.echo(f"{report.output}: {report.metadata.message_count} messages on {len(report.metadata.topics)} topics")
    if report.bytes_skipped or report.messages_dropped:
        click.echo(
            f"not readable: {report.bytes_skipped} bytes, {report.chunks_dropped} damaged chunks, "
            f"{report.messages_dropped} messages"
        )
