"""``slip_bag`` and ``slip-vic bag``: record, play, info, export, recover; also the recorder as a child process."""

from __future__ import annotations

import contextlib
import datetime
import errno
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import click

from slip_bags.recording import QUEUE_DEPTH
from slip_core.errors import InputError, SlipVicError
from slip_msgs_py import events
from slip_msgs_py.environment import is_of_ros, no_ros

_FOLDER = click.Path(path_type=Path)
_BAG = click.argument("bag_path", metavar="BAG", type=_FOLDER)


@click.group()
def bag() -> None:
    """Record, inspect, play, export and recover ROS 2 bags (rosbag2 folders with MCAP files)."""


@bag.command()
@_BAG
@click.option("--json", "as_json", is_flag=True, help="as JSON")
@click.option("--no-scan", is_flag=True, help="only the index: no rates, gaps and stamps")
@click.option("--attachment", metavar="NAME", help="write this attached file to stdout and nothing else")
def info(bag_path: Path, as_json: bool, no_scan: bool, attachment: str | None) -> None:
    """Show what a bag holds: topics, rates, gaps, losses, order of stamps, parameters."""
    from slip_bags.info import bag_report
    from slip_bags.reader import Bag
    from slip_bags.terminal import print_report
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
        print_report(report)


@bag.command()
@_BAG
@click.option("-o", "--out", "output", type=_FOLDER, required=True, help="new folder: one file per topic, or a bag")
@click.option("-t", "--topic", "topics", multiple=True, help="only this topic; repeatable")
@click.option(
    "-f", "--format", "file_format", type=click.Choice(["csv", "parquet", "mcap"]), default="csv", show_default=True
)
def export(
    bag_path: Path, output: Path, topics: tuple[str, ...], file_format: Literal["csv", "parquet", "mcap"]
) -> None:
    """Export topics as tables: CSV or Parquet, one row per message, one column per number; mcap: a bag with /tf."""
    from slip_bags.export import export as write_tables
    from slip_bags.export import export_bag
    from slip_bags.reader import Bag

    with Bag(bag_path) as opened:
        if file_format == "mcap":
            click.echo(f"{output}: {export_bag(opened, topics, output)} messages on /tf added")
            return
        written = write_tables(opened, topics, output, file_format)
    for path, rows in written:
        click.echo(f"{path}: {rows} rows")


@bag.command()
@_BAG
@click.option("-o", "--out", "output", type=_FOLDER, help="new folder; default <BAG>_recovered")
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


