"""Reading bags: order, filters, forms of files, and every kind of bad input with one clear line."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, IndexType, Writer

from slip_bags.format import QosProfile, TopicInfo
from slip_bags.reader import Bag
from slip_bags.storage import mcap_file
from slip_bags.typedefs import find_definition
from slip_bags.writer import BagWriter, StorageError, WriterOptions
from slip_core.errors import InputError
from test.support.bag_maker import PERIOD_NS, START_NS, SUITE_TOPICS, encode, make_bag

TWO = {"/a": "std_msgs/msg/String", "/b": "geometry_msgs/msg/WrenchStamped"}
STRING = find_definition("std_msgs/msg/String")


def write_strings(path: Path, times: list[int], fill: bytes = b"", **writer_options: object) -> None:
    """Write one topic with the mcap package alone, as other tools do."""
    with path.open("wb") as file:
        writer = Writer(file, **writer_options)
        writer.start(profile="ros2", library="test")
        schema = writer.register_schema(STRING.name, "ros2msg", STRING.text.encode())
        channel = writer.register_channel("/a", "cdr", schema, {})
        for index, time in enumerate(times):
            text = str(index).encode() + fill + b"\0"
            data = b"\0\1\0\0" + struct.pack("<I", len(text)) + text
            writer.add_message(channel, time, data, time, index)
        writer.finish()


def test_everything_comes_back_in_order(tmp_path):
    content = make_bag(tmp_path / "bag", count=100)
    expected = sorted(
        (row[0], row[1], row[2], topic, encode(row[3])) for topic, rows in content.items() for row in rows
    )
    with Bag(tmp_path / "bag") as bag:
        found = [(m.log_time_ns, m.publish_time_ns, m.sequence, m.topic, m.data) for m in bag.raw()]
        assert {name: info.type_name for name, info in bag.topics.items()} == SUITE_TOPICS
        assert bag.message_count == len(found)
        assert bag.span_ns == (found[0][0], found[-1][0])
    assert found == expected


def test_an_index_that_points_to_another_kind_of_record_is_damage(tmp_path):
    """The attachment would be read as the metadata's names and values."""
    path = tmp_path / "one.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="test")
        writer.add_attachment(1, 1, "a", "text/plain", struct.pack("<I", 0) * 20)
        writer.add_metadata("m", {"key": "value"})
        schema = writer.register_schema(STRING.name, "ros2msg", STRING.text.encode())
        writer.add_message(writer.register_channel("/a", "cdr", schema, {}), 1, b"\0\1\0\0\1\0\0\0\0", 1)
        writer.finish()
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    (attachment,), (metadata,) = summary.attachment_indexes, summary.metadata_indexes
    data = path.read_bytes()
    before, after = (struct.pack("<QQ", at, metadata.length) for at in (metadata.offset, attachment.offset))
    assert data.count(before) == 1
    path.write_bytes(data.replace(before, after)[:-12] + bytes(4) + data[-8:])  # and no CRC of the summary
    file = mcap_file.McapFile(path)
    with pytest.raises(InputError, match="an index that points to something else"):
        file.metadata()
    file.close()


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
def test_filters_and_times(tmp_path, compression):
    make_bag(tmp_path / "bag", count=100, topics=TWO, options=WriterOptions(compression))
    first, last = START_NS + 10 * PERIOD_NS, START_NS + 20 * PERIOD_NS
    with Bag(tmp_path / "bag") as bag:
        assert bag.compressions == ["" if compression == "none" else compression]
        found = list(bag.raw(["a"], start_ns=first, end_ns=last))
        assert {message.topic for message in found} == {"/a"}
        assert [message.log_time_ns for message in found] == list(range(first, last + 1, PERIOD_NS))
        assert [message.log_time_ns for message in bag.raw(["a"], start_ns=last, end_ns=last)] == [last]
        assert list(bag.raw(["a"], start_ns=last + 1, end_ns=last + 2)) == []


def test_splits_are_one_bag(tmp_path):
    content = make_bag(tmp_path / "bag", count=100, topics=TWO, options=WriterOptions(split_duration_ns=25 * PERIOD_NS))
    with Bag(tmp_path / "bag") as bag:
        assert [file.path for file in bag.metadata.files] == [f"bag_{index}.mcap" for index in range(4)]
        assert [message.sequence for message in bag.raw(["/b"])] == [row[2] for row in content["/b"]]
        assert bag.topics["/a"].message_count == 100
    for index in range(4):
        with Bag(tmp_path / "bag" / f"bag_{index}.mcap") as part:
            assert set(part.topics) == set(TWO)


