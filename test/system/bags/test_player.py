"""Playing over DDS: same bytes, same order, the chosen topics, rate and loops."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from geometry_msgs.msg import WrenchStamped

from slip_bags.format import BagMessage
from slip_bags.reader import Bag
from slip_bags.recorder import RawSubscription
from slip_msgs_py.qos import profile
from test.support.bag_maker import PERIOD_NS, make_bag
from test.support.ros import DEADLINE_S, Processes, wait_until

RECORDER = ("-m", "slip_bags.cli", "record", "--output")
PLAY = ("-m", "slip_vic.cli", "bag", "play")
TOPICS = {"/a": "sensor_msgs/msg/JointState", "/b": "geometry_msgs/msg/WrenchStamped"}
COUNT = 300


@pytest.fixture(scope="module")
def bag(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("player") / "bag"
    make_bag(folder, count=COUNT, topics=TOPICS)
    return folder


def play_recorded(processes, folder: Path, *arguments: object) -> str:
    """Play while a recorder of all topics runs; return what the player prints."""
    recorder = processes.python("recorder", *RECORDER, folder, "--all")
    wait_until(folder.exists, "the recorder")
    done = subprocess.run(
        [sys.executable, *PLAY, *map(str, arguments)],
        env=processes.environment,
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert processes.stop(recorder, signal.SIGINT) == 0
    assert recorder.results["lost"] == 0
    return done.stdout


def contents(folder: Path, topic: str) -> list[bytes]:
    opened = Bag(folder)
    return [message.value for message in opened.raw([topic])]


@pytest.mark.smoke
def test_what_was_recorded_is_played(processes, bag, tmp_path):
    assert play_recorded(processes, tmp_path / "again", bag) == f"{2 * COUNT} messages\n"
    again = Bag(tmp_path / "again")
    for name, topic in Bag(bag).topics.items():
        assert again.topics[name] == topic
    for topic in TOPICS:
        assert contents(tmp_path / "again", topic) == contents(bag, topic)


def test_chosen_topic_at_another_rate(processes, bag, tmp_path):
    output = play_recorded(processes, tmp_path / "again", bag, "--topics", "a", "--rate", "0.5")
    assert output == f"{COUNT} messages\n"
    again = Bag(tmp_path / "again")
    assert "/b" not in again.topics
    sent = again.series("/a").publish_time_ns
    assert sent[-1] - sent[0] >= 0.99 * 2 * (COUNT - 1) * PERIOD_NS


def test_loops_until_interrupted(processes, ros_node, bag):
    heard: list[BagMessage] = []
    listener = RawSubscription(ros_node, WrenchStamped, "/b", profile(2000, reliable=True, latched=False))
    player = processes.python("player", *PLAY, bag, "--loop", "--rate", "10", "--topics", "b")
    wait_until(lambda: heard.extend(listener.drain()) or len(heard) > 2 * COUNT, "the third loop")
    assert processes.stop(player, signal.SIGINT) == 0
    assert "stopped" in player.lines[-1]
    assert int(re.search(r"(\d+) messages", player.lines[-1])[1]) > 2 * COUNT


def test_a_name_that_ros_does_not_allow_is_left_out(processes: Processes, tmp_path: Path) -> None:
    make_bag(tmp_path / "bag", count=3, topics={f"/{'x' * 300}": "geometry_msgs/msg/WrenchStamped", **TOPICS})
    player = processes.python("player", *PLAY, tmp_path / "bag")
    assert processes.wait_end(player) == 0
    assert "is not played: Invalid topic name" in player.last["warning"]["text"]
    assert player.lines[-1] == "6 messages"


@pytest.mark.parametrize(
    ("arguments", "line"), [(["--topics", "/joint"], "no such topic"), (["--rate", "0"], "--rate")]
)
def test_bad_options_end_in_one_line(processes, bag, arguments, line):
    player = processes.python("player", *PLAY, bag, *arguments)
    assert processes.wait_end(player) == 2
    assert len(player.lines) == 1
    assert line in player.lines[0]
