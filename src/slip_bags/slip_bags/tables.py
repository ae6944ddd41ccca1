"""Where tables are printed."""

from __future__ import annotations

from typing import Final

from rich.console import Console

_PLAIN_WIDTH: Final = 160


def table_console() -> Console:
    """Return a console as wide as the terminal, or wide enough where there is none."""
    console = Console()
    return console if console.is_terminal else Console(width=_PLAIN_WIDTH)
