"""The one judge of a run: how it ended, and the numbers that it is compared by, whatever ran it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Literal

from slip_core.incidents import Incident
from slip_sim_bridge.plant import DivergenceError
from slip_vic.run.in_process import Tick
from slip_vic.run.metrics import summarise
from slip_vic.run.track import Track

Outcome = Literal["ok", "lost", "fault", "refused", "saturated", "held", "crashed"]
"""lost: the object left a pad, the pad left its path, or the simulation has no numbers any more. fault: the controller
gave up. refused: parameters that do not fit, or a path that cannot be followed. saturated: the arm has not the effort.
held: the mode machine stopped the law for a while. crashed: a process died."""

LOST_ERROR_M: Final = 1.0
"""Tracking error from which on a run counts as lost."""

OF_INCIDENT: Final[Mapping[str, Outcome]] = {
    "lost": "lost", "fault": "fault", "unreachable": "refused", "saturated": "saturated"
}  # fmt: skip
_ENDS: Final = ("lost", "fault")
"""Outcomes after which a run has nothing more to show."""
_MILD: Final = ("ok", "held")
"""Outcomes that a worse one replaces."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """How a run went.

    outcome, reason: see `Outcome`; reason is empty where all is well. arms: the numbers of each arm by its name, as of
    `summarise`; empty where nothing ran.
    """

    outcome: Outcome
    reason: str
    arms: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def worst(self, name: str) -> float:
        """Return the largest of a number over the arms; NaN where there is none."""
        return max((float(numbers[name]) for numbers in self.arms.values()), default=math.nan)


class Judge:
    """Looks at one tick after the other of a run in this process.

    Args:
        track: takes every tick in.
    """

    def __init__(self, track: Track) -> None:
        self._track = track
        self.outcome: Outcome = "ok"
        self.reason = ""
        self._begun = False

    def look(self, tick: Tick) -> bool:
        """Take a tick in; return whether the run has more to show."""
        self._track.add(tick)
        for incident in tick.incidents:
            found = OF_INCIDENT[incident.kind]
            if self.outcome in _MILD or found in _ENDS:
                self.outcome, self.reason = found, str(incident)
        if self.outcome in _ENDS:
            return False
        for result in tick.results:
            if not result.record.ok:
                if self._begun and self.outcome == "ok":
                    self.outcome, self.reason = "held", f"{tick.time_s:.3f} s: {result.reason}"
                continue
            self._begun = True
            error = float(result.record.law.error_linear)
            if not error < LOST_ERROR_M:
                self.outcome, self.reason = "lost", f"{tick.time_s:.3f} s: the pad is {error:.2f} m off its path"
                return False
        return True

    def verdict(self) -> Verdict:
        """Return how the run went."""
        if not self._track.ticks:
            return Verdict(self.outcome, self.reason)
        arms = {series.arm: dict(summarise(series)) for series in self._track.series()}
        if self.outcome in _ENDS:
            for numbers in arms.values():
                numbers["arrival_s"] = math.nan
        return Verdict(self.outcome, self.reason, arms)


def judge(ticks: Iterable[Tick], track: Track) -> Verdict:
    """Run to the end, or until there is nothing more to show, and return the verdict.

    Args:
        ticks: of a run, see `run_in_process`.
        track: takes every tick in.
    """
    found = Judge(track)
    try:
        for tick in ticks:
            if not found.look(tick):
                break
    except DivergenceError as failure:
        found.outcome, found.reason = "lost", str(failure)
    return found.verdict()


def judge_incidents(incidents: Iterable[Incident]) -> tuple[Outcome, str]:
    """Return outcome and reason of a run of processes from what they reported."""
    outcome: Outcome = "ok"
    reason = ""
    for incident in incidents:
        found = OF_INCIDENT[incident.kind]
        if outcome in _MILD or found in _ENDS:
            outcome, reason = found, str(incident)
    return outcome, reason