@bag.command()
@click.argument("topics", nargs=-1)
@click.option(
    "-o", "--out", "--output", "output", type=_FOLDER, help="new folder of the bag; default rosbag2_<date>-<time>"
)
@click.option("-a", "--all", "everything", is_flag=True, help="every topic that appears")
@click.option("-e", "--regex", default="", help="every topic this matches")
@click.option("--exclude-regex", default="", help="except what this matches")
@click.option("--include-hidden-topics", is_flag=True, help="topics with a part that begins with _ as well")
@click.option("--typed", nargs=2, multiple=True, metavar="TOPIC TYPE", help="subscribe at once, before it is published")
@click.option("--compression", type=click.Choice(["zstd", "lz4", "none"]), default="zstd", show_default=True)
@click.option("-b", "--max-bag-size", type=click.IntRange(0), default=0, help="split after so many bytes")
@click.option("-d", "--max-bag-duration", type=click.FloatRange(0.0), default=0.0, help="split after so many seconds")
@click.option("--duration", "duration_s", type=click.FloatRange(0.0), default=0.0, help="end after so many seconds")
@click.option("--queue-depth", type=click.IntRange(1), default=QUEUE_DEPTH, show_default=True, help="per topic")
@click.option("--attach", multiple=True, metavar="NAME=FILE", help="store a file in the bag")
@click.option("--custom-data", multiple=True, metavar="KEY=VALUE", help="store a text in metadata.yaml")
@click.option("--tf", "transforms", is_flag=True, help="make /tf of joint states and odometry, instead of recording it")
@click.option("--node-name", default="recorder", show_default=True)
@click.option("--namespace", default="/", show_default=True, help="of the recorder's node and of relative names")
@click.option(
    "--flush-period", "flush_period_s", type=click.FloatRange(0.0), default=1.0, show_default=True, help="[s]"
)
@click.option("--min-free-mib", type=click.IntRange(0), default=64, show_default=True, help="stop below so much space")
def record(
    *,
    topics: tuple[str, ...],
    output: Path | None,
    everything: bool,
    regex: str,
    exclude_regex: str,
    include_hidden_topics: bool,
    typed: tuple[tuple[str, str], ...],
    compression: str,
    max_bag_size: int,
    max_bag_duration: float,
    attach: tuple[str, ...],
    custom_data: tuple[str, ...],
    min_free_mib: int,
    **others: Any,
) -> None:
    """Record topics until Ctrl-C; QoS follows the publishers, topics may appear late."""
    from slip_bags.recording.listeners import Listener, TerminalListener
    from slip_bags.recording.record import RecordOptions
    from slip_bags.recording.record import record as run_recorder
    from slip_bags.recording.recorder import Selection
    from slip_bags.terminal import print_summary
    from slip_bags.writer import WriterOptions
    from slip_msgs_py.stop_flag import StopFlag

    try:
        if not (topics or typed or everything or regex):
            raise InputError("bag record", got="no topics", expected="topic names, --all or --regex")
        named = tuple((name, None) for name in topics) + tuple(typed)
        options = RecordOptions(
            output=output or Path(f"rosbag2_{datetime.datetime.now():%Y_%m_%d-%H_%M_%S}"),
            selection=Selection(named, everything, regex, exclude_regex, include_hidden_topics),
            writer=WriterOptions(
                compression,
                split_bytes=max_bag_size,
                split_duration_ns=round(max_bag_duration * 1e9),
                custom_data=_pairs("--custom-data", custom_data),
                attachments=_read_attachments(attach),
            ),
            min_free_bytes=min_free_mib << 20,
            **others,
        )
        with StopFlag() as stop:
            summary = run_recorder(options, Listener() if events.wanted() else TerminalListener(), stop)
    except SlipVicError as error:
        events.emit(events.Failed(str(error)))
        raise
    events.emit(events.Done(summary))
    if not events.wanted():
        print_summary(summary)


@bag.command()
@click.argument("bag_path", metavar="BAG", type=_FOLDER)
@click.option("-r", "--rate", type=click.FloatRange(0.0, min_open=True), default=1.0, show_default=True)
@click.option("-l", "--loop", is_flag=True, help="start again at the end")
@click.option(
    "--start-offset", "start_offset_s", type=click.FloatRange(0.0), default=0.0, help="seconds from the bag's start"
)
@click.option("--playback-duration", "duration_s", type=click.FloatRange(0.0), help="play so many seconds of the bag")
@click.option("--topics", multiple=True, help="only this topic; repeatable")
@click.option("-e", "--regex", default="", help="only topics this matches")
@click.option("-x", "--exclude-regex", default="", help="except what this matches")
@click.option("-m", "--remap", multiple=True, metavar="OLD:=NEW", help="play under another name; repeatable")
@click.option("--clock", "clock_hz", type=click.FloatRange(0.0), is_flag=False, flag_value=40.0, default=0.0,
              help="publish /clock at this rate [Hz]; 40 where no number is given")  # fmt: skip
