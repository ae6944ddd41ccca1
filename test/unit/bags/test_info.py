"""`bag info`, and a topic as a table."""

from __future__ import annotations

import json

import numpy as np
import pytest
from click.testing import CliRunner

from slip_bags.cli import bag as bag_command
from slip_bags.format import TopicInfo
from slip_bags.frame import dataframe
from slip_bags.info import bag_report, printable
from slip_bags.reader import Bag
from slip_bags.typedefs import find_definition
from slip_bags.writer import BagWriter
from slip_core.errors import InputError
from test.support.bag_maker import PERIOD_NS, STORE, SUITE_TOPICS, encode, make_bag

WRENCH = {"/w": "geometry_msgs/msg/WrenchStamped"}


def run(*arguments: object) -> str:
    result = CliRunner().invoke(bag_command, [str(part) for part in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.output


def test_rates_and_recorded_losses(tmp_path):
    counted = {"recorder": json.dumps({"topics": {"/w": {"lost": 42}}})}
    make_bag(tmp_path / "bag", count=5, topics=WRENCH, custom_data=counted)
    with Bag(tmp_path / "bag") as bag:
        (topic,) = bag_report(bag)["topics"]
    assert topic["message_count"] == 5
    assert topic["rate_hz"] == pytest.approx(5 / (4 * PERIOD_NS * 1e-9))
    assert (topic["lost"], topic["qos"]) == (42, ["reliable, volatile"])


@pytest.mark.parametrize("text", ["", "[]", "3", '{"topics": 3}', '{"topics": {"/w": {}}}'])
def test_losses_that_make_no_sense_are_unknown(tmp_path, text):
    make_bag(tmp_path / "bag", count=1, topics=WRENCH, custom_data={"recorder": text})
    with Bag(tmp_path / "bag") as bag:
        assert bag_report(bag)["topics"][0]["lost"] is None


def test_bag_without_messages(tmp_path):
    make_bag(tmp_path / "bag", count=0, topics=WRENCH)
    with Bag(tmp_path / "bag") as bag:
        report = bag_report(bag)
    assert (report["message_count"], report["start_ns"], report["topics"][0]["rate_hz"]) == (0, None, None)
    assert "0 in 0.000 s" in run("info", tmp_path / "bag")


def test_bag_without_topics(tmp_path):
    make_bag(tmp_path / "bag", count=0, topics={})
    assert "0 in 0.000 s" in run("info", tmp_path / "bag")


def test_info_as_text_and_json(tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    attached = {"controller.params.yaml": b"gains: 1\n"}
    content = make_bag(tmp_path / "bag", count=5, custom_data={"scenario": "paper"}, attachments=attached)
    text = run("info", tmp_path / "bag")
    for part in ("bag_0.mcap", "controller.params.yaml (9 B)", "scenario", "zstd", *SUITE_TOPICS):
        assert part in text
    data = json.loads(run("info", tmp_path / "bag", "--json"))
    assert data["message_count"] == 5 * len(content)
    assert [topic["name"] for topic in data["topics"]] == sorted(SUITE_TOPICS)
    assert run("info", tmp_path / "bag", "--attachment", "controller.params.yaml") == "gains: 1\n"
    with pytest.raises(InputError, match=r"known: controller\.params\.yaml|did you mean"):
        run("info", tmp_path / "bag", "--attachment", "x")


def test_control_characters_are_escaped(tmp_path):
    assert printable("/a\x1b[2J\n\u202e é [red]").plain == "/a\\x1b[2J\\n\\u202e é [red]"
    name = "/\x1b[2Ja"
    make_bag(tmp_path / "bag", count=1, topics={name: WRENCH["/w"]}, custom_data={"k\x07": "v\x1b"})
    text = run("info", tmp_path / "bag")
    assert not {"\x1b", "\x07"} & set(text)
    assert "\\x1b[2Ja" in text


def test_table_holds_the_recorded_bits(tmp_path):
    rows = make_bag(tmp_path / "bag", count=40, topics=WRENCH)["/w"]
    with Bag(tmp_path / "bag") as bag:
        read = dataframe(bag, "w")
    assert read["log_time_ns"].tolist() == [row[0] for row in rows]
    assert read["header.frame_id"].tolist() == [row[3].header.frame_id for row in rows]
    assert read["stamp_ns"].tolist() == [row[3].header.stamp.sec * 10**9 + row[3].header.stamp.nanosec for row in rows]
    for part, axis in (("force", "x"), ("torque", "z")):
        expected = np.array([getattr(getattr(row[3].wrench, part), axis) for row in rows])
        assert (read[f"wrench.{part}.{axis}"].to_numpy().view(np.uint64) == expected.view(np.uint64)).all()


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


def test_fields_of_varying_length_become_json(tmp_path):
    content = make_bag(tmp_path / "bag", count=30, topics={"/d": "std_msgs/msg/Float64MultiArray"})
    with Bag(tmp_path / "bag") as bag:
        table = dataframe(bag, "/d")
    assert [json.loads(cell) for cell in table["data"]] == [row[3].data.tolist() for row in content["/d"]]


def test_record_without_topics_is_refused():
    with pytest.raises(InputError, match="topic names or --all"):
        run("record")
