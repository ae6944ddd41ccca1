"""Recovery of killed, cut and damaged bags, and what a refusing disk leaves behind."""

from __future__ import annotations

import errno
import hashlib
import os
import random
import struct
from pathlib import Path

import pytest
from click.testing import CliRunner
from mcap.reader import make_reader
from mcap.writer import Writer
from rosbags.highlevel import AnyReader

from slip_bags.cli import bag as bag_command
from slip_bags.format import BagMessage
from slip_bags.reader import Bag
from slip_bags.recover import recover
from slip_bags.writer import StorageError
from slip_core.errors import InputError
from test.support.bag_maker import make_bag

TOPICS = {"/a": "sensor_msgs/msg/JointState", "/b": "geometry_msgs/msg/WrenchStamped"}
COUNT, FLUSH = 400, 40


def digest(path: Path) -> dict[str, tuple[str, int]]:
    """Content and modification time of every file of a bag."""
    return {
        file.name: (hashlib.sha256(file.read_bytes()).hexdigest(), file.stat().st_mtime_ns) for file in path.iterdir()
    }


def messages(path: Path) -> list[BagMessage]:
    return list(Bag(path).raw())


@pytest.fixture(scope="module")
def original(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("bag") / "bag"
    custom, attached = {"seed": "7"}, {"arm.urdf": b"<robot/>"}
    make_bag(folder, count=COUNT, topics=TOPICS, custom_data=custom, attachments=attached, flush_every=FLUSH)
    return folder


def test_killed_recorder_keeps_flushed_messages(original, tmp_path):
    """Without its summary and metadata.yaml a bag is what kill -9 leaves behind."""
    killed = tmp_path / "killed"
    killed.mkdir()
    (killed / "killed_0.mcap").write_bytes((original / "bag_0.mcap").read_bytes()[:-100])
    before = digest(killed)
    found = recover(killed, tmp_path / "whole")
    assert messages(tmp_path / "whole") == messages(original)
    assert digest(killed) == before
    assert found == f"{COUNT * len(TOPICS)} messages on {len(TOPICS)} topics, not readable: the end"
    bag, source = Bag(tmp_path / "whole"), Bag(original)
    assert bag.custom_data["seed"] == "7"
    assert bag.custom_data["recovered"] == "true"
    assert bag.attachments == source.attachments
    assert bag.topics == source.topics
    with AnyReader([tmp_path / "whole"]) as reader:
        assert reader.message_count == COUNT * len(TOPICS)


@pytest.mark.parametrize("seed", range(10))
def test_cut_anywhere(original, tmp_path, seed):
    """Every complete chunk is saved, and nothing else."""
    data = (original / "bag_0.mcap").read_bytes()
    end = random.Random(seed).randrange(len(data))
    (tmp_path / "cut.mcap").write_bytes(data[:end])
    flushed = complete_chunks(data, end) * FLUSH * len(TOPICS)
    if flushed == 0:
        with pytest.raises(InputError, match="no message that can be read"):
            recover(tmp_path / "cut.mcap", tmp_path / "out")
        assert not (tmp_path / "out").exists()
    else:
        recover(tmp_path / "cut.mcap", tmp_path / "out")
        assert messages(tmp_path / "out") == messages(original)[:flushed]


def complete_chunks(data: bytes, end: int) -> int:
    """How many chunk records end before `end`, counted by hand."""
    position, chunks = 8, 0
    while position + 9 <= end:
        opcode, length = struct.unpack_from("<BQ", data, position)
        position += 9 + length
        chunks += opcode == 6 and position <= end
    return chunks


def test_damaged_chunk_costs_its_own_messages(original, tmp_path):
    with (original / "bag_0.mcap").open("rb") as file:
        chunk = make_reader(file).get_summary().chunk_indexes[4]
    data = bytearray((original / "bag_0.mcap").read_bytes())
    data[chunk.chunk_start_offset + chunk.chunk_length // 2] ^= 1
    (tmp_path / "bad.mcap").write_bytes(data)
    found = recover(tmp_path / "bad.mcap", tmp_path / "out")
    first, last = chunk.message_start_time, chunk.message_end_time
    kept = [row for row in messages(original) if not first <= row.log_time_ns <= last]
    assert messages(tmp_path / "out") == kept
    assert found.partition(", ")[2] == "not readable: a chunk"


def test_command_names_its_output(tmp_path):
    make_bag(tmp_path / "bag", count=20, topics=TOPICS)
    output = CliRunner().invoke(bag_command, ["recover", str(tmp_path / "bag")]).output
    assert output == f"{tmp_path / 'bag_recovered'}: 40 messages on 2 topics\n"


def test_full_disk_leaves_a_recoverable_bag(tmp_path, monkeypatch):
    def refuse(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    honest, written = Writer.add_message, []

    def write(self, *arguments) -> None:
        written.append(arguments)
        (refuse if len(written) > 2 * FLUSH else honest)(self, *arguments)

    monkeypatch.setattr(Writer, "add_message", write)
    with pytest.raises(StorageError, match=r": No space left on device; .*bag recover"):
        make_bag(tmp_path / "bag", count=COUNT, topics=TOPICS, flush_every=10)
    monkeypatch.undo()
    recover(tmp_path / "bag", tmp_path / "out")
    assert len(messages(tmp_path / "out")) == 2 * FLUSH


def test_flush_reaches_the_disk(tmp_path, monkeypatch):
    synced, honest = [], os.fsync
    monkeypatch.setattr(os, "fsync", lambda number: (honest(number), synced.append(os.fstat(number).st_size)))
    make_bag(tmp_path / "bag", count=20, topics=TOPICS, flush_every=10)
    first, second, *ends = synced
    assert 0 < first < second < ends[0]
    assert ends == [(tmp_path / "bag" / name).stat().st_size for name in ("bag_0.mcap", "metadata.yaml")]
