"""`bag info`, and a topic as a table."""

from __future__ import annotations

import json

import numpy as np
import pytest
from click.testing import CliRunner

from slip_bags.cli import bag as bag_command
from slip_bags.format import TopicInfo
from slip_bags.frame import dataframe
from slip_bags.info import report
from slip_bags.reader import Bag
from slip_bags.typedefs import find_definition
from slip_bags.writer import BagWriter
from slip_core.errors import InputError, SlipVicError
from test.support.bag_maker import PERIOD_NS, STORE, SUITE_TOPICS, encode, make_bag

WRENCH = {"/w": "geometry_msgs/msg/WrenchStamped"}


def lines(folder) -> list[str]:
    with Bag(folder) as bag:
        return list(report(bag))


def test_rates_and_recorded_losses(tmp_path):
    counted = {"recorder": json.dumps({"topics": {"/w": {"lost": 42}}})}
    make_bag(tmp_path / "bag", count=5, topics=WRENCH, custom_data=counted)
    rate = 5 / (4 * PERIOD_NS * 1e-9)
    assert lines(tmp_path / "bag")[2:] == [
        f"/w [geometry_msgs/msg/WrenchStamped]: 5 messages, {rate:.2f} Hz, 42 lost, reliable, volatile"
    ]


@pytest.mark.parametrize("text", ["", "[]", "3", '{"topics": 3}', '{"topics": {"/w": {}}}'])
def test_losses_that_make_no_sense_are_unknown(tmp_path, text):
    make_bag(tmp_path / "bag", count=1, topics=WRENCH, custom_data={"recorder": text})
    assert "losses unknown" in lines(tmp_path / "bag")[-1]


@pytest.mark.parametrize("topics", [WRENCH, {}])
def test_bags_without_messages(tmp_path, topics):
    make_bag(tmp_path / "bag", count=0, topics=topics)
    assert lines(tmp_path / "bag")[1] == "0 messages in 0.000 s"


def test_the_command_prints_the_report(tmp_path):
    attached = {"controller.params.yaml": b"gains: 1\n"}
    make_bag(tmp_path / "bag", count=5, custom_data={"scenario": "paper"}, attachments=attached)
    found = CliRunner().invoke(bag_command, ["info", str(tmp_path / "bag")]).output.splitlines()
    assert found == lines(tmp_path / "bag")
    assert {"attachment controller.params.yaml, 9 B", "scenario: paper"} < set(found)
    assert len(found) == 4 + len(SUITE_TOPICS)


def test_control_characters_are_escaped(tmp_path):
    assert str(SlipVicError("/a\x1b[2J\n\u202e é [red]")) == "/a\\x1b[2J\n\\u202e é [red]"
    name = "/\x1b[2Ja"
    make_bag(tmp_path / "bag", count=1, topics={name: WRENCH["/w"]}, custom_data={"k\x07": "v\x1b"})
    text = "".join(lines(tmp_path / "bag"))
    assert not {"\x1b", "\x07"} & set(text)
    assert "\\x1b[2Ja" in text


@pytest.mark.parametrize("count", [1, 3])
def test_joint_states_get_columns_by_joint(tmp_path, count):
    kind = "sensor_msgs/msg/JointState"
    header = STORE.types["std_msgs/msg/Header"](STORE.types["builtin_interfaces/msg/Time"](0, 5), "ee")
    writer = BagWriter(tmp_path / "bag")
    writer.add_topic(TopicInfo("/j", kind), find_definition(kind))
    for index in range(count):
        values = np.array([index, 10.0 + index])
        message = STORE.types[kind](header, ["shoulder", "elbow"], values, values * 2, np.zeros(0))
        writer.write("/j", index, index, index, encode(message))
    writer.close()
    with Bag(tmp_path / "bag") as bag:
        table = dataframe(bag, "j")
    assert table["position.elbow"].tolist() == [10.0, 11.0, 12.0][:count]
    assert table["velocity.shoulder"].tolist() == [0.0, 2.0, 4.0][:count]
    assert not [name for name in table if name.startswith("effort")]


def test_record_without_topics_is_refused():
    with pytest.raises(InputError, match="topic names or --all"):
        CliRunner().invoke(bag_command, ["record"], catch_exceptions=False)
