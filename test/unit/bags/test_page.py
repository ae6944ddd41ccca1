"""The page on bags says what the code does."""

from __future__ import annotations

import re
from pathlib import Path

from slip_bags.cli import bag
from slip_bags.format import VERSION
from slip_bags.recording import QUEUE_DEPTH
from slip_bags.recording.record import MIN_FREE_BYTES, READY_TOPIC
from slip_bags.recording.recorder import POLL_S
from slip_bags.writer import CHUNK_BYTES
from slip_vic.replay.cli import references, verify

PAGE = (Path(__file__).parents[3] / "docs" / "bags.md").read_text(encoding="utf-8")


def test_numbers_are_the_code_s() -> None:
    for text in (
        f"every {1e3 * POLL_S:g} ms all subscriptions are drained",
        f"Below {MIN_FREE_BYTES >> 20} MiB of free space",
        f"queues of {QUEUE_DEPTH} messages per topic",
        f"chunks of {CHUNK_BYTES >> 10} KiB",
        f"rosbag2 folder, version {VERSION}",
        f"`{READY_TOPIC}` (latched)",
    ):
        assert text in PAGE, text


def test_every_command_it_shows_exists() -> None:
    shown = set(re.findall(r"slip-vic bag (\w+)", PAGE))
    assert shown == {*bag.commands} - {references.name} | {verify.name}
