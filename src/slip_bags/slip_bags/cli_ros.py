"""``slip-vic bag record`` and ``play``: the two that need ROS."""

from __future__ import annotations

import contextlib
import datetime
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from rich.console import Console
from rich.table import Table

from slip_bags.tables import table_console
from slip_core.errors import InputError

if TYPE_CHECKING:
    from slip_bags.recorder import Recorder

_FOLDER = click.Path(path_type=Path)


@click.command()
@click.argument("topics", nargs=-1)
@click.option("-o", "--output", type=_FOLDER, help="new folder of the bag; default rosbag2_<date>-<time>")
@click.option("-a", "--all", "everything", is_flag=True, help="every topic that appears")
@click.option("-e", "--regex", default="", help="every topic this matches")
@click.option("--exclude-regex", default="", help="except what this matches")
@click.option("--include-hidden-topics", is_flag=True, help="topics with a part that begins with _ as well")
@click.option("--typed", nargs=2, multiple=True, metavar="TOPIC TYPE", help="subscribe at once, before it is published")
@click.option("--compression", type=click.Choice(["zstd", "lz4", "none"]), default="zstd", show_default=True)
@click.option("-b", "--max-bag-size", type=click.IntRange(0), default=0, help="split after so many bytes")
@click.option("-d", "--max-bag-duration", type=click.FloatRange(0.0), default=0.0, help="split after so many seconds")
@click.option("--duration", type=click.FloatRange(0.0), default=0.0, help="end after so many seconds")
@click.option("--queue-depth", type=click.IntRange(1), default=2000, show_default=True, help="per topic")
@click.option("--attach", multiple=True, metavar="NAME=FILE", help="store a file in the bag")
@click.option("--custom-data", multiple=True, metavar="KEY=VALUE", help="store a text in metadata.yaml")
@click.option("--node-name", default="recorder", show_default=True)
def record(
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
    duration: float,
    queue_depth: int,
    attach: tuple[str, ...],
    custom_data: tuple[str, ...],
    node_name: str,
) -> None:
    """Record topics until Ctrl-C; QoS follows the publishers, topics may appear late."""
    from slip_bags.recorder import Selection
    from slip_bags.recorder_process import RecordOptions, pairs, read_attachments
    from slip_bags.recorder_process import record as run_recorder
    from slip_bags.session import StopFlag
    from slip_bags.writer import WriterOptions

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
            custom_data=pairs("--custom-data", custom_data),
            attachments=read_attachments(attach),
        ),
        queue_depth=queue_depth,
        duration_s=duration,
        node_name=node_name,
    )
    console = Console(stderr=True)
    with StopFlag().installed() as stop:
        summary = run_recorder(options, _RecordView(console), lambda: stop.is_set)
    if console.is_terminal:
        console.print()
    _print_summary(summary)


@click.command()
@click.argument("bag_path", metavar="BAG", type=_FOLDER)
@click.option("-r", "--rate", type=click.FloatRange(0.0, min_open=True), default=1.0, show_default=True)
@click.option("-l", "--loop", is_flag=True, help="start again at the end")
@click.option("--start-offset", type=click.FloatRange(0.0), default=0.0, help="seconds from the bag's start")
@click.option("--playback-duration", type=click.FloatRange(0.0), help="play so many seconds of the bag")
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
    bag_path: Path,
    rate: float,
    loop: bool,
    start_offset: float,
    playback_duration: float | None,
    topics: tuple[str, ...],
    regex: str,
    exclude_regex: str,
    remap: tuple[str, ...],
    clock_hz: float,
    start_paused: bool,
    delay: float,
    realtime: bool,
    wait_for_subscribers: bool,
    disable_keyboard_controls: bool,
) -> None:
    """Publish a bag's messages again, with their recorded spacing.

    Keys: space pause/resume, right arrow or s one message, up/down rate, q quit.
    """
    from slip_bags.keyboard import TerminalControls, raw_keys, terminal
    from slip_bags.player import Player, PlayOptions, wait_for_discovery
    from slip_bags.reader import Bag
    from slip_bags.session import StopFlag, request_realtime, ros_node

    options = PlayOptions(
        rate=rate,
        loop=loop,
        start_offset_s=start_offset,
        duration_s=playback_duration,
        topics=topics,
        regex=regex,
        exclude_regex=exclude_regex,
        remaps=_remaps(remap),
        clock_hz=clock_hz,
        start_paused=start_paused,
    )
    with (
        Bag(bag_path) as opened,
        StopFlag().installed() as stop,
        contextlib.nullcontext(realtime and request_realtime()) as prioritised,
        ros_node("player") as node,
        raw_keys(sys.stdin) as keys,
    ):
        controls = TerminalControls(None if disable_keyboard_controls else keys, terminal(), stop)
        player = Player(node, opened, options, controls, lambda text: click.echo(f"warning: {text}", err=True))
        wait_for_discovery(player, delay, lambda: stop.is_set, everybody=wait_for_subscribers)
        result = player.run()
        controls.finish(player)
    end = "" if result.completed else "stopped: "
    click.echo(
        f"{end}{result.messages} messages, timing error p50 {result.error_p50_us:.1f} us, "
        f"p99 {result.error_p99_us:.1f} us, max {result.error_max_us:.1f} us"
        + ("" if prioritised else " (without real-time priority)")
    )


def _remaps(texts: tuple[str, ...]) -> dict[str, str]:
    remaps = {}
    for text in texts:
        old, sign, new = text.partition(":=")
        if not old or not sign or not new:
            raise InputError("--remap", got=text, expected="OLD:=NEW")
        remaps[old] = new
    return remaps


def _print_summary(summary: dict[str, Any]) -> None:
    table = Table(box=None, header_style="bold", pad_edge=False)
    table.add_column("topic", overflow="fold")
    for column in ("messages", "lost", "missed at start", "queue peak"):
        table.add_column(column, justify="right")
    for name, topic in summary["topics"].items():
        lost = "unknown" if topic["lost"] is None else str(topic["lost"])
        peak = f"{topic['largest_batch']}/{summary['queue_depth']}"
        table.add_row(name, str(topic["messages"]), lost, str(topic["missed_at_start"]), peak)
    table_console().print(table)
    for name in summary["never_published"]:
        click.echo(f"never published: {name}")
    click.echo(f"{summary['bag']}: {summary['messages']} messages, {summary['lost']} lost")


class _RecordView:
    """Shows a running recording on a terminal, and warnings anywhere."""

    def __init__(self, console: Console) -> None:
        self._console = console

    def ready(self) -> None:
        """Every named topic has a publisher."""
        self._console.print("recording; Ctrl-C ends")

    def warning(self, message: str) -> None:
        """Something is not recorded as wished."""
        self._console.print(f"warning: {message}", markup=False, highlight=False)

    def status(self, recorder: Recorder, elapsed_s: float) -> None:
        """Redraw the line."""
        if not self._console.is_terminal:
            return
        messages, lost = recorder.totals()
        line = f"{elapsed_s:8.1f} s  {messages} messages  {lost} lost"
        self._console.file.write(f"\r{line}\x1b[K")
        self._console.file.flush()
