"""Record until it is stopped: the loop around a `Recorder`, and its reports."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import String

from slip_bags.provenance import provenance
from slip_bags.recording import QUEUE_DEPTH
from slip_bags.recording.listeners import Listener
from slip_bags.recording.recorder import POLL_S, Recorder, Selection
from slip_bags.ros_node import ros_node
from slip_bags.writer import BagWriter, StorageError, WriterOptions
from slip_msgs_py.messages.transforms import TOPIC as TF_TOPIC

READY_TOPIC: Final = "recorder/ready"
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
    transforms: bool = False
    node_name: str = "recorder"
    namespace: str = "/"


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
    writer.custom_data = {**provenance(), **writer.custom_data}
    try:
        recorder = Recorder(
            node,
            writer,
            options.selection,
            queue_depth=options.queue_depth,
            warn=listener.warning,
            ignored=(READY_TOPIC, TF_TOPIC) if options.transforms else (READY_TOPIC,),
            transforms=options.transforms,
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