@pytest.mark.parametrize(
    "options",
    [
        {"use_chunking": False},
        {"index_types": IndexType.NONE},
        {"use_statistics": False},
        {"repeat_channels": False, "repeat_schemas": False},
        {"compression": CompressionType.LZ4, "chunk_size": 100},
    ],
    ids=["unchunked", "no index", "no statistics", "no repetition", "small chunks"],
)
def test_files_of_other_writers(tmp_path, options):
    """Out of order and without what makes reading fast; the order of the result is the same."""
    times = [START_NS + ((7 * index) % 50) for index in range(50)]
    write_strings(tmp_path / "x.mcap", times, **options)
    with Bag(tmp_path / "x.mcap") as bag:
        assert [message.log_time_ns for message in bag.raw()] == sorted(times)
        some = bag.raw(["a"], start_ns=START_NS + 10, end_ns=START_NS + 20)
        assert [message.log_time_ns for message in some] == list(range(START_NS + 10, START_NS + 21))
        assert bag.message_count == 50
        assert bag.span_ns == (min(times), max(times))


@pytest.mark.parametrize("index", [IndexType.ALL, IndexType.NONE], ids=["index", "no index"])
def test_what_is_much_larger_than_its_file_is_refused(tmp_path, monkeypatch, index):
    monkeypatch.setattr(mcap_file, "MAX_UNPACKED", 0)
    write_strings(tmp_path / "usual", [START_NS] * 50, index_types=index)
    with Bag(tmp_path / "usual") as bag:
        assert bag.message_count == 50
    write_strings(tmp_path / "much", [START_NS], fill=b"x" * 1_000_000, index_types=index)
    with pytest.raises(InputError, match="in a file of"):
        Bag(tmp_path / "much")


@pytest.mark.parametrize("index", [IndexType.ALL, IndexType.NONE], ids=["index", "no index"])
def test_what_may_be_unpacked_is_limited_to_the_byte(tmp_path, monkeypatch, index):
    write_strings(tmp_path / "x", [START_NS] * 50, index_types=index, chunk_size=100)
    with (tmp_path / "x").open("rb") as file:
        records = list(StreamReader(file, emit_chunks=True).records)
    unpacked = sum(record.uncompressed_size for record in records if isinstance(record, Chunk))
    assert sum(isinstance(record, Chunk) for record in records) > 1
    monkeypatch.setattr(mcap_file, "MAX_RATIO", 0)
    monkeypatch.setattr(mcap_file, "MAX_UNPACKED", unpacked)
    with Bag(tmp_path / "x") as bag:
        assert bag.message_count == 50
    monkeypatch.setattr(mcap_file, "MAX_UNPACKED", unpacked - 1)
    with pytest.raises(InputError, match=f"{unpacked} bytes"):
        Bag(tmp_path / "x")


@pytest.mark.parametrize("index", [IndexType.ALL, IndexType.NONE], ids=["index", "no index"])
def test_times_that_no_whole_number_of_numpy_holds_are_refused_when_a_file_is_opened(tmp_path, index):
    for time in (2**63 - 1, 2**63):
        write_strings(tmp_path / str(time), [START_NS, time], index_types=index)
    with Bag(tmp_path / str(2**63 - 1)) as bag:
        assert bag.span_ns == (START_NS, 2**63 - 1)
    with pytest.raises(InputError, match="beyond the year 2262"):
        Bag(tmp_path / str(2**63))


