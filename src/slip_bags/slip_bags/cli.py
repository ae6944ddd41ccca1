"""``slip_bag`` and ``slip-vic bag``: record, play, info, recover; also the recorder as a child process."""

from __future__ import annotations

import contextlib
import datetime
import errno
import os
import sys
from pathlib import Path

import click

from slip_core.errors import InputError, SlipVicError, printable
from slip_core.topics import checked_namespace
from slip_msgs_py.environment import emit, is_of_ros, no_ros

_FOLDER = click.Path(path_type=Path)
_BAG = click.argument("bag_path", metavar="BAG", type=_FOLDER)
_DOMAIN = click.option("--domain-id", type=click.IntRange(0, 232), help="ROS domain id; default ROS_DOMAIN_ID, else 0")


def echo(text: object, *, err: bool = False) -> None:
    """Print a text as a terminal can show it, whatever names are in it."""
    click.echo(printable(str(text)), err=err)


@click.group()
def bag() -> None:
    """Record, inspect, play and recover ROS 2 bags (rosbag2 folders with MCAP files)."""


@bag.command()
@_BAG
def info(bag_path: Path) -> None:
    """Show the contents of a bag: topics, types, QoS, rates, attachments, custom data."""
    from slip_bags.reader import Bag

    opened = Bag(bag_path)
    start_ns, end_ns = opened.span_ns or (0, 0)
    start, duration_s = datetime.datetime.fromtimestamp(start_ns // 10**9, datetime.UTC), 1e-9 * (end_ns - start_ns)
    echo(f"bag {opened.path}: {opened.file.name}, {opened.size_bytes / 2**20:.2f} MiB")
    echo(f"{opened.message_count} messages in {duration_s:.3f} s from {start:%Y-%m-%d %H:%M:%S} UTC")
    for name, data in opened.attachments.items():
        echo(f"attachment {name}, {len(data)} B")
    for key, value in opened.custom_data.items():
        echo(f"{key}: {value}")
    for name, topic in opened.topics.items():
        rate = f"{topic.message_count / duration_s:.2f} Hz" if duration_s > 0.0 else "no rate"
        qos = "; ".join(sorted({f"{one.reliability}, {one.durability}" for one in topic.qos})) or "no QoS"
        echo(f"{name} [{topic.type_name}]: {topic.message_count} messages, {rate}, {qos}")


@bag.command()
@_BAG
@click.option("-o", "--out", "output", type=_FOLDER, help="new folder; default <BAG>_recovered")
def recover(bag_path: Path, output: Path | None) -> None:
    """Make a readable bag from a truncated or damaged one; the original is not changed."""
    from slip_bags.recover import recover as run_recover

    target = output or bag_path.with_name(f"{bag_path.stem if bag_path.is_file() else bag_path.name}_recovered")
    echo(f"{target}: {run_recover(bag_path, target)}")


@bag.command()
@click.argument("topics", nargs=-1)
@click.option("-o", "--out", "--output", "output", type=_FOLDER, help="new folder; default rosbag2_<date>-<time>")
@click.option("-a", "--all", "everything", is_flag=True, help="every topic that appears, except hidden ones")
@click.option("--attach", type=(str, _FOLDER), multiple=True, metavar="NAME FILE", help="store a file in the bag")
@click.option("--custom-data", type=(str, str), multiple=True, metavar="KEY TEXT", help="store it in metadata.yaml")
@click.option(
    "--namespace", callback=checked_namespace, default="/", show_default=True,
    help="of the recorder's node and of relative names",
)  # fmt: skip
@_DOMAIN
def record(
    *, topics: tuple[str, ...], output: Path | None, everything: bool, attach: tuple[tuple[str, Path], ...],
    custom_data: tuple[tuple[str, str], ...], namespace: str, domain_id: int | None,
) -> None:  # fmt: skip
    """Record topics until Ctrl-C; QoS follows the publishers, topics may appear late."""
    from slip_bags.recorder import Recorder
    from slip_bags.writer import BagWriter
    from slip_core.files.resources import bounded_memory, open_file
    from slip_msgs_py.node_main import ros_node
    from slip_msgs_py.stop_flag import StopFlag

    if not (topics or everything):
        raise InputError("bag record", got="no topics", expected="topic names or --all")
    attachments = {}
    for name, path in attach:
        with bounded_memory(f"--attach {name}"), open_file(path, f"--attach {name}") as file:
            attachments[name] = file.read()
    folder = output or Path(f"rosbag2_{datetime.datetime.now():%Y_%m_%d-%H_%M_%S}")
    with StopFlag() as stop, ros_node("recorder", namespace, domain_id) as node:
        echo(f"recording into {folder}; Ctrl-C ends", err=True)
        with contextlib.closing(BagWriter(folder, dict(custom_data), attachments)) as writer:
            messages, lost = Recorder(node, writer, topics, everything=everything).run(stop)
    emit("done", bag=str(folder), messages=messages, lost=lost)
    echo(f"{folder}: {messages} messages, {lost} lost")


@bag.command()
@_BAG
@click.option("-r", "--rate", type=click.FloatRange(0.0, min_open=True), default=1.0, show_default=True)
@click.option("-l", "--loop", is_flag=True, help="start again at the end")
@click.option("--topics", multiple=True, help="only this topic; repeatable")
@_DOMAIN
def play(*, bag_path: Path, rate: float, loop: bool, topics: tuple[str, ...], domain_id: int | None) -> None:
    """Publish a bag's messages again, with their recorded spacing."""
    from slip_bags.player import play as run_player
    from slip_bags.reader import Bag
    from slip_msgs_py.node_main import ros_node
    from slip_msgs_py.stop_flag import StopFlag

    opened = Bag(bag_path)
    with StopFlag() as stop, ros_node("player", domain=domain_id) as node:
        played = run_player(node, opened, topics, rate=rate, loop=loop, stop=stop)
        echo(f"{'stopped: ' if stop() else ''}{played} messages")


def run_command(group: click.Group, name: str) -> int:
    """Run a command line and return its exit code: one line and 2 for a user's mistake."""
    from slip_msgs_py.stop_flag import StopFlag

    stop, code = StopFlag(interrupts=True), 2
    try:
        # A shell that starts this process in the background ignores SIGINT; it is handled all the same.
        with stop:
            ended = group.main(prog_name=name, standalone_mode=False)
        sys.stdout.flush()
        return ended if isinstance(ended, int) else 0
    except click.exceptions.Exit as end:
        return end.exit_code
    except click.exceptions.NoArgsIsHelpError as error:
        echo(error.format_message())
        return 0
    except click.ClickException as error:
        command = error.ctx.command_path if isinstance(error, click.UsageError) and error.ctx else name
        line = f"{error.format_message()} (see {command} --help)"
    except SlipVicError as error:
        line, code = str(error), error.exit_code
    except ModuleNotFoundError as error:
        if not is_of_ros(error):
            raise
        line = str(no_ros())
    except MemoryError:
        line = "no memory is left for it (see ulimit -v, free -m)"
    except OSError as error:
        if stop() or error.errno not in (errno.EPIPE, errno.ENOSPC):
            raise
        # Output that waits for a full disk or a closed pipe would raise again when the interpreter ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if error.errno == errno.EPIPE:
            return code
        line = f"{error.filename or 'the output'}: got {error.strerror}, expected room; the output is not complete"
    except (KeyboardInterrupt, Exception) as error:
        # A library that is being loaded turns the interrupt into another error: MuJoCo into an ImportError.
        if not stop() and not isinstance(error, KeyboardInterrupt | click.Abort):
            raise
        line = "interrupted"
    echo(f"error: {line}", err=True)
    return code


def main() -> int:
    """Entry point of ``slip_bag``: the ``bag`` commands without the rest of the suite."""
    return run_command(bag, "slip_bag")


if __name__ == "__main__":
    sys.exit(main())