@click.option("-p", "--start-paused", is_flag=True, help="wait for the space key")
@click.option("--delay", type=click.FloatRange(0.0), default=0.0, help="wait so many seconds before playing")
@click.option("--realtime/--no-realtime", default=True, show_default=True, help="real-time priority where permitted")
@click.option("--wait-for-subscribers", is_flag=True, help="start when every topic has a subscriber")
@click.option("--disable-keyboard-controls", is_flag=True)
def play(
    *,
    bag_path: Path,
    remap: tuple[str, ...],
    delay: float,
    realtime: bool,
    wait_for_subscribers: bool,
    disable_keyboard_controls: bool,
    **others: Any,
) -> None:
    """Publish a bag's messages again, with their recorded spacing.

    Keys: space pause/resume, right arrow or s one message, up/down rate, q quit.
    """
    from slip_bags.playing.keyboard import TerminalControls, raw_keys
    from slip_bags.playing.player import Player, PlayOptions, wait_for_discovery
    from slip_bags.reader import Bag
    from slip_bags.ros_node import request_realtime, ros_node
    from slip_msgs_py.stop_flag import StopFlag

    options = PlayOptions(remaps=_remaps(remap), **others)
    with (
        Bag(bag_path) as opened,
        StopFlag() as stop,
        contextlib.nullcontext(realtime and request_realtime()) as prioritised,
        ros_node("player") as node,
        raw_keys(sys.stdin) as keys,
    ):
        controls = TerminalControls(
            None if disable_keyboard_controls else keys, sys.stderr if sys.stderr.isatty() else None, stop
        )
        player = Player(node, opened, options, controls, lambda text: click.echo(f"warning: {text}", err=True))
        wait_for_discovery(player, delay, stop, everybody=wait_for_subscribers)
        result = player.run()
        controls.finish(player)
    end = "" if result.completed else "stopped: "
    click.echo(
        f"{end}{result.messages} messages, timing error p50 {result.error_p50_us:.1f} us, "
        f"p99 {result.error_p99_us:.1f} us, max {result.error_max_us:.1f} us"
        + ("" if prioritised else " (without real-time priority)")
    )


def _remaps(texts: Sequence[str]) -> dict[str, str]:
    remaps = {}
    for text in texts:
        old, _, new = text.partition(":=")
        if not old or not new:
            raise InputError("--remap", got=text, expected="OLD:=NEW")
        remaps[old] = new
    return remaps


def _pairs(option: str, texts: Sequence[str]) -> dict[str, str]:
    pairs = {}
    for text in texts:
        key, sign, value = text.partition("=")
        if not key or not sign:
            raise InputError(option, got=text, expected="KEY=VALUE")
        pairs[key] = value
    return pairs


def _read_attachments(texts: Sequence[str]) -> dict[str, bytes]:
    contents = {}
    for name, path in _pairs("--attach", texts).items():
        try:
            contents[name] = Path(path).read_bytes()
        except OSError as error:
            raise InputError(f"--attach {name}", got=f"{path}: {error.strerror}", expected="a readable file") from None
    return contents


def run_command(group: click.Group, name: str) -> int:
    """Run a command line and return its exit code: one line and 2 for a user's mistake."""
    from slip_msgs_py.stop_flag import StopFlag

    stop = StopFlag(interrupts=True)
    try:
        # A shell that starts us in the background has SIGINT ignored; a signal that comes is meant.
        with stop:
            code = group.main(prog_name=name, standalone_mode=False)
        sys.stdout.flush()
        return code if isinstance(code, int) else 0
    except click.exceptions.Exit as end:
        return end.exit_code
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message())
        return 0
    except click.ClickException as error:
        command = error.ctx.command_path if isinstance(error, click.UsageError) and error.ctx else name
        click.echo(f"error: {error.format_message()} (see {command} --help)", err=True)
        return 2
    except SlipVicError as error:
        click.echo(f"error: {error}", err=True)
        return error.exit_code
    except ModuleNotFoundError as error:
        if not is_of_ros(error):
            raise
        click.echo(f"error: {no_ros()}", err=True)
        return 2
    except OSError as error:
        if stop() or error.errno not in (errno.EPIPE, errno.ENOSPC):
            raise
        # What waits for a full disk or a closed pipe would fail again, loudly, when the interpreter ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if error.errno == errno.ENOSPC:
            where = error.filename or "the output"
            click.echo(f"error: {where}: got {error.strerror}, expected room; the output is not complete", err=True)
        return 2
    except (KeyboardInterrupt, Exception) as error:
        # A library that is just being loaded makes something else of the signal: MuJoCo an ImportError.
        if not stop() and not isinstance(error, KeyboardInterrupt | click.Abort):
            raise
        click.echo("error: interrupted", err=True)
        return 2


def main() -> int:
    """Entry point of ``slip_bag``: the ``bag`` commands without the rest of the suite."""
    return run_command(bag, "slip_bag")


if __name__ == "__main__":
    sys.exit(main())
