"""`bag info`, and a topic as a table."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

from slip_bags.cli import bag as bag_command
from slip_bags.reader import Bag
from slip_core.errors import InputError, SlipVicError
from test.support.bag_maker import PERIOD_NS, SUITE_TOPICS, make_bag

WRENCH = {"/w": "geometry_msgs/msg/WrenchStamped"}


def lines(folder) -> list[str]:
    return CliRunner().invoke(bag_command, ["info", str(folder)], catch_exceptions=False).output.splitlines()


def test_attachments_custom_data_and_rates(tmp_path):
    attached = {"controller.params.yaml": b"gains: 1\n"}
    make_bag(tmp_path / "bag", count=5, custom_data={"scenario": "paper"}, attachments=attached)
    found = lines(tmp_path / "bag")
    rate = 5 / (4 * PERIOD_NS * 1e-9 + 1e-6 * (len(SUITE_TOPICS) - 1))
    assert found[2:4] == ["attachment controller.params.yaml, 9 B", "scenario: paper"]
    assert f"/wrench [geometry_msgs/msg/WrenchStamped]: 5 messages, {rate:.2f} Hz, reliable, volatile" in found
    assert len(found) == 4 + len(SUITE_TOPICS)


@pytest.mark.parametrize("topics", [WRENCH, {}])
def test_bags_without_messages(tmp_path, topics):
    make_bag(tmp_path / "bag", count=0, topics=topics)
    found = lines(tmp_path / "bag")
    assert found[1].startswith("0 messages in 0.000 s")
    assert all(": 0 messages" in line for line in found[2:])


def test_control_characters_are_escaped(tmp_path):
    assert str(SlipVicError("/a\x1b[2J\n\u202e é [red]")) == "/a\\x1b[2J\n\\u202e é [red]"
    name = "/\x1b[2Ja"
    make_bag(tmp_path / "bag", count=1, topics={name: WRENCH["/w"]}, custom_data={"k\x07": "v\x1b"})
    text = "".join(lines(tmp_path / "bag"))
    assert not {"\x1b", "\x07"} & set(text)
    assert "\\x1b[2Ja" in text


def test_a_topic_as_a_table(tmp_path):
    content = make_bag(tmp_path / "bag", count=20, topics={"/m": "std_msgs/msg/Header", **WRENCH})
    table = Bag(tmp_path / "bag").series("w").dataframe()
    assert table["wrench.force.x"].tolist() == [row[3].wrench.force.x for row in content["/w"]]
    assert (table["stamp_ns"] == table["header.stamp.sec"] * 10**9 + table["header.stamp.nanosec"]).all()
    assert "stamp_ns" in Bag(tmp_path / "bag").series("m").dataframe()


def test_record_without_topics_is_refused():
    with pytest.raises(InputError, match="topic names or --all"):
        CliRunner().invoke(bag_command, ["record"], catch_exceptions=False)
