"""The commands that the pages show, wherever on a page: blocks, indented lines, code in a sentence or a table."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

ROOT = Path(__file__).parents[2]
EVIDENCE = ROOT / "docs" / "evidence.md"
"""Generated from tables whose commands belong to the commits in their rows."""
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(set((ROOT / "docs").glob("*.md")) - {EVIDENCE})]
OURS = ("./run", "slip-vic")
_BLOCK = re.compile(r"^```\w*\n(.*?)^```", flags=re.S | re.M)
_INDENTED = re.compile(r"(?:(?<=\n\n)|(?<=\A))((?: {4}\S.*\n)+)")
_INLINE = re.compile(r"`([^`]+)`")
_FIRST = re.compile(r"^(?:\$ )?(\./run|slip-vic|python|pytest|ros2|\.venv/bin/\w+|slip_\w+_node)(?= )")


def shown_commands(text: str, *, inline: bool = True) -> list[list[str]]:
    """Return the words of every command on a page, in order, without comments and prompts.

    inline: also code in a sentence or a table, which may only name a command.
    """
    text = text.replace("\\\n", " ")
    blocks = [*_BLOCK.finditer(text), *_INDENTED.finditer(text)]
    found = [(m.start(1) + m.group(1).index(line), line) for m in blocks for line in m.group(1).splitlines()]
    for m in blocks:
        text = text[: m.start()] + " " * (m.end() - m.start()) + text[m.end() :]
    if inline:
        found += [(m.start(1), " ".join(m.group(1).split())) for m in _INLINE.finditer(text)]
    lines = [line.strip().removeprefix("$ ") for _, line in sorted(found)]
    return [shlex.split(line, comments=True) for line in lines if _FIRST.match(line)]


def commands_of(page: Path, *, inline: bool = True) -> list[list[str]]:
    """Return the commands of one page."""
    return shown_commands(page.read_text(encoding="utf-8"), inline=inline)
