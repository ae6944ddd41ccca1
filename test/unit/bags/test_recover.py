"""Recovery: cut and damaged files, and full disks."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import io
import os
import random
import shutil
import struct
import tempfile
import threading
import zlib
from pathlib import Path
from typing import IO

import lz4.frame
import pytest
import yaml
import zstandard
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from rosbags.highlevel import AnyReader

from slip_bags.format import TopicInfo
from slip_bags.reader import Bag, RawMessage
from slip_bags.recover import recover
from slip_bags.storage.closing import close_in_place
from slip_bags.storage.salvage import Salvage, salvage
from slip_bags.storage.scan import partial_chunk
from slip_bags.writer import BagWriter, StorageError, WriterOptions, _Syncer
from slip_core.errors import InputError
from test.support.bag_maker import make_bag
from test.support.every import every

TOPICS = {"/a": "sensor_msgs/msg/JointState", "/b": "geometry_msgs/msg/WrenchStamped"}
COUNT, FLUSH = 400, 40
BLOCKS = 3 * 4096  # of metadata.yaml, its temporary copy and the folder
DATA = b"\0\1\0\0" + struct.pack("<I", 4001) + 4000 * b"a" + b"\0"  # of a std_msgs/String
CUTS = 10
DAMAGES = 8


def digest(path: Path) -> dict[str, tuple[str, int]]:
    """Content and modification time of every file of a bag."""
    return {
        file.name: (hashlib.sha256(file.read_bytes()).hexdigest(), file.stat().st_mtime_ns) for file in path.iterdir()
    }


def messages(path: Path) -> list[RawMessage]:
    with Bag(path) as bag:
        return list(bag.raw())


@pytest.fixture(scope="module", params=["zstd", "lz4", "none"])
def original(request, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("bag") / request.param
    options = WriterOptions(request.param, custom_data={"seed": "7"}, attachments={"arm.urdf": b"<robot/>"})
    make_bag(folder, count=COUNT, topics=TOPICS, options=options, flush_every=FLUSH)
    return folder


def test_killed_recorder_loses_nothing_that_was_flushed(original, tmp_path):
    """Without its last 100 bytes and metadata.yaml a bag is what kill -9 leaves behind."""
    killed = tmp_path / "killed"
    killed.mkdir()
    (killed / "killed_0.mcap").write_bytes((original / f"{original.name}_0.mcap").read_bytes()[:-100])
    before = digest(killed)
    report = recover(killed, tmp_path / "whole")
    assert messages(tmp_path / "whole") == messages(original)
    assert digest(killed) == before
    with Bag(tmp_path / "whole") as bag:
        assert bag.custom_data["seed"] == "7"
        assert bag.custom_data["recovered"] == "true"
        assert dict(bag.attachments) == {"arm.urdf": b"<robot/>"}
        assert {topic.qos for topic in bag.topics.values()} == {topic.qos for topic in Bag(original).topics.values()}
    assert report.bytes_skipped < 100
    assert (report.chunks_dropped, report.messages_dropped) == (0, 0)
    with AnyReader([tmp_path / "whole"]) as reader:
        assert reader.message_count == COUNT * len(TOPICS)


@every("seed", range(CUTS))
def test_cut_anywhere(original, tmp_path, seed):
    """What is saved is exactly the beginning; what is lost is less than one flush."""
    tmp_path = made(tmp_path / str(seed))
    data = (original / f"{original.name}_0.mcap").read_bytes()
    end = random.Random(seed).randrange(len(data))
    (tmp_path / "cut.mcap").write_bytes(data[:end])
    whole = messages(original)
    flushed = complete_chunks(data, end) * FLUSH * len(TOPICS)
    if flushed == 0 and not savable(data[:end]):
        with pytest.raises(InputError, match=r"no message that can be read|expected an MCAP file|an empty file"):
            recover(tmp_path / "cut.mcap", tmp_path / "out")
        assert not (tmp_path / "out").exists()
        return
    recover(tmp_path / "cut.mcap", tmp_path / "out")
    saved = messages(tmp_path / "out")
    assert saved == whole[: len(saved)]
    assert len(saved) >= flushed


def made(folder: Path) -> Path:
    folder.mkdir()
    return folder


def savable(data: bytes) -> bool:
    """Whether the readable beginning of the cut first chunk has a message."""
    found = Salvage()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.mcap"
        path.write_bytes(data or b"x")
        with contextlib.suppress(InputError):
            return next(salvage(path, found), None) is not None
    return False


def complete_chunks(data: bytes, end: int) -> int:
    """How many chunk records end before `end`, counted by hand."""
    position, chunks = 8, 0
    while position + 9 <= end:
        opcode, length = struct.unpack_from("<BQ", data, position)
        position += 9 + length
        chunks += opcode == 6 and position <= end
    return chunks


@every("seed", range(DAMAGES))
def test_damage_anywhere(original, tmp_path, seed):
    """Every message that is saved is one of the original's, in order; a compressed file loses at most two chunks."""
    tmp_path = made(tmp_path / str(seed))
    rng = random.Random(seed)
    data = bytearray((original / f"{original.name}_0.mcap").read_bytes())
    start = rng.randrange(len(data) - 200)
    data[start : start + 64] = rng.randbytes(64)
    (tmp_path / "damaged.mcap").write_bytes(data)
    whole = messages(original)
    recover(tmp_path / "damaged.mcap", tmp_path / "out")
    saved = messages(tmp_path / "out")
    assert set(saved) <= set(whole)
    assert saved == sorted(saved, key=lambda message: message.log_time_ns)
    if original.name != "none":  # without compression there is nothing to find the next chunk by
        assert len(whole) - len(saved) <= 2 * FLUSH * len(TOPICS)