def test_two_channels_of_one_topic_are_one_topic(tmp_path):
    with (tmp_path / "x.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="test")
        schema = writer.register_schema(STRING.name, "ros2msg", STRING.text.encode())
        for _ in range(2):
            channel = writer.register_channel("/a", "cdr", schema, {"offered_qos_profiles": "rubbish: ["})
            writer.add_message(channel, 5, b"\0\1\0\0\1\0\0\0\0", 5)
        writer.finish()
    with Bag(tmp_path / "x.mcap") as bag:
        assert bag.topics["/a"].message_count == 2
        assert len(list(bag.raw())) == 2


def test_custom_data_and_attachments_with_and_without_folder(tmp_path):
    options = WriterOptions(custom_data={"k": "v: 1"}, attachments={"arm.urdf": b"<robot/>", "a.yaml": b"\xff"})
    make_bag(tmp_path / "bag", count=3, topics=TWO, options=options)
    for path in (tmp_path / "bag", tmp_path / "bag" / "bag_0.mcap"):
        with Bag(path) as bag:
            assert dict(bag.custom_data) == {"k": "v: 1"}
            assert dict(bag.attachments) == {"arm.urdf": b"<robot/>", "a.yaml": b"\xff"}
    with (tmp_path / "bag" / "bag_0.mcap").open("rb") as file:
        reader = make_reader(file)
        listed = reader.get_summary().attachment_indexes
        times = {(each.log_time, each.create_time) for each in (*listed, *reader.iter_attachments())}
    assert times == {(0, 0)}  # the same bag gives the same bytes


def test_unknown_topic_offers_the_nearest(tmp_path):
    make_bag(tmp_path / "bag", count=1, topics=TWO | {"/joint_states": "std_msgs/msg/String"})
    with Bag(tmp_path / "bag") as bag, pytest.raises(InputError, match="did you mean /joint_states"):
        bag.series("joint_state")


def damage_folder(folder: Path, kind: str) -> None:
    """Make one kind of bad bag out of a good one."""
    mcap, metadata = folder / "bag_0.mcap", folder / "metadata.yaml"
    data = mcap.read_bytes()
    text = metadata.read_text()
    if kind == "no folder":
        for path in (mcap, metadata):
            path.unlink()
        folder.rmdir()
    elif kind == "empty folder":
        mcap.unlink()
        metadata.unlink()
    elif kind == "no metadata":
        metadata.unlink()
    elif kind == "no file":
        mcap.unlink()
    elif kind == "empty file":
        mcap.write_bytes(b"")
    elif kind == "foreign file":
        mcap.write_bytes(b"SQLite format 3\0" * 1000)
    elif kind == "cut":
        mcap.write_bytes(data[:-100])
    elif kind == "only magic":
        mcap.write_bytes(data[:8] + data[-8:])
    elif kind == "footer to nowhere":
        mcap.write_bytes(data[:-28] + struct.pack("<QQI", 2**62, 2**62, 0) + data[-8:])
    elif kind == "sqlite":
        metadata.write_text(text.replace("storage_identifier: mcap", "storage_identifier: sqlite3"))
    elif kind == "file compression":
        changed = text.replace("compression_format: ''", "compression_format: zstd")
        metadata.write_text(changed.replace("compression_mode: ''", "compression_mode: FILE"))
    elif kind == "metadata not YAML":
        metadata.write_text("a: [")
    elif kind == "metadata of something else":
        metadata.write_text("name: test\n")
    elif kind == "metadata is binary":
        metadata.write_bytes(bytes(range(256)))
    elif kind == "metadata huge":
        metadata.write_text("a: &a [x, x]\nb: &b [*a, *a]\nc: [*b, *b]\n")


BAD_AT_OPEN = {
    "no folder": "No such file",
    "empty folder": "without metadata.yaml",
    "no metadata": "bag recover",
    "no file": "is missing",
    "empty file": "an empty file",
    "foreign file": "expected an MCAP file",
    "cut": "no end",
    "only magic": "no end",
    "footer to nowhere": "damaged",
    "sqlite": "ros2 bag convert",
    "file compression": "inside MCAP",
    "metadata not YAML": "expected YAML",
    "metadata of something else": "rosbag2_bagfile_information",
    "metadata is binary": r"metadata\.yaml",
    "metadata huge": "rosbag2_bagfile_information",
}


@pytest.mark.parametrize("kind", BAD_AT_OPEN)
def test_bad_bags_end_in_one_line(tmp_path, kind):
    make_bag(tmp_path / "bag", count=20, topics=TWO)
    damage_folder(tmp_path / "bag", kind)
    with pytest.raises(InputError, match=BAD_AT_OPEN[kind]) as caught:
        Bag(tmp_path / "bag")
    assert "\n" not in str(caught.value)
    assert caught.value.exit_code == 2


def test_flipped_bit_in_a_chunk_is_found_by_its_crc(tmp_path):
    make_bag(tmp_path / "bag", count=300, topics=TWO, options=WriterOptions("none"), flush_every=100)
    path = tmp_path / "bag" / "bag_0.mcap"
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    with Bag(path) as bag, pytest.raises(InputError, match="CRC"):
        list(bag.raw())


def test_unknown_compression_is_named(tmp_path):
    make_bag(tmp_path / "bag", count=20, topics=TWO, options=WriterOptions("lz4"))
    path = tmp_path / "bag" / "bag_0.mcap"
    path.write_bytes(path.read_bytes().replace(b"\x03\0\0\0lz4", b"\x03\0\0\0xyz"))
    with Bag(path) as bag, pytest.raises(InputError, match="unknown compression 'xyz'"):
        list(bag.raw())


def test_chunk_that_claims_to_be_huge(tmp_path):
    write_strings(tmp_path / "x.mcap", [START_NS], compression=CompressionType.ZSTD)
    data = (tmp_path / "x.mcap").read_bytes()
    at = data.index(b"\x04\0\0\0zstd") - 12
    (tmp_path / "x.mcap").write_bytes(data[:at] + struct.pack("<Q", 2**40) + data[at + 8 :])
    with Bag(tmp_path / "x.mcap") as bag, pytest.raises(InputError, match="more than"):
        list(bag.raw())


def test_wrong_schema_and_other_encodings(tmp_path):
    with (tmp_path / "x.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="test")
        wrong = writer.register_schema("std_msgs/msg/String", "ros2msg", b"float64[] data\n")
        empty = writer.register_schema("a/msg/B", "ros2msg", b"")
        channels = {
            "/wrong": writer.register_channel("/wrong", "cdr", wrong, {}),
            "/empty": writer.register_channel("/empty", "cdr", empty, {}),
            "/json": writer.register_channel("/json", "json", 0, {}),
        }
        for channel in channels.values():
            writer.add_message(channel, 5, b"\0\1\0\0\6\0\0\0hello\0", 5)
        writer.finish()
    with Bag(tmp_path / "x.mcap") as bag:
        assert len(list(bag.raw())) == 3
        for topic, message in (("/wrong", "message"), ("/empty", "schema"), ("/json", "no schema")):
            with pytest.raises(InputError, match=message):
                bag.series(topic)
            with pytest.raises(InputError):
                list(bag.messages(topic))


def test_existing_output_is_refused_and_left_alone(tmp_path):
    make_bag(tmp_path / "bag", count=3, topics=TWO)
    before = {path: path.read_bytes() for path in (tmp_path / "bag").iterdir()}
    with pytest.raises(InputError, match="it exists"):
        BagWriter(tmp_path / "bag", WriterOptions())
    assert {path: path.read_bytes() for path in (tmp_path / "bag").iterdir()} == before


def test_output_below_a_file_is_refused(tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match="a folder that can be made"):
        BagWriter(tmp_path / "file" / "bag", WriterOptions())


def test_unknown_compression_is_refused_before_anything_is_made(tmp_path):
    with pytest.raises(InputError, match="zstd, lz4, none"):
        BagWriter(tmp_path / "bag", WriterOptions("bzip2"))
    assert list(tmp_path.iterdir()) == []


def test_closed_writer_refuses(tmp_path):
    writer = BagWriter(tmp_path / "bag", WriterOptions())
    writer.add_topic(TopicInfo("/a", STRING.name, (QosProfile(),), STRING.type_hash), STRING.text)
    assert writer.close() == writer.close()
    with pytest.raises(StorageError, match="closed"):
        writer.write("/a", 1, 1, 1, b"")


def test_messages_count_before_their_chunk_is_written(tmp_path):
    writer = BagWriter(tmp_path / "bag", WriterOptions())
    writer.add_topic(TopicInfo("/a", STRING.name, (QosProfile(),), STRING.type_hash), STRING.text)
    for k in range(5):
        writer.write("/a", k, k, k, b"\0\1\0\0\1\0\0\0\0")
    assert (writer.message_count, writer.metadata().message_count) == (5, 5)
    writer.flush()
    assert writer.close().message_count == 5


def test_huge_message(tmp_path):
    """One message far larger than a chunk."""
    writer = BagWriter(tmp_path / "bag", WriterOptions())
    writer.add_topic(TopicInfo("/a", STRING.name, (QosProfile(),), STRING.type_hash), STRING.text)
    size = 8 << 20
    data = b"\0\1\0\0" + struct.pack("<I", size + 1) + b"x" * size + b"\0"
    writer.write("/a", 1, 1, 1, data)
    writer.close()
    with Bag(tmp_path / "bag") as bag:
        assert next(bag.raw()).data == data
        assert len(bag.series("/a")["data"][0]) == size


def test_a_file_that_is_large_enough_is_followed_by_the_next(tmp_path):
    size = 1 << 20  # more than a chunk, so that each is written at once
    writer = BagWriter(tmp_path / "bag", WriterOptions(compression="none", split_bytes=3 * size))
    writer.add_topic(TopicInfo("/a", STRING.name, (QosProfile(),), STRING.type_hash), STRING.text)
    for k in range(10):
        writer.write("/a", k, k, k, b"\0\1\0\0" + struct.pack("<I", size + 1) + b"x" * size + b"\0")
    assert [file.message_count for file in writer.close().files] == [3, 3, 3, 1]


def test_two_readers_of_one_bag_do_not_disturb_each_other(tmp_path):
    make_bag(tmp_path / "bag", count=30, topics=TWO)
    with Bag(tmp_path / "bag") as bag:
        pairs = list(zip(bag.raw(["/a"]), bag.raw(["/a"]), strict=True))
    assert len(pairs) == 30
    assert all(one == other for one, other in pairs)
