"""The page on bags shows the commands there are."""

from __future__ import annotations

import re
from pathlib import Path

from slip_bags.cli import bag
from slip_vic.replay.cli import verify

PAGE = (Path(__file__).parents[3] / "docs" / "bags.md").read_text(encoding="utf-8")


def test_every_command_is_shown() -> None:
    shown = set(re.findall(r"slip-vic bag (\w+)", PAGE))
    assert shown == {*bag.commands} | {verify.name}
