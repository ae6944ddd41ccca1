"""What a child process tells its parent: events, one line of JSON on stdout each. Both sides use this module.

A child tells them only where the parent asked for it, by `EVENTS_VARIABLE` = "1" in the child's environment.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Mapping
from typing import Any, Final, Literal, NamedTuple, get_args

EVENTS_VARIABLE: Final = "SLIP_VIC_EVENTS"

Kind = Literal["started", "ready", "progress", "status", "incident", "warning", "error", "done"]
"""The bridge lets time run. All endpoints of the process are matched. The bridge has simulated so far (`sim_time_s`,
`ticks`). The recorder has written so many messages, and knows of so many that were lost (`messages`, `lost`). The run
went wrong (the fields of `Incident`). Something was refused or is not as wished; the process ends with an error
(`text`, one line). The process has finished its work (its results by name)."""


class Event(NamedTuple):
    """What happened, and what belongs to it by name, as JSON can hold it."""

    kind: Kind
    values: Mapping[str, Any]


def decode(line: str) -> Event | None:
    """Return the event of a line; None where the line is something else."""
    if not line.startswith('{"event"'):
        return None
    try:
        values = json.loads(line)
    except ValueError:
        return None
    kind = values.pop("event")
    return Event(kind, values) if kind in get_args(Kind) else None


def wanted() -> bool:
    """Return whether a parent listens to the events of this process."""
    return os.environ.get(EVENTS_VARIABLE) == "1"


def emit(kind: Kind, /, **values: Any) -> None:
    """Tell the parent, where one listens."""
    if wanted():
        print(json.dumps({"event": kind, **values}), flush=True)


def warn(source: str, text: str) -> None:
    """Tell the parent of a warning; where none listens, print it to stderr with its source."""
    if wanted():
        emit("warning", text=text)
    else:
        print(f"warning: {source}: {text}", file=sys.stderr, flush=True)
