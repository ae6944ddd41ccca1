"""Reading bags: order, filters, forms of files, and every kind of bad input with one clear line."""

from __future__ import annotations

import contextlib
import struct
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer

from slip_bags import reader
from slip_bags.format import TopicInfo
from slip_bags.reader import Bag
from slip_bags.recorder import find_definition
from slip_bags.recover import recover
from slip_bags.writer import BagWriter, StorageError
from slip_core.errors import InputError
from slip_core.files.plain_yaml import read_yaml
from test.support.bag_maker import START_NS, SUITE_TOPICS, encode, make_bag, random_message

TWO = {"/a": "std_msgs/msg/String", "/b": "geometry_msgs/msg/WrenchStamped"}
STRING = "std_msgs/msg/String"
TEXT = find_definition(STRING)


def write_strings(path: Path, times: list[int], fill: bytes = b"", **writer_options: object) -> None:
    """Write one topic with the mcap package alone, as other tools do."""
    with path.open("wb") as file:
        writer = Writer(file, **writer_options)
        writer.start(profile="ros2", library="test")
        schema = writer.register_schema(STRING, "ros2msg", TEXT.encode())
        channel = writer.register_channel("/a", "cdr", schema, {})
        for index, time in enumerate(times):
            text = str(index).encode() + fill + b"\0"
            data = b"\0\1\0\0" + struct.pack("<I", len(text)) + text
            writer.add_message(channel, time, data, index, index)
        writer.finish()


def test_everything_comes_back_in_order(tmp_path):
    content = make_bag(tmp_path / "bag", count=100)
    expected = sorted(
        (row[0], row[1], row[2], topic, encode(row[3])) for topic, rows in content.items() for row in rows
    )
    bag = Bag(tmp_path / "bag")
    found = [(m.log_time_ns, m.publish_time_ns, m.sequence, m.topic, m.value) for m in bag.raw()]
    assert {name: info.type_name for name, info in bag.topics.items()} == SUITE_TOPICS
    assert bag.message_count == len(found)
    assert bag.span_ns == (found[0][0], found[-1][0])
    assert found == expected


@pytest.mark.parametrize("compression", ["zstd", "lz4", ""])
def test_times_and_compressions(tmp_path, compression):
    """Out of order in the file, and in overlapping chunks, as other writers leave them."""
    times = [START_NS + ((7 * index) % 50) for index in range(50)]
    write_strings(
        tmp_path / "x.mcap", times, compression=CompressionType[compression.upper() or "NONE"], chunk_size=100
    )
    bag = Bag(tmp_path / "x.mcap")
    assert [message.log_time_ns for message in bag.raw()] == times
    assert bag.series("/a").log_time_ns.tolist() == sorted(times)
    assert (bag.message_count, bag.span_ns) == (50, (min(times), max(times)))


def test_a_folder_with_no_or_several_files_is_no_bag(tmp_path):
    """The first is one that is compressed as a whole."""
    (tmp_path / "packed").mkdir()
    (tmp_path / "packed" / "x_0.mcap.zstd").touch()
    make_bag(tmp_path / "bag", count=3, topics=TWO)
    write_strings(tmp_path / "bag" / "bag_1.mcap", [START_NS + 5])
    for action in (Bag, lambda path: recover(path, tmp_path / "out")):
        for name, count in (("packed", 0), ("bag", 2)):
            with pytest.raises(InputError, match=rf"got {count} MCAP files, .*ros2 bag convert"):
                action(tmp_path / name)
    with pytest.raises(InputError, match="No such file"):
        Bag(tmp_path / "none")
    assert Bag(tmp_path / "bag" / "bag_1.mcap").message_count == 1


@pytest.mark.parametrize(
    ("options", "is_read"),
    [({"use_chunking": False}, True), ({"index_types": IndexType.NONE}, True), ({"use_statistics": False}, False)],
    ids=["unchunked", "no index", "no statistics"],
)
def test_file_without_summary_names_recover(tmp_path, options, is_read):
    write_strings(tmp_path / "x.mcap", [START_NS, START_NS + 1], **options)
    if is_read:
        bag = Bag(tmp_path / "x.mcap")
        assert len(list(bag.raw())) == 2
    else:
        with pytest.raises(InputError, match=r"no index.*bag recover"):
            Bag(tmp_path / "x.mcap")
    recover(tmp_path / "x.mcap", tmp_path / "out")
    bag = Bag(tmp_path / "out")
    assert bag.message_count == 2


def test_names_of_messages_are_kept_once_and_channels_are_counted(tmp_path, monkeypatch):
    message = random_message("sensor_msgs/msg/JointState", np.random.default_rng(1), 2)
    with contextlib.closing(BagWriter(tmp_path / "bag")) as writer:
        writer.add_topic(TopicInfo("/a", "sensor_msgs/msg/JointState"), find_definition("sensor_msgs/msg/JointState"))
        for number in range(2):
            writer.write("/a", number, number, number, encode(message))
    series = Bag(tmp_path / "bag").series("/a")
    assert series["name"][0] is series["name"][1]
    assert set(series.dataframe()["velocity[1]"]) == {message.velocity[1]}
    monkeypatch.setattr(reader, "MOST_CHANNELS", 0)
    with pytest.raises(InputError, match="over 0 channels"):
        Bag(tmp_path / "bag")


def test_times_beyond_int64_are_refused(tmp_path):
    for time in (2**63 - 1, 2**63):
        write_strings(tmp_path / str(time), [START_NS, time])
    bag = Bag(tmp_path / str(2**63 - 1))
    assert bag.span_ns == (START_NS, 2**63 - 1)
    with pytest.raises(InputError, match="beyond the year 2262"):
        Bag(tmp_path / str(2**63))
    assert recover(tmp_path / str(2**63), tmp_path / "out") == "1 messages on 1 topics, not readable: a message"


