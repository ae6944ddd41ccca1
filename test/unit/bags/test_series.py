"""Columns of decoded values against an independent decoder, for every installed message type."""

from __future__ import annotations

import dataclasses
import zlib

import numpy as np
import pytest

from slip_bags.reader import Bag, RawMessage, read_series
from slip_bags.series import Series
from slip_bags.typedefs import find_definition
from slip_core.errors import InputError
from slip_msgs_py.messages.layout import Schema
from test.support.bag_maker import STORE, comparable, encode, make_bag, random_message
from test.unit.bags.test_typedefs import INSTALLED

KNOWN = [name for name in INSTALLED if name in STORE.types]
ROWS = 6
HIDDEN = ("__msgtype__", "structure_needs_at_least_one_member")
CDR_STRING = b"\x00\x01\x00\x00\x02\x00\x00\x00a\x00"


def flat(value: object, prefix: str = "") -> dict[str, object]:
    """Return every leaf of a decoded message under its path, arrays of numbers and of texts as one leaf."""
    leaves: dict[str, object] = {}
    for field in dataclasses.fields(value):
        if field.name in HIDDEN or field.name.isupper():
            continue
        item, path = getattr(value, field.name), f"{prefix}{field.name.rstrip('_')}"
        if dataclasses.is_dataclass(item):
            leaves.update(flat(item, f"{path}."))
        elif isinstance(item, list) and item and dataclasses.is_dataclass(item[0]):
            for index, element in enumerate(item):
                leaves.update(flat(element, f"{path}[{index}]."))
        elif not (isinstance(item, list) and not item):
            leaves[path] = comparable(item)
    return leaves


def series_of(type_name: str, messages: list[bytes]) -> Series:
    schema = Schema.from_text(type_name, find_definition(type_name).text)
    return Series(schema, [RawMessage("/x", index, index, index, data) for index, data in enumerate(messages)])


@pytest.mark.parametrize("sizes", [2, None], ids=["equal", "varying"])
@pytest.mark.parametrize("type_name", KNOWN)
def test_every_value_of_every_type(type_name, sizes):
    rng = np.random.default_rng(zlib.crc32(type_name.encode()))
    messages = [random_message(type_name, rng, sizes) for _ in range(ROWS)]
    series = series_of(type_name, [encode(message) for message in messages])
    expected = [flat(message) for message in messages]
    assert series.count == ROWS
    for path in {path for row in expected for path in row}:
        for row, leaves in enumerate(expected):
            if path in leaves:
                assert comparable(series[path][row]) == leaves[path], (path, row)


def test_big_endian_messages_are_read():
    message = random_message("sensor_msgs/msg/JointState", np.random.default_rng(5), 3)
    data = bytes(STORE.serialize_cdr(message, message.__msgtype__, little_endian=False))
    series = series_of("sensor_msgs/msg/JointState", [data, encode(message)])
    assert (series["position"][0] == message.position).all()
    assert (series["position"][1] == message.position).all()


def test_shapes_and_stamp(tmp_path):
    content = make_bag(tmp_path / "bag", count=20, topics={"/w": "geometry_msgs/msg/WrenchStamped"})
    series = read_series(tmp_path / "bag", "w")
    stamps = [message.header.stamp.sec * 10**9 + message.header.stamp.nanosec for _, _, _, message in content["/w"]]
    assert series.stamp_ns.tolist() == stamps
    assert series.log_time_ns.tolist() == [row[0] for row in content["/w"]]
    assert series.publish_time_ns.tolist() == [row[1] for row in content["/w"]]
    assert series.sequence.tolist() == [row[2] for row in content["/w"]]
    assert series["wrench.force.x"].shape == (20,)
    assert series["wrench.force.x"].dtype == np.float64
    with pytest.raises(ValueError, match="read-only"):
        series["wrench.force.x"][0] = 1.0


def test_newest_is_the_last_one_that_was_stamped_by_then(tmp_path):
    make_bag(tmp_path / "bag", count=20, topics={"/w": "geometry_msgs/msg/WrenchStamped"})
    series = read_series(tmp_path / "bag", "w")
    series.stamp_ns = stamps = 1000 * np.arange(1, 21)
    times = np.array([stamps[0] - 1, stamps[0], stamps[1] - 1, stamps[-1] + 10])
    assert series.newest(times).tolist() == [-1, 0, 0, 19]


def test_messages_and_columns_agree(tmp_path):
    content = make_bag(tmp_path / "bag", count=10)
    with Bag(tmp_path / "bag") as bag:
        for topic, rows in content.items():
            decoded = list(bag.messages(topic))
            assert [row[:3] for row in rows] == [message[:3] for message in decoded]
            assert [comparable(row[3]) for row in rows] == [comparable(message.value) for message in decoded]


@pytest.mark.parametrize(
    "data",
    [b"", b"\x00", b"\x00\x03\x00\x00", CDR_STRING[:-3], CDR_STRING[:4] + b"\xff\xff\xff\xff", b"\x00\x01\x00\x00"],
    ids=["empty", "head", "parameter list", "cut", "huge", "no content"],
)
def test_messages_that_contradict_their_schema(data):
    with pytest.raises(InputError, match="message of std_msgs/msg/String"):
        series_of("std_msgs/msg/String", [CDR_STRING, data])


@pytest.mark.parametrize(
    "text",
    ["Self s\n", "no/Such s\n", "wstring s\n", f"int8 a\n{'=' * 80}\nMSX: a/B\n", "%$\n"],
    ids=["recursive", "undefined", "wstring", "separator", "garbage"],
)
def test_schemas_that_make_no_sense(text):
    with pytest.raises(InputError, match="a/msg/Self"):
        Series(Schema.from_text("a/msg/Self", text), [RawMessage("/x", 0, 0, 0, CDR_STRING)])
