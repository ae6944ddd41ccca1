"""Bags of ours in independent readers: equal counts, times, payloads and decoded values."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import shutil
import struct
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import NonSeekingReader, make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from slip_bags.format import QosProfile
from test.support.bag_maker import comparable, encode, make_bag

COUNT = 60
QOS = (QosProfile(), QosProfile(reliability="best_effort"))
NPM_PACKAGES = (
    "@mcap/core@2.2.2",
    "@mcap/nodejs@1.0.2",
    "@mcap/support@1.1.0",
    "@foxglove/rosmsg@5.0.5",
    "@foxglove/rosmsg2-serialization@3.1.0",
)
NPM_TIMEOUT_S = 180
NODE_TIMEOUT_S = 60


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> tuple[Path, dict[str, list[tuple[int, int, int, Any]]]]:
    folder = tmp_path_factory.mktemp("recorded") / "bag"
    attached = {"arm.urdf": b"<robot/>"}
    return folder, make_bag(folder, count=COUNT, custom_data={"n": "1"}, attachments=attached, flush_every=20, qos=QOS)


def test_rosbags_reads_folder_and_checks_the_hashes(recorded):
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


def test_mcap_reader_without_index(recorded):
    folder, content = recorded
    with (folder / "bag_0.mcap").open("rb") as file:
        messages = list(NonSeekingReader(file, validate_crcs=True).iter_messages(log_time_order=False))
    assert len(messages) == COUNT * len(content)


def test_mcap_ros2_support_decodes_the_same_values(recorded):
    folder, content = recorded
    found: dict[str, list[Any]] = {}
    with (folder / "bag_0.mcap").open("rb") as file:
        for message in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            found.setdefault(message.channel.topic, []).append(comparable(message.decoded_message))
    assert found == {topic: [comparable(row[3]) for row in rows] for topic, rows in content.items()}


@pytest.fixture(scope="session")
def foxglove(tmp_path_factory) -> Path:
    """A folder with Foxglove's JavaScript packages and the script that uses them."""
    for program in ("node", "npm"):
        if shutil.which(program) is None:
            pytest.skip(f"the JavaScript reader needs {program}, which is not installed")
    folder = tmp_path_factory.mktemp("foxglove")
    (folder / "package.json").write_text('{"private": true, "type": "module"}')
    shutil.copy(Path(__file__).with_name("read_with_foxglove.mjs"), folder)
    command = ["npm", "install", "--no-audit", "--no-fund", "--ignore-scripts", *NPM_PACKAGES]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=NPM_TIMEOUT_S, check=False)
    if done.returncode != 0 and any(code in done.stderr for code in ("ENOTFOUND", "EAI_AGAIN", "ECONNREFUSED")):
        pytest.skip("the JavaScript reader could not be downloaded: npm reaches no registry")
    assert done.returncode == 0, done.stderr
    return folder


def test_foxglove_reads_the_same_payloads_times_and_values(recorded, foxglove):
    folder, content = recorded
    done = subprocess.run(
        ["node", "read_with_foxglove.mjs", str(folder / "bag_0.mcap")],
        cwd=foxglove,
        capture_output=True,
        text=True,
        timeout=NODE_TIMEOUT_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert (found["profile"], found["metadata"], found["attachments"]) == ("ros2", ["rosbag2"] * 2, ["arm.urdf"])
    for topic, rows in content.items():
        digests = {
            "payload": b"".join(encode(row[3]) for row in rows),
            "times": "".join(f"{row[0]},{row[1]},{row[2]};" for row in rows).encode(),
            "values": "".join(",".join(printed(row[3])) + ";" for row in rows).encode(),
        }
        assert found["topics"][topic]["count"] == len(rows)
        for name, data in digests.items():
            assert found["topics"][topic][name] == hashlib.sha256(data).hexdigest(), (topic, name)


def printed(value: Any) -> list[str]:
    """Flatten a message in the way the script does: floats by their bits, integers and texts as they print."""
    if dataclasses.is_dataclass(value):
        fields = [field.name for field in dataclasses.fields(value) if field.name != "__msgtype__"]
        return [text for name in fields if not name.isupper() for text in printed(getattr(value, name))]
    if isinstance(value, list | np.ndarray):
        return [text for item in value for text in printed(item)]
    if isinstance(value, bool | np.bool_):
        return ["1" if value else "0"]
    if isinstance(value, float | np.floating):
        bits = struct.unpack(">Q", struct.pack(">d", value))[0]
        return [str(int(value)) if float(value).is_integer() else f"{bits:x}"]
    return [str(value)]
