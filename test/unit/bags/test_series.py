"""Columns of decoded values, and what cannot be decoded."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest

from slip_bags.format import TopicInfo
from slip_bags.reader import Bag
from slip_bags.writer import BagWriter
from slip_core.errors import InputError
from test.support.bag_maker import comparable, make_bag

CDR_STRING = b"\x00\x01\x00\x00\x02\x00\x00\x00a\x00"
WRENCH = {"/w": "geometry_msgs/msg/WrenchStamped"}


def test_shapes_and_stamp(tmp_path):
    content = make_bag(tmp_path / "bag", count=20, topics=WRENCH)
    series = Bag(tmp_path / "bag").series("w")
    stamps = [message.header.stamp.sec * 10**9 + message.header.stamp.nanosec for _, _, _, message in content["/w"]]
    assert series.stamps.tolist() == stamps
    assert series.log_time_ns.tolist() == [row[0] for row in content["/w"]]
    assert series.publish_time_ns.tolist() == [row[1] for row in content["/w"]]
    assert series.sequence.tolist() == [row[2] for row in content["/w"]]
    assert series["wrench.force.x"].shape == (20,)
    assert series["wrench.force.x"].dtype == np.float64
    with pytest.raises(ValueError, match="read-only"):
        series["wrench.force.x"][0] = 1.0
    with pytest.raises(InputError, match=r"topic w: unknown field 'force\.x'; did you mean wrench\.force\.x"):
        series.columns("force")


def test_messages_and_columns_agree(tmp_path):
    """Decoded values are those that an independent encoder was given, and so is each cell of a column."""
    content = make_bag(tmp_path / "bag", count=10)
    bag = Bag(tmp_path / "bag")
    for topic, rows in content.items():
        decoded, series = list(bag.messages(topic)), bag.series(topic)
        assert [row[:3] for row in rows] == [message[1:4] for message in decoded]
        assert [comparable(row[3]) for row in rows] == [comparable(message.value) for message in decoded]
        for path, column in series.items():
            for row, cell in zip(rows, column, strict=True):
                value = row[3]
                for name in path.split("."):
                    value = getattr(value, name)
                assert comparable(cell) == comparable(value), (topic, path)
    assert bag.series("/controller/reference_pose").columns("pose.position", "pose.orientation").shape == (10, 7)


@pytest.mark.parametrize(
    ("schema", "data"),
    [
        *(("string data\n", data) for data in (b"", b"\x00", CDR_STRING[:-3], b"\x00\x01\x00\x00")),
        *((schema, CDR_STRING) for schema in ("Self s\n", "no/Such s\n", "wstring s\n", "%$\n", "")),
        *((schema, CDR_STRING) for schema in (f"int8 a\n{'=' * 80}\nMSX: a/B\n", "string s\nfloat64[] v\n")),
    ],
)
def test_schemas_that_make_no_sense_and_messages_that_contradict_theirs(tmp_path, schema, data):
    with contextlib.closing(BagWriter(tmp_path / "bag")) as writer:
        writer.add_topic(TopicInfo("/x", "a/msg/Self"), schema)
        writer.write("/x", 0, 0, 0, data)
    with pytest.raises(InputError, match=r"message on /x|schema of /x|topic /x") as found:
        Bag(tmp_path / "bag").series("x")
    assert "\n" not in str(found.value)
