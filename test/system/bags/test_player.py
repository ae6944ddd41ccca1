"""Playing over DDS: same bytes, same order, the chosen topics, time and rate; keys on a terminal."""

from __future__ import annotations

import os
import pty
import re
import select
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from geometry_msgs.msg import WrenchStamped

from slip_bags.reader import Bag
from slip_bags.recording.raw_subscription import Arrival, RawSubscription, recording_qos
from slip_bags.ros_node import request_realtime
from slip_vic.cli import main
from test.support.bag_maker import PERIOD_NS, START_NS, make_bag
from test.support.ros import DEADLINE_S, wait_until

RECORDER = ("-m", "slip_bags.cli", "record", "--output")
PLAY = ("-m", "slip_vic.cli", "bag", "play")
TOPICS = {"/a": "sensor_msgs/msg/JointState", "/b": "geometry_msgs/msg/WrenchStamped"}
COUNT = 300


@pytest.fixture(scope="module")
def bag(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("player") / "bag"
    make_bag(folder, count=COUNT, topics=TOPICS)
    return folder


def start_recorder(processes, folder: Path, *topics: str):
    return processes.python("recorder", *RECORDER, folder, *topics, "--flush-period", "0.1")


def play(processes, *arguments: object) -> str:
    done = subprocess.run(
        [sys.executable, *PLAY, *map(str, arguments)],
        env=processes.environment,
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def contents(folder: Path, topic: str) -> list[bytes]:
    with Bag(folder) as opened:
        return [message.data for message in opened.raw([topic])]


@pytest.mark.smoke
def test_what_was_recorded_is_played(processes, bag, tmp_path):
    recorder = start_recorder(processes, tmp_path / "again", "/a", "/b")
    output = play(processes, bag, "--wait-for-subscribers")
    assert processes.stop(recorder, signal.SIGINT) == 0
    assert f"{2 * COUNT} messages" in output
    assert recorder.results["lost"] == 0
    with Bag(tmp_path / "again") as again, Bag(bag) as original:
        assert {name: topic.qos for name, topic in again.topics.items()} == {
            name: topic.qos for name, topic in original.topics.items()
        }
        assert {name: topic.type_hash for name, topic in again.topics.items()} == {
            name: topic.type_hash for name, topic in original.topics.items()
        }
    for topic in TOPICS:
        assert contents(tmp_path / "again", topic) == contents(bag, topic)


def test_part_of_the_bag_under_another_name_with_clock(processes, bag, tmp_path):
    recorder = start_recorder(processes, tmp_path / "again", "/c", "/clock")
    output = play(
        processes, bag, "--topics", "a", "--remap", "a:=/c", "--clock", "1000", "--rate", "0.5",
        "--start-offset", "0.1", "--playback-duration", "0.05", "--wait-for-subscribers", "--delay", "2",
    )  # fmt: skip
    assert processes.stop(recorder, signal.SIGINT) == 0
    assert "51 messages" in output
    assert contents(tmp_path / "again", "/c") == contents(bag, "/a")[100:151]
    with Bag(tmp_path / "again") as again:
        assert set(again.topics) == {"/c", "/clock"}
        stamps = again.series("/clock").stamp_ns
    assert stamps[0] == START_NS + 100 * PERIOD_NS
    assert set(stamps[1:] - stamps[:-1]) == {PERIOD_NS // 2}  # 1 kHz at half the speed
    assert stamps[-1] <= START_NS + 150 * PERIOD_NS


def test_loops_until_interrupted(processes, ros_node, bag):
    heard: list[Arrival] = []
    listener = RawSubscription(ros_node, WrenchStamped, "/b", recording_qos(2000, reliable=True, transient_local=False))
    player = processes.python("player", *PLAY, bag, "--loop", "--rate", "10", "--wait-for-subscribers", "--topics", "b")
    wait_until(lambda: heard.extend(listener.drain()) or len(heard) > 2 * COUNT, "the third loop")
    assert processes.stop(player, signal.SIGINT) == 0
    assert "stopped" in player.lines[-1]
    messages = int(re.search(r"(\d+) messages", player.lines[-1])[1])
    assert messages > 2 * COUNT


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["--topics", "/joint"], "no such topic"),
        (["--start-offset", "100"], "at most 0.299 s"),
        (["--exclude-regex", "."], "no topic that can be played"),
        (["--regex", "("], "a regular expression"),
    ],
    ids=["topic", "offset", "nothing left", "regex"],
)
def test_bad_options_end_in_one_line(processes, bag, arguments, line):
    player = processes.python("player", *PLAY, bag, *arguments)
    assert processes.wait_end(player) == 2
    assert len(player.lines) == 1
    assert line in player.lines[0]


@pytest.mark.parametrize(
    ("arguments", "line"),
    [(["--remap", "a=b"], "OLD:=NEW"), (["--rate", "0"], "--rate")],
)
def test_what_no_option_can_be_is_one_line_before_there_is_a_node(bag, arguments, line, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["slip-vic", "bag", "play", str(bag), *arguments])
    assert main() == 2
    errors = capsys.readouterr().err.splitlines()
    assert len(errors) == 1
    assert line in errors[0]


class Terminal:
    """A player on a pseudo terminal: keys go in, what it shows is kept."""

    def __init__(self, processes, *arguments: object) -> None:
        self.master, slave = pty.openpty()
        self.process = subprocess.Popen(
            [sys.executable, *PLAY, *map(str, arguments)],
            env=processes.environment,
            stdin=slave,
            stdout=slave,
            stderr=slave,
            start_new_session=True,
        )
        os.close(slave)
        self.shown = ""

    def press(self, keys: str) -> None:
        os.write(self.master, keys.encode())

    def wait(self, pattern: str) -> str:
        """Wait until something new matches; return it."""
        end = time.monotonic() + DEADLINE_S
        while (found := re.search(pattern, self.shown)) is None:
            assert time.monotonic() < end, f"{pattern!r} not in {self.shown[-500:]!r}"
            if select.select([self.master], [], [], 0.1)[0]:
                try:
                    self.shown += os.read(self.master, 65536).decode()
                except OSError:  # the other side has closed
                    assert re.search(pattern, self.shown), f"{pattern!r} not in {self.shown[-500:]!r}"
        self.shown = self.shown[found.end() :]
        return found[0]

    def close(self) -> int:
        try:
            return self.process.wait(DEADLINE_S)
        finally:
            self.process.kill()
            os.close(self.master)


def test_keys_pause_step_and_change_the_rate(processes, bag):
    terminal = Terminal(processes, bag, "--start-paused", "--rate", "0.5")
    terminal.wait(r"0 messages  paused")
    terminal.press("s")
    terminal.wait(r" 1 messages  paused")
    terminal.press("\x1b[Cs")
    terminal.wait(r" 3 messages  paused")
    terminal.press("\x1b[B \x1b[A")
    terminal.wait(r"x 0\.50")
    terminal.wait(rf"\n{2 * COUNT} messages, timing error")
    assert terminal.close() == 0


def test_quit_key_and_terminal_restored(processes, bag):
    terminal = Terminal(processes, bag, "--start-paused")
    terminal.wait("paused")
    terminal.press("q")
    terminal.wait("stopped: 0 messages")
    assert terminal.close() == 0


def test_without_privilege_it_plays_all_the_same(monkeypatch):
    def refuse(*_: object) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    assert request_realtime() is False
