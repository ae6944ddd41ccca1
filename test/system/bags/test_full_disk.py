"""A disk that is full: every bag is readable, and its error says how much is in it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from slip_bags.format import parse_metadata
from slip_bags.reader import Bag

SUPPORT = Path(__file__).parents[2] / "support"
SIZE_LIMITS = (5_000, 20_000, 60_000, 100_000, 140_000)


WRITE_UNTIL_FULL = """
import resource, sys
sys.path.insert(0, sys.argv[1])
from pathlib import Path
from bag_maker import make_bag
from slip_bags.writer import StorageError, WriterOptions
for compression in ("zstd", "none"):
    for limit in map(int, sys.argv[3:]):
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
        topics, options = {"/a": "sensor_msgs/msg/JointState"}, WriterOptions(compression)
        try:
            bag = Path(sys.argv[2], f"{compression}{limit}")
            make_bag(bag, count=2000, topics=topics, options=options, flush_every=40)
        except StorageError as error:
            print(error)
"""


@pytest.fixture(scope="module")
def filled(tmp_path_factory) -> tuple[Path, dict[str, str]]:
    """Bags written until nothing more goes in; a limit on the size of files stands for the full disk."""
    folder = tmp_path_factory.mktemp("full")
    limits = [str(limit) for limit in SIZE_LIMITS]
    command = [sys.executable, "-c", WRITE_UNTIL_FULL, str(SUPPORT), str(folder), *limits]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    names = [f"{compression}{limit}" for compression in ("zstd", "none") for limit in limits]
    return folder, dict(zip(names, done.stdout.splitlines(), strict=True))


@pytest.mark.parametrize("compression", ["zstd", "none"])
@pytest.mark.parametrize("limit", SIZE_LIMITS)
def test_full_disk_ends_with_a_readable_bag(filled, limit, compression):
    folder, errors = filled
    bag, error = folder / f"{compression}{limit}", errors[f"{compression}{limit}"]
    assert "File too large; closed with the" in error
    metadata = parse_metadata((bag / "metadata.yaml").read_text(), "metadata.yaml")
    saved = []
    if metadata.files:
        with Bag(bag) as opened:
            saved = list(opened.raw())
    assert [message.sequence for message in saved] == list(range(1, len(saved) + 1))
    assert f"the {len(saved)} messages" in error
    assert metadata.message_count == len(saved)
    if limit >= 60_000:
        assert len(saved) > 0
        with (bag / f"{bag.name}_0.mcap").open("rb") as file:
            assert len(list(make_reader(file, validate_crcs=True).iter_messages())) == len(saved)
        with AnyReader([bag]) as reader:
            assert len(list(reader.messages())) == len(saved)
