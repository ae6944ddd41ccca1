"""The recorder process over DDS: what is published is in the bag, and what is not is counted."""

from __future__ import annotations

import contextlib
import json
import signal
import time
from pathlib import Path

import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosbags.highlevel import AnyReader
from std_msgs.msg import String

from slip_bags import recorder
from slip_bags.format import QosProfile
from slip_bags.reader import Bag
from slip_bags.recover import recover
from slip_bags.writer import BagWriter
from slip_msgs_py.node_main import ros_node as ros_context
from test.support.ros import wait_until

RECORDER = ("-m", "slip_bags.cli", "record", "--output")
RELIABLE = QoSProfile(depth=1000)
BEST_EFFORT = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
COUNT = 200
PAUSE_S = 0.002


class Sender:
    """Publishes numbered texts."""

    def __init__(self, node, topic: str, qos: QoSProfile, label: str = "") -> None:
        self.publisher = node.create_publisher(String, topic, qos)
        self.label = label
        self.sent: list[str] = []

    def send(self, count: int = COUNT) -> None:
        for _ in range(count):
            self.sent.append(f"{self.label}{len(self.sent)}")
            self.publisher.publish(String(data=self.sent[-1]))
            time.sleep(PAUSE_S)

    def wait_matched(self) -> None:
        wait_until(lambda: self.publisher.get_subscription_count() > 0, f"a match on {self.publisher.topic_name}")


def texts(path: Path, topic: str) -> list[str]:
    bag = Bag(path)
    return [message.value.data for message in bag.messages(topic)]


def finish(processes, recorder, signal_number: int = signal.SIGINT) -> dict:
    assert processes.stop(recorder, signal_number) == 0, recorder.tail()
    return dict(recorder.results)


@pytest.mark.smoke
def test_everything_after_the_match_is_recorded(processes, ros_node, tmp_path):
    one, two = Sender(ros_node, "/one", RELIABLE), Sender(ros_node, "/two", BEST_EFFORT)
    (tmp_path / "arm.urdf").write_text("<robot/>")
    recorder = processes.python(
        "recorder", *RECORDER, tmp_path / "bag",
        "/one", "/two",
        *("--attach", "arm.urdf", tmp_path / "arm.urdf", "--custom-data", "scenario", "test"),
    )  # fmt: skip
    one.wait_matched()
    two.wait_matched()
    for _ in range(COUNT):
        one.send(1)
        two.send(1)
    summary = finish(processes, recorder, signal.SIGTERM)
    assert (summary["messages"], summary["lost"]) == (2 * COUNT, 0)
    assert texts(tmp_path / "bag", "/one") == one.sent
    assert texts(tmp_path / "bag", "/two") == two.sent
    bag = Bag(tmp_path / "bag")
    assert bag.custom_data["scenario"] == "test"
    assert bag.custom_data["lost"] == "{}"
    assert bag.attachments["arm.urdf"] == b"<robot/>"
    assert bag.topics["/one"].qos == (QosProfile(),)
    assert bag.topics["/two"].qos == (QosProfile(reliability="best_effort"),)
    rows = list(bag.raw(["/one"]))
    assert [row.sequence for row in rows] == list(range(1, COUNT + 1))
    assert all(0 < row.publish_time_ns < row.log_time_ns for row in rows)
    with AnyReader([tmp_path / "bag"]) as reader:
        assert reader.message_count == 2 * COUNT


def test_late_topics_latched_topics_and_other_namespaces(processes, ros_node, tmp_path):
    early = Sender(ros_node, "/arm/model", LATCHED)
    early.send(1)
    recorder = processes.python(
        "recorder", *RECORDER, tmp_path / "bag", "--all", "model", "/arm/late", "--namespace", "arm"
    )
    early.wait_matched()
    late = Sender(ros_node, "/arm/late", LATCHED)
    late.send(50)
    late.wait_matched()
    late.send(50)
    summary = finish(processes, recorder)
    assert summary["lost"] == 0
    assert texts(tmp_path / "bag", "/arm/model") == early.sent
    assert texts(tmp_path / "bag", "/arm/late") == late.sent
    bag = Bag(tmp_path / "bag")
    assert {"/arm/model", "/arm/late"} <= set(bag.topics)


def test_a_weaker_publisher_that_joins_is_reported(processes, ros_node, tmp_path):
    first = Sender(ros_node, "/x", RELIABLE)
    recorder = processes.python("recorder", *RECORDER, tmp_path / "bag", "/x")
    first.wait_matched()
    first.send(1)
    second = Sender(ros_node, "/x", BEST_EFFORT)
    assert "weaker QoS" in processes.wait_event(recorder, "warning")["text"]
    second.send(1)
    summary = finish(processes, recorder)
    assert (summary["messages"], summary["lost"]) == (1, 0)
    assert texts(tmp_path / "bag", "/x") == first.sent


def test_losses_are_counted_exactly(ros_node, tmp_path, monkeypatch):
    """A burst into a queue of one message: received and lost make up what was sent."""
    monkeypatch.setattr(recorder, "QUEUE_DEPTH", 1)
    sender = Sender(ros_node, "/x", QoSProfile(depth=10))
    sent = 1 + 5 * COUNT
    with ros_context("other") as node, contextlib.closing(BagWriter(tmp_path / "bag")) as writer:
        recording = recorder.Recorder(node, writer, ["/x"], everything=False)
        wait_until(lambda: recording.poll() or sender.publisher.get_subscription_count() > 0, "the publisher")
        sender.send(1)
        wait_until(lambda: recording.poll() or writer.counts["/x"] == 1, "the first message")
        for _ in range(sent - 1):
            sender.publisher.publish(String(data="burst"))
        # The newest message always stays in the queue, so in the end everything is accounted for.
        wait_until(lambda: recording.poll() or writer.counts["/x"] + recording._topics["/x"].lost == sent, "the end")
        received, lost = recording.run(lambda: True)
    assert received + lost == sent
    assert json.loads(Bag(tmp_path / "bag").custom_data["lost"]) == {"/x": lost}
    assert lost > 0
    assert len(texts(tmp_path / "bag", "/x")) == received


@pytest.mark.parametrize(("file", "line"), [([], "2 arguments"), (["/no/such/file"], "a readable file")])
def test_bad_options_end_in_one_line_and_leave_nothing(processes, tmp_path, file, line):
    recorder = processes.python("recorder", *RECORDER, tmp_path / "bag", "--all", "--attach", "a", *file)
    assert processes.wait_end(recorder) == 2
    assert line in recorder.lines[-1]
    assert not (tmp_path / "bag").exists()


def test_killed_recording_is_recovered_without_gaps(processes, ros_node, tmp_path):
    """What was flushed is there, complete from the first message on."""
    sender = Sender(ros_node, "/x", RELIABLE)
    recorder = processes.python("recorder", *RECORDER, tmp_path / "bag", "/x")
    sender.wait_matched()
    sender.send(50)
    file = tmp_path / "bag" / "bag_0.mcap"
    before = file.stat().st_size
    wait_until(lambda: sender.send(1) or file.stat().st_size > before, "what was sent on the disk")
    recorder.send_signal(signal.SIGKILL)
    assert processes.wait_end(recorder) == -signal.SIGKILL
    assert not (tmp_path / "bag" / "metadata.yaml").exists()
    recover(tmp_path / "bag", tmp_path / "out")
    found = texts(tmp_path / "out", "/x")
    assert found == sender.sent[: len(found)]
    assert len(found) >= 50