def test_two_channels_of_one_topic_are_one_topic(tmp_path):
    with (tmp_path / "x.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="test")
        schema = writer.register_schema(STRING, "ros2msg", TEXT.encode())
        for _ in range(2):
            channel = writer.register_channel("/a", "cdr", schema, {"offered_qos_profiles": "rubbish: ["})
            writer.add_message(channel, 5, b"\0\1\0\0\1\0\0\0\0", 5)
        writer.finish()
    bag = Bag(tmp_path / "x.mcap")
    assert bag.topics["/a"].message_count == 2
    assert len(list(bag.raw())) == 2
    bag = Bag(tmp_path / "x.mcap")
    bag._channels.popitem()
    with pytest.raises(InputError, match="of no channel"):
        list(bag.raw())


def test_custom_data_and_attachments_with_and_without_folder(tmp_path):
    attached = {"arm.urdf": b"<robot/>", "a.yaml": b"\xff"}
    make_bag(tmp_path / "bag", count=3, topics=TWO, custom_data={"k": "v: 1"}, attachments=attached)
    for path in (tmp_path / "bag", tmp_path / "bag" / "bag_0.mcap"):
        bag = Bag(path)
        assert dict(bag.custom_data) == {"k": "v: 1"}
        assert dict(bag.attachments) == {"arm.urdf": b"<robot/>", "a.yaml": b"\xff"}
    with (tmp_path / "bag" / "bag_0.mcap").open("rb") as file:
        times = [(found.log_time, found.create_time) for found in make_reader(file).iter_attachments()]
    assert times == [(0, 0)] * 2, "equal runs give equal bags"


def test_unknown_topic_offers_the_nearest(tmp_path):
    make_bag(tmp_path / "bag", count=1, topics=TWO | {"/joint_states": "std_msgs/msg/String"})
    with pytest.raises(InputError, match="did you mean /joint_states"):
        Bag(tmp_path / "bag").series("joint_state")
    assert Bag(tmp_path / "bag").series("a")["data"].shape == (1,)


@pytest.mark.parametrize(
    ("content", "line"),
    [
        (lambda data: b"", "got an empty file"),
        (lambda data: b"SQLite format 3\0" * 1000, "no whole MCAP file|damage"),
        (lambda data: data[:-100], "killed or the file is cut"),
        (lambda data: data[:8] + data[-8:], "killed or the file is cut"),
        (lambda data: data[:-28] + struct.pack("<QQI", 2**62, 2**62, 0) + data[-8:], "killed or the file is cut"),
    ],
    ids=["empty", "foreign", "cut", "only magic", "footer to nowhere"],
)
def test_bad_files_end_in_one_line(tmp_path, content, line):
    make_bag(tmp_path / "bag", count=20, topics=TWO)
    mcap = tmp_path / "bag" / "bag_0.mcap"
    mcap.write_bytes(content(mcap.read_bytes()))
    with pytest.raises(InputError, match=line) as caught:
        Bag(tmp_path / "bag")
    assert "\n" not in str(caught.value)
    assert caught.value.exit_code == 2


def test_other_encodings_are_not_decoded(tmp_path):
    with (tmp_path / "x.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="test")
        writer.add_message(writer.register_channel("/json", "json", 0, {}), 5, b"{}", 5)
        writer.finish()
    bag = Bag(tmp_path / "x.mcap")
    assert len(list(bag.raw())) == 1
    with pytest.raises(InputError, match="no schema"):
        list(bag.messages("/json"))
    with pytest.raises(InputError, match="no message that can be read"):
        recover(tmp_path / "x.mcap", tmp_path / "out")


def test_existing_output_is_refused_and_left_alone(tmp_path):
    make_bag(tmp_path / "bag", count=3, topics=TWO)
    before = {path: path.read_bytes() for path in (tmp_path / "bag").iterdir()}
    with pytest.raises(InputError, match="File exists"):
        BagWriter(tmp_path / "bag")
    assert {path: path.read_bytes() for path in (tmp_path / "bag").iterdir()} == before
    with pytest.raises(InputError, match="a new folder that can be made"):
        BagWriter(tmp_path / "bag" / "metadata.yaml" / "below a file")


def test_closed_writer_refuses(tmp_path):
    writer = BagWriter(tmp_path / "new" / "bag")
    writer.add_topic(TopicInfo("/a", STRING), TEXT)
    for time in (5, 3, 9):
        writer.write("/a", time, time, 1, b"")
    writer.close()
    writer.close()
    metadata = read_yaml((writer.folder / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert metadata["starting_time"] == {"nanoseconds_since_epoch": 3}
    assert metadata["duration"] == {"nanoseconds": 6}
    with pytest.raises(StorageError, match="closed"):
        writer.write("/a", 1, 1, 1, b"")


def test_two_readers_of_one_bag_do_not_disturb_each_other(tmp_path):
    make_bag(tmp_path / "bag", count=30, topics=TWO)
    bag = Bag(tmp_path / "bag")
    pairs = list(zip(bag.raw(["/a"]), bag.raw(["/a"]), strict=True))
    assert len(pairs) == 30
    assert all(one == other for one, other in pairs)
    again = Bag(tmp_path / "bag")
    assert len(list(again.raw())) == 60
    assert ("_all" in vars(bag), "_all" in vars(again)) == (True, False), "one topic alone is kept"
