"""What makes a run one that went wrong, although no program failed: reported once, in one line."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Incident:
    """What happened; when, in the run's own time [s]; one line of text.

    kind: lost, the object left the pads; fault, the controller gave up; unreachable, the path cannot be followed;
    saturated, the arm cannot do what is asked.
    """

    kind: str
    time_s: float
    text: str

    def __str__(self) -> str:
        return f"{self.kind.upper()} at {self.time_s:.3f} s: {self.text}"
