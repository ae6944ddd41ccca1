"""What a child process tells its parent: events, one line of JSON on stdout each. Both sides use this module.

A child tells them only where the parent asked for it, by `EVENTS_VARIABLE` = "1" in the child's environment.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Final

from slip_core.incidents import Incident

EVENTS_VARIABLE: Final = "SLIP_VIC_EVENTS"


@dataclass(frozen=True, slots=True)
class Started:
    """The bridge lets time run."""


@dataclass(frozen=True, slots=True)
class Ready:
    """All endpoints of the process are matched."""


@dataclass(frozen=True, slots=True)
class Progress:
    """The bridge has simulated so far [s], in so many ticks."""

    sim_time_s: float
    ticks: int


@dataclass(frozen=True, slots=True)
class Status:
    """The recorder has written so many messages, and knows of so many that were lost."""

    messages: int
    lost: int


@dataclass(frozen=True, slots=True)
class Warned:
    """Something was refused or is not as wished; one line of text."""

    text: str


@dataclass(frozen=True, slots=True)
class Failed:
    """The process ends with an error; one line of text."""

    text: str


@dataclass(frozen=True, slots=True)
class Done:
    """The process has finished its work; its results by name, as JSON can hold them."""

    values: Mapping[str, Any]


Event = Started | Ready | Progress | Status | Incident | Warned | Failed | Done
_KINDS: Final[Mapping[str, type[Event]]] = {
    "started": Started,
    "ready": Ready,
    "progress": Progress,
    "status": Status,
    "incident": Incident,
    "warning": Warned,
    "error": Failed,
    "done": Done,
}
_NAMES: Final = {kind: name for name, kind in _KINDS.items()}


def encode(event: Event) -> str:
    """Return an event as one line of JSON, without the line's end."""
    values = {item.name: getattr(event, item.name) for item in fields(event)}
    return json.dumps({"event": _NAMES[type(event)], **values})


def decode(line: str) -> Event | None:
    """Return the event of a line; None where the line is something else."""
    if not line.startswith('{"event"'):
        return None
    try:
        values = json.loads(line)
        return _KINDS[values.pop("event")](**values)
    except (ValueError, KeyError, TypeError):
        return None


def wanted() -> bool:
    """Return whether a parent listens to the events of this process."""
    return os.environ.get(EVENTS_VARIABLE) == "1"


def emit(event: Event) -> None:
    """Tell the parent, where one listens."""
    if wanted():
        print(encode(event), flush=True)


def warn(source: str, text: str) -> None:
    """Tell the parent of a warning; where none listens, print it to stderr with its source."""
    if wanted():
        emit(Warned(text))
    else:
        print(f"warning: {source}: {text}", file=sys.stderr, flush=True)
