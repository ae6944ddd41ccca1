"""Measurements of recording and storage: ``python test/system/bags/measure.py load|storage``; nothing is asserted.

load   topics at a fixed rate from one process into the recorder: losses and the recorder's CPU share
storage CPU time per message of a recorded run, written and read, and to open it
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

TYPES = (
    "sensor_msgs/msg/JointState",
    "geometry_msgs/msg/WrenchStamped",
    "geometry_msgs/msg/TwistStamped",
    "std_msgs/msg/Float64MultiArray",
    "rosgraph_msgs/msg/Clock",
)
JOINTS = 7
DEPTH = 1000
FREE_DOMAINS = (60, 100)


def topic_types(count: int) -> dict[str, str]:
    return {f"/t{index}": TYPES[index % len(TYPES)] for index in range(count)}


def publish(count: int, rate_hz: float, seconds: float) -> None:
    """Publish `count` topics at `rate_hz` each, on an absolute schedule, as soon as all are subscribed."""
    import rclpy
    from rclpy.qos import QoSProfile
    from rclpy.serialization import serialize_message

    from slip_msgs_py.environment import choose_transport

    choose_transport()
    rclpy.init(args=[])
    node = rclpy.create_node("source", start_parameter_services=False, enable_rosout=False)
    publishers = []
    for name, type_name in topic_types(count).items():
        package, _, kind = type_name.split("/")
        message = getattr(importlib.import_module(f"{package}.msg"), kind)()
        if kind == "JointState":
            message.name = [f"joint{index}" for index in range(JOINTS)]
            message.position = message.velocity = message.effort = [0.1] * JOINTS
        elif kind == "Float64MultiArray":
            message.data = [0.1] * JOINTS
        data = bytes(serialize_message(message))
        publishers.append((node.create_publisher(type(message), name, QoSProfile(depth=DEPTH)), data))
    while not all(publisher.get_subscription_count() for publisher, _ in publishers):
        time.sleep(0.01)
    sys.stdin.readline()  # the recorder is ready
    start = time.monotonic()
    rounds = 0
    while (due := start + rounds / rate_hz) < start + seconds:
        time.sleep(max(0.0, due - time.monotonic()))
        for publisher, data in publishers:
            publisher.publish(data)
        rounds += 1
    print(rounds, flush=True)
    sys.stdin.readline()
    node.destroy_node()
    rclpy.try_shutdown()


@contextlib.contextmanager
def running(bag: Path, count: int, rate_hz: float, seconds: float) -> Iterator[tuple[Any, Any]]:
    """Start source and recorder in a domain of their own; both are ended at the end of the block."""
    environment = {
        **os.environ,
        "ROS_DOMAIN_ID": str(random.randrange(*FREE_DOMAINS)),
        "SLIP_VIC_EVENTS": "1",
    }
    command = ["-m", "slip_bags.cli", "record", "--output", str(bag)]
    command += topic_types(count)
    pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True, "env": environment}
    recorder = subprocess.Popen([sys.executable, *command], **pipes)
    source_command = [__file__, "publish", "--topics", str(count), "--rate", str(rate_hz), "--seconds", str(seconds)]
    source = subprocess.Popen([sys.executable, *source_command], **pipes)
    try:
        while json.loads(recorder.stdout.readline() or '{"event": "ready"}')["event"] != "ready":
            pass  # the line that is read is all there is to do
        source.stdin.write("go\n")
        source.stdin.flush()
        yield source, recorder
    finally:
        for process in (source, recorder):
            process.kill()
            process.wait()


def load(count: int, rate_hz: float, seconds: float) -> None:
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / "bag"
        with running(bag, count, rate_hz, seconds) as (source, recorder):
            rounds = int(source.stdout.readline())
            time.sleep(1.0)
            recorder.send_signal(signal.SIGINT)
            lines = [json.loads(line) for line in recorder.stdout]
            summary = lines[-1]["values"]
        size = sum(path.stat().st_size for path in bag.iterdir())
    missed = sum(topic["missed_at_start"] for topic in summary["topics"].values())
    print(
        f"{count} topics x {rate_hz:g} Hz x {seconds:g} s: sent {rounds * count}, "
        f"recorded {summary['messages']}, lost {summary['lost']}, missed at start {missed}, "
        f"recorder CPU {100 * summary['cpu_share']:.1f} % of a core, {size / 2**20:.1f} MiB, "
        f"queue peak {summary['largest_batch']}/{summary['queue_depth']}, longest poll {summary['longest_gap_ms']} ms"
    )


def storage(path: str, repeat: int) -> None:
    from slip_bags.reader import Bag
    from slip_bags.writer import BagWriter

    with Bag(path) as bag:
        messages = list(bag.raw())
        topics = {name: (info, bag.schema_text(name)) for name, info in bag.topics.items()}

    def timed(work: Callable[[int], object]) -> float:
        times = []
        for number in range(repeat):
            start = time.process_time()
            work(number)
            times.append(time.process_time() - start)
        return min(times)

    def columns(bag: Bag) -> None:
        for name in bag.topics:
            bag.series(name)

    with tempfile.TemporaryDirectory() as folder:

        def write(number: int) -> None:
            made = BagWriter(Path(folder) / str(number))
            for info, text in topics.values():
                made.add_topic(info, text)
            for m in messages:
                made.write(m.topic, m.log_time_ns, m.publish_time_ns, m.sequence, m.data)
            made.close()

        reads = {"raw": lambda bag: sum(1 for _ in bag.raw()), "series of every topic": columns}
        print(f"write: {1e6 * timed(write) / len(messages):.2f} us per message of {len(messages)}, best of {repeat}")
        print(f"open: {1e3 * timed(lambda _: Bag(path).close()):.2f} ms")
        for name, read in reads.items():
            seconds = timed(lambda _, read=read: read(Bag(path)))
            print(f"{name}: {1e6 * seconds / len(messages):.2f} us per message")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("load", "storage", "publish"))
    parser.add_argument("--topics", type=int, default=5)
    parser.add_argument("--rate", type=float, default=1000.0)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--bag", default="bags/paper_planar_vic")
    given = parser.parse_args()
    if given.what == "publish":
        publish(given.topics, given.rate, given.seconds)
    elif given.what == "load":
        load(given.topics, given.rate, given.seconds)
    else:
        storage(given.bag, given.repeat)


if __name__ == "__main__":
    main()