@every("compression", ["zstd", "lz4"])
def test_a_chunk_whose_head_is_damaged_costs_its_own_messages_only(tmp_path, compression):
    tmp_path = made(tmp_path / compression)
    original, bad = tmp_path / "original", tmp_path / "bad.mcap"
    make_bag(original, count=COUNT, topics=TOPICS, options=WriterOptions(compression), flush_every=FLUSH)
    good = original / "original_0.mcap"
    with good.open("rb") as file:
        chunks = make_reader(file).get_summary().chunk_indexes
    damaged, head = chunks[len(chunks) // 2], struct.calcsize("<BQ")
    data = bytearray(good.read_bytes())
    at = damaged.chunk_start_offset
    data[at : at + head] = b"\xff" * head
    bad.write_bytes(data)
    report = recover(bad, tmp_path / "out", "zstd")
    first, last = damaged.message_start_time, damaged.message_end_time
    assert messages(tmp_path / "out") == [row for row in messages(original) if not first <= row.log_time_ns <= last]
    assert report.bytes_skipped >= head


def test_split_bags_keep_their_files(tmp_path):
    make_bag(tmp_path / "bag", count=90, topics=TOPICS, options=WriterOptions(split_duration_ns=29_500_000))
    (tmp_path / "bag" / "metadata.yaml").unlink()
    recover(tmp_path / "bag", tmp_path / "out")
    with Bag(tmp_path / "out") as bag:
        assert [file.message_count for file in bag.metadata.files] == [60, 60, 60]


@pytest.mark.parametrize(
    ("content", "line"),
    [(b"", "an empty file"), (b"PK\x03\x04" * 100, "expected an MCAP file"), (None, "nothing there")],
    ids=["empty", "foreign", "absent"],
)
def test_nothing_to_recover(tmp_path, content, line):
    if content is not None:
        (tmp_path / "x.mcap").write_bytes(content)
    with pytest.raises(InputError, match=line):
        recover(tmp_path / "x.mcap", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_recovery_refuses_an_existing_output(original, tmp_path):
    (tmp_path / "out").mkdir()
    with pytest.raises(InputError, match="it exists"):
        recover(original, tmp_path / "out")


def test_a_file_that_cannot_grow_ends_where_its_last_chunks_were_and_keeps_the_others(tmp_path):
    path = tmp_path / "x.mcap"
    with path.open("xb") as file:
        writer = string_writer(file)
        for k in range(40):
            writer.add_message(1, k, bytes(100), k, k)
            writer.flush()
    size = path.stat().st_size
    contents = close_in_place(path, spare_bytes=500)
    assert path.stat().st_size <= size - 500
    kept = contents.counts["/a"]
    assert 0 < kept < 40
    assert contents.end_ns == kept - 1
    with path.open("rb") as file:
        assert make_reader(file).get_summary().statistics.message_count == kept
    with Bag(path) as bag:
        assert [message.log_time_ns for message in bag.raw()] == list(range(kept))


def test_a_disk_that_refuses_leaves_a_bag_with_its_metadata(tmp_path, monkeypatch):
    writer = BagWriter(tmp_path / "bag", WriterOptions("none"))
    writer.add_topic(TopicInfo("/a", "std_msgs/msg/String", (), "h"), "string data")
    for k in range(100):
        writer.write("/a", k, k, k, DATA)
        writer.flush()
    file = tmp_path / "bag" / "bag_0.mcap"
    before = file.stat().st_size
    monkeypatch.setattr(Writer, "add_message", refuse)
    with pytest.raises(StorageError, match="No space left on device") as caught:
        writer.write("/a", 100, 100, 100, DATA)
    kept = messages(tmp_path / "bag")
    assert f"closed with the {len(kept)} messages before, readable" in str(caught.value)
    assert [row.log_time_ns for row in kept] == list(range(len(kept)))
    assert 0 < len(kept) < 100  # the end of the file needs room
    assert file.stat().st_size + (tmp_path / "bag" / "metadata.yaml").stat().st_size + BLOCKS <= before


def string_writer(file: IO[bytes]) -> Writer:
    """Return a writer without compression whose channel 1 is /a."""
    writer = Writer(file, compression=CompressionType.NONE)
    writer.start("ros2", "test")
    writer.register_channel("/a", "cdr", writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data"))
    return writer


@pytest.mark.parametrize("lost", [1, 10, 40, 400])
def test_a_chunk_whose_end_is_missing_is_not_kept(tmp_path, lost):
    """Neither half a chunk nor a chunk without its index: statistics and messages agree."""
    path = tmp_path / "x.mcap"
    with path.open("xb") as file:
        writer = string_writer(file)
        second = writer.register_channel("/b", "cdr", 1)
        for k in range(20):
            writer.add_message((1, second)[k % 2], k, bytes(100), k, k)
            if k % 2:
                writer.flush()
    path.write_bytes(path.read_bytes()[:-lost])
    contents = close_in_place(path, spare_bytes=0)
    with path.open("rb") as file:
        kept = list(make_reader(file, validate_crcs=True).iter_messages())
    assert 0 < len(kept) == contents.counts.total() < 20
    assert [message.log_time for _, _, message in kept] == list(range(len(kept)))


def refuse(*_: object) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_flushed_bag_is_on_the_disk(tmp_path, monkeypatch):
    """What the file system has is not what the disk has: each flush asks for that too, on a thread of its own."""
    synced = threading.Event()
    honest = os.fsync
    monkeypatch.setattr(os, "fsync", lambda number: (honest(number), synced.set()))
    with io.FileIO(tmp_path / "x", "xb+") as file:
        syncer = _Syncer(file)
        syncer.request()
        assert synced.wait(30.0)
        syncer.stop()


def test_a_bag_that_cannot_be_read_holds_no_file_open(original, tmp_path):
    folder = tmp_path / "bag"
    shutil.copytree(original, folder)
    tree = yaml.safe_load((folder / "metadata.yaml").read_text())
    files = tree["rosbag2_bagfile_information"]["files"]
    files.append({**files[0], "path": "bad.mcap"})
    (folder / "bad.mcap").write_bytes(b"")
    (folder / "metadata.yaml").write_text(yaml.safe_dump(tree))
    with pytest.raises(InputError) as caught:
        Bag(folder)
    opened = {str(link.readlink()) for link in Path("/proc/self/fd").iterdir() if link.is_symlink()}
    assert not any(name.startswith(str(folder)) for name in opened), caught


def test_what_is_outside_of_the_wanted_time_is_not_read(tmp_path):
    """Of a long bag the damaged part costs itself only."""
    path = tmp_path / "x.mcap"
    with path.open("xb") as file:
        writer = string_writer(file)
        for k in range(6):
            writer.add_message(1, k, bytes([0xA0 + k] * 100), k, k)
            if k % 2:
                writer.flush()
        writer.finish()
    data = path.read_bytes()
    for k in (0, 4):
        path.write_bytes(data.replace(bytes([0xA0 + k] * 100), bytes([0xB0] * 100), 1))
        with Bag(path) as bag:
            assert [message.log_time_ns for message in bag.raw(start_ns=2, end_ns=3)] == [2, 3]
            with pytest.raises(InputError):
                list(bag.raw())


@pytest.mark.parametrize("compression", ["", "lz4", "zstd"])
def test_of_a_cut_chunk_its_beginning_is_read_from_its_first_byte_on(compression: str) -> None:
    """The record as the MCAP specification has it: times, size, CRC, name of the compression, length, content."""
    content = random.Random(3).randbytes(3 * 2**18)
    packed = {"": bytes, "lz4": lz4.frame.compress, "zstd": zstandard.ZstdCompressor().compress}[compression](content)
    name = compression.encode()
    head = struct.pack("<QQQI", 1, 2, len(content), zlib.crc32(content)) + struct.pack("<I", len(name)) + name
    found = partial_chunk((head + struct.pack("<Q", len(packed)) + packed)[: -len(packed) // 3])
    assert 0 < len(found) < len(content)
    assert content.startswith(found)
