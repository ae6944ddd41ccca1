"""The recorder as a process of its own: ``python -m slip_bags.recorder_process --output DIR --topic ...``.

With SLIP_VIC_EVENTS=1 in the environment it tells its parent on stdout: `Ready`, `Status` after every flush, `Warned`,
`Failed` and `Done` with the summary, in the form of `slip_msgs_py.events`.
SIGINT and SIGTERM end the recording; the bag is closed in any case.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Protocol

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import String

from slip_bags.provenance import provenance
from slip_bags.recorder import POLL_S, Recorder, Selection
from slip_bags.session import StopFlag, ros_node
from slip_bags.writer import BagWriter, StorageError, WriterOptions
from slip_core.errors import InputError, SlipVicError
from slip_msgs_py.events import Done, Failed, Ready, Status, emit, warn

READY_TOPIC: Final = "recorder/ready"
QUEUE_DEPTH: Final = 2000
MIN_FREE_BYTES: Final = 64 << 20


@dataclass(frozen=True, slots=True)
class RecordOptions:
    """Everything `record` needs; times in seconds, 0 where there is no limit."""

    output: Path
    selection: Selection
    writer: WriterOptions = field(default_factory=WriterOptions)
    queue_depth: int = QUEUE_DEPTH
    duration_s: float = 0.0
    flush_period_s: float = 1.0
    min_free_bytes: int = MIN_FREE_BYTES
    node_name: str = "recorder"
    namespace: str = "/"


class Listener(Protocol):
    """What a recording tells its surroundings."""

    def ready(self) -> None:
        """Every topic asked for by name has a publisher."""

    def warning(self, message: str) -> None:
        """Something is not recorded as wished."""

    def status(self, recorder: Recorder, elapsed_s: float) -> None:
        """Called after every flush."""


def record(options: RecordOptions, listener: Listener, stop: Callable[[], bool]) -> dict[str, Any]:
    """Record until `stop` says so or the duration has passed; returns the summary that is in the bag as well.

    Raises:
        InputError: the output exists, or a topic's type is not known.
        StorageError: the disk is full or refuses; the bag is closed and readable.
    """
    options.selection.check()
    with ros_node(options.node_name, options.namespace) as node:
        return _record(node, options, listener, stop)


def _record(node: Node, options: RecordOptions, listener: Listener, stop: Callable[[], bool]) -> dict[str, Any]:
    writer = BagWriter(options.output, options.writer)
    writer.custom_data.update(provenance())
    try:
        recorder = Recorder(
            node,
            writer,
            options.selection,
            queue_depth=options.queue_depth,
            warn=listener.warning,
            ignored=(READY_TOPIC,),
        )
        start, start_cpu = time.monotonic(), time.process_time()
        _loop(node, recorder, writer, options, listener, stop)
        cpu_share = (time.process_time() - start_cpu) / max(time.monotonic() - start, 1e-9)
        summary = {**recorder.finish(), "cpu_share": round(cpu_share, 4)}
        writer.custom_data["recorder"] = json.dumps(summary)
        return {"bag": str(options.output), **summary}
    finally:
        writer.close()


def _loop(
    node: Node,
    recorder: Recorder,
    writer: BagWriter,
    options: RecordOptions,
    listener: Listener,
    stop: Callable[[], bool],
) -> None:
    latched = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    ready_publisher = node.create_publisher(String, READY_TOPIC, latched)
    announced = False
    start = now = time.monotonic()
    next_flush = start + options.flush_period_s
    while not stop() and not (options.duration_s and now - start >= options.duration_s):
        recorder.poll()
        if not announced and recorder.ready:
            announced = True
            ready_publisher.publish(String(data="ready"))
            listener.ready()
        now = time.monotonic()
        if now >= next_flush:
            _check_space(options)
            writer.flush()
            next_flush = now + options.flush_period_s
            listener.status(recorder, now - start)
        time.sleep(POLL_S)


def _check_space(options: RecordOptions) -> None:
    free = shutil.disk_usage(options.output).free
    if free < options.min_free_bytes:
        raise StorageError(
            f"bag {options.output}: {free >> 20} MiB left on the disk, less than {options.min_free_bytes >> 20}; "
            "recording stopped, bag closed and readable"
        )


class EventListener(Listener):
    """Tells the parent process; where none listens only warnings, on stderr."""

    def ready(self) -> None:
        """Pass on that the recording is complete from now on."""
        emit(Ready())

    def warning(self, message: str) -> None:
        """Pass a warning on."""
        warn("recorder", message)

    def status(self, recorder: Recorder, elapsed_s: float) -> None:
        """Pass the counters on."""
        emit(Status(*recorder.totals()))


class _AddTopic(argparse.Action):
    """``--topic NAME`` starts an entry, a following ``--type TYPE`` belongs to it."""

    def __call__(self, parser: Any, namespace: Any, values: Any, option_string: str | None = None) -> None:
        topics = list(getattr(namespace, "topics", None) or [])
        if option_string == "--topic":
            topics.append((values, None))
        elif topics and topics[-1][1] is None:
            topics[-1] = (topics[-1][0], values)
        else:
            parser.error("--type must follow the --topic it belongs to")
        namespace.topics = topics


def parse_arguments(arguments: Sequence[str]) -> RecordOptions:
    """Read the command line.

    Raises:
        InputError: an attachment that cannot be read, a pair without ``=``.
    """
    parser = argparse.ArgumentParser(prog="recorder_process", description="Record ROS 2 topics into an MCAP bag.")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of the bag; must not exist")
    parser.add_argument("--topic", dest="topics", action=_AddTopic, metavar="NAME", default=[])
    parser.add_argument("--type", dest="topics", action=_AddTopic, metavar="TYPE", help="type of the --topic before")
    parser.add_argument("--all", action="store_true", help="every topic that appears")
    parser.add_argument("--regex", default="", help="every topic this matches")
    parser.add_argument("--exclude-regex", default="", help="except what this matches")
    parser.add_argument("--include-hidden", action="store_true", help="topics with a part that begins with _ as well")
    parser.add_argument("--compression", choices=("zstd", "lz4", "none"), default="zstd")
    parser.add_argument("--split-bytes", type=int, default=0)
    parser.add_argument("--split-duration", type=float, default=0.0, metavar="S")
    parser.add_argument("--duration", type=float, default=0.0, metavar="S")
    parser.add_argument("--flush-period", type=float, default=1.0, metavar="S")
    parser.add_argument("--min-free-mib", type=int, default=MIN_FREE_BYTES >> 20)
    parser.add_argument("--queue-depth", type=int, default=QUEUE_DEPTH)
    parser.add_argument("--attach", action="append", default=[], metavar="NAME=FILE")
    parser.add_argument("--custom-data", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--node-name", default="recorder")
    parser.add_argument("--namespace", default="/")
    given = parser.parse_args(arguments)
    return RecordOptions(
        output=given.output,
        selection=Selection(tuple(given.topics), given.all, given.regex, given.exclude_regex, given.include_hidden),
        writer=WriterOptions(
            compression=given.compression,
            split_bytes=given.split_bytes,
            split_duration_ns=round(given.split_duration * 1e9),
            custom_data=pairs("--custom-data", given.custom_data),
            attachments=read_attachments(given.attach),
        ),
        queue_depth=given.queue_depth,
        duration_s=given.duration,
        flush_period_s=given.flush_period,
        min_free_bytes=given.min_free_mib << 20,
        node_name=given.node_name,
        namespace=given.namespace,
    )


def pairs(option: str, texts: Sequence[str]) -> dict[str, str]:
    """Split ``key=value`` texts.

    Raises:
        InputError: where one has no key or no ``=``.
    """
    result = {}
    for text in texts:
        key, sign, value = text.partition("=")
        if not key or not sign:
            raise InputError(option, got=text, expected="KEY=VALUE")
        result[key] = value
    return result


def read_attachments(texts: Sequence[str]) -> dict[str, bytes]:
    """Read the files of ``NAME=FILE`` texts.

    Raises:
        InputError: where a text is not of this form or a file cannot be read.
    """
    contents = {}
    for name, path in pairs("--attach", texts).items():
        try:
            contents[name] = Path(path).read_bytes()
        except OSError as error:
            raise InputError(f"--attach {name}", got=f"{path}: {error.strerror}", expected="a readable file") from None
    return contents


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the process; returns its exit code."""
    try:
        with StopFlag().installed() as stop:
            options = parse_arguments(sys.argv[1:] if arguments is None else arguments)
            summary = record(options, EventListener(), lambda: stop.is_set)
    except SlipVicError as error:
        emit(Failed(str(error)))
        print(f"recorder: {error}", file=sys.stderr, flush=True)
        return error.exit_code
    emit(Done(summary))
    return 0


if __name__ == "__main__":
    sys.exit(main())
