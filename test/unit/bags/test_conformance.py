"""Bags of ours in independent readers: equal counts, times, payloads and decoded values."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from slip_bags.format import QosProfile
from test.support.bag_maker import comparable, encode, make_bag

COUNT = 60
QOS = (QosProfile(), QosProfile(reliability="best_effort"))


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> tuple[Path, dict[str, list[tuple[int, int, int, Any]]]]:
    folder = tmp_path_factory.mktemp("recorded") / "bag"
    attached = {"arm.urdf": b"<robot/>"}
    return folder, make_bag(folder, count=COUNT, custom_data={"n": "1"}, attachments=attached, flush_every=20, qos=QOS)


def test_rosbags_reads_the_folder(recorded):
    folder, content = recorded
    with AnyReader([folder]) as reader:
        assert reader.message_count == sum(len(rows) for rows in content.values())
        found: dict[str, list[Any]] = {}
        for connection, log_time, data in reader.messages():
            value = reader.deserialize(data, connection.msgtype)
            found.setdefault(connection.topic, []).append((log_time, bytes(data), comparable(value)))
    expected = {
        topic: [(row[0], encode(row[3]), comparable(row[3])) for row in rows] for topic, rows in content.items()
    }
    assert found == expected


def test_mcap_reader_validates_and_finds_everything(recorded):
    folder, content = recorded
    with (folder / "bag_0.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        found: dict[str, list[Any]] = {}
        for _, channel, message in reader.iter_messages():
            row = (message.log_time, message.publish_time, message.sequence, message.data)
            found.setdefault(channel.topic, []).append(row)
        assert found == {topic: [(*row[:3], encode(row[3])) for row in rows] for topic, rows in content.items()}
        statistics = reader.get_summary().statistics
        assert statistics.message_count == COUNT * len(content)
        assert [record.name for record in reader.iter_attachments()] == ["arm.urdf"]
        records = list(reader.iter_metadata())
    assert [record.name for record in records] == ["rosbag2", "rosbag2"]
    first, last = (record.metadata["serialized_metadata"] for record in records)
    assert "nanoseconds_since_epoch: 9223372036854775807" in first
    metadata = (folder / "metadata.yaml").read_text()
    assert [line[2:] for line in metadata.splitlines()[1:]] == last.splitlines()
