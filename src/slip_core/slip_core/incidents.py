"""What makes a run one that went wrong, although no program failed: reported once, in one line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

KINDS: Final = {
    "lost": "LOST", "fault": "FAULT", "unreachable": "UNREACHABLE", "saturated": "SATURATED"
}  # fmt: skip
"""The object left the pads; the controller gave up; the path cannot be followed; the arm cannot do what is asked."""


@dataclass(frozen=True, slots=True)
class Incident:
    """What happened, one of `KINDS`; when, in the run's own time [s]; one line of text."""

    kind: str
    time_s: float
    text: str

    def __str__(self) -> str:
        return f"{KINDS[self.kind]} at {self.time_s:.3f} s: {self.text}"
