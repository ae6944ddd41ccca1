"""``slip_bag`` and ``slip-vic bag``: record, play, info, recover; also the recorder as a child process."""

from __future__ import annotations

import datetime
import errno
import os
import sys
from collections.abc import Sequence
from pathlib import Path

import click

from slip_core.errors import InputError, SlipVicError, printable
from slip_msgs_py import events
from slip_msgs_py.environment import is_of_ros, no_ros

_FOLDER = click.Path(path_type=Path)
_BAG = click.argument("bag_path", metavar="BAG", type=_FOLDER)
_DOMAIN = click.option("--domain-id", type=click.IntRange(0, 232), help="ROS domain id; default ROS_DOMAIN_ID, else 0")


@click.group()
def bag() -> None:
    """Record, inspect, play and recover ROS 2 bags (rosbag2 folders with MCAP files)."""


@bag.command()
@_BAG
def info(bag_path: Path) -> None:
    """Show the contents of a bag: topics, types, QoS, rates, losses, attachments, custom data."""
    from slip_bags.info import report
    from slip_bags.reader import Bag

    with Bag(bag_path) as opened:
        for line in report(opened):
            click.echo(line)


@bag.command()
@_BAG
@click.option("-o", "--out", "output", type=_FOLDER, help="new folder; default <BAG>_recovered")
def recover(bag_path: Path, output: Path | None) -> None:
    """Make a whole bag out of a killed, cut or damaged one; the original is not touched."""
    from slip_bags.recover import recover as run_recover

    target = output or bag_path.with_name(f"{bag_path.stem if bag_path.is_file() else bag_path.name}_recovered")
    click.echo(f"{target}: {run_recover(bag_path, target)}")


@bag.command()
@click.argument("topics", nargs=-1)
@click.option("-o", "--out", "--output", "output", type=_FOLDER, help="new folder; default rosbag2_<date>-<time>")
@click.option("-a", "--all", "everything", is_flag=True, help="every topic that appears, except hidden ones")
@click.option("--attach", multiple=True, metavar="NAME=FILE", help="store a file in the bag")
@click.option("--custom-data", multiple=True, metavar="KEY=VALUE", help="store a text in metadata.yaml")
@click.option("--namespace", default="/", show_default=True, help="of the recorder's node and of relative names")
@_DOMAIN
def record(
    *,
    topics: tuple[str, ...],
    output: Path | None,
    everything: bool,
    attach: tuple[str, ...],
    custom_data: tuple[str, ...],
    namespace: str,
    domain_id: int | None,
) -> None:
    """Record topics until Ctrl-C; QoS follows the publishers, topics may appear late."""
    from slip_bags.recorder import record as run_recorder
    from slip_bags.ros_node import ros_node
    from slip_msgs_py.stop_flag import StopFlag

    try:
        if not (topics or everything):
            raise InputError("bag record", got="no topics", expected="topic names or --all")
        texts, files = _pairs("--custom-data", custom_data), _read_attachments(attach)
        folder = output or Path(f"rosbag2_{datetime.datetime.now():%Y_%m_%d-%H_%M_%S}")
        with StopFlag() as stop, ros_node("recorder", namespace, domain_id) as node:
            if not events.wanted():
                click.echo(f"recording into {folder}; Ctrl-C ends", err=True)
            summary = run_recorder(
                node, folder, topics, stop, everything=everything, custom_data=texts, attachments=files
            )
    except SlipVicError as error:
        events.emit("error", text=str(error))
        raise
    events.emit("done", **summary)
    if not events.wanted():
        click.echo(f"{folder}: {summary['messages']} messages, {summary['lost']} lost")


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
    from slip_bags.ros_node import ros_node
    from slip_msgs_py.stop_flag import StopFlag

    def warn(text: str) -> None:
        click.echo(f"warning: {printable(text)}", err=True)

    with Bag(bag_path) as opened, StopFlag() as stop, ros_node("player", domain=domain_id) as node:
        played = run_player(node, opened, topics, rate=rate, loop=loop, stop=stop, warn=warn)
        click.echo(f"{'stopped: ' if stop() else ''}{played} messages")


def _pairs(option: str, texts: Sequence[str]) -> dict[str, str]:
    pairs = {}
    for text in texts:
        key, sign, value = text.partition("=")
        if not key or not sign:
            raise InputError(option, got=text, expected="KEY=VALUE")
        pairs[key] = value
    return pairs


def _read_attachments(texts: Sequence[str]) -> dict[str, bytes]:
    from slip_core.files.resources import open_file

    contents = {}
    for name, path in _pairs("--attach", texts).items():
        with open_file(Path(path), f"--attach {name}") as file:
            contents[name] = file.read()
    return contents


def run_command(group: click.Group, name: str) -> int:
    """Run a command line and return its exit code: one line and 2 for a user's mistake."""
    from slip_msgs_py.stop_flag import StopFlag

    stop = StopFlag(interrupts=True)
    try:
        # A shell that starts this process in the background ignores SIGINT; it is handled all the same.
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
    except MemoryError:
        click.echo("error: no memory is left for it (see ulimit -v, free -m)", err=True)
        return 2
    except OSError as error:
        if stop() or error.errno not in (errno.EPIPE, errno.ENOSPC):
            raise
        # Output that waits for a full disk or a closed pipe would raise again when the interpreter ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if error.errno == errno.ENOSPC:
            where = error.filename or "the output"
            click.echo(f"error: {where}: got {error.strerror}, expected room; the output is not complete", err=True)
        return 2
    except (KeyboardInterrupt, Exception) as error:
        # A library that is being loaded turns the interrupt into another error: MuJoCo into an ImportError.
        if not stop() and not isinstance(error, KeyboardInterrupt | click.Abort):
            raise
        click.echo("error: interrupted", err=True)
        return 2


def main() -> int:
    """Entry point of ``slip_bag``: the ``bag`` commands without the rest of the suite."""
    return run_command(bag, "slip_bag")


if __name__ == "__main__":
    sys.exit(main())
