"""The one judge of a run: how it ended, whatever ran it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final

from slip_core.incidents import Incident
from slip_sim_bridge.plant import DivergenceError
from slip_vic.run.data import read_data
from slip_vic.run.in_process import Tick
from slip_vic.run.run import ENDS, Outcome, Run
from slip_vic.run.track import Track
from slip_vic.scenarios.scenario import Scenario

LOST_ERROR_M: Final = 1.0
"""Tracking error from which on a run counts as lost."""

OF_INCIDENT: Final[Mapping[str, Outcome]] = {
    "lost": "lost", "fault": "fault", "unreachable": "refused", "saturated": "saturated"
}  # fmt: skip
_MILD: Final = ("ok", "held")
"""Outcomes that a worse one replaces."""


class LawError(Exception):
    """What a law of one's own did that a law must not do, in one line."""


def judge(ticks: Iterable[Tick], scenario: Scenario) -> Run:
    """Run to the end, or until there is nothing more to show.

    Args:
        ticks: of a run, see `run_in_process`.
        scenario: what runs.
    """
    track = Track(scenario)
    outcome: Outcome = "ok"
    reason, begun, waits = "", False, None
    try:
        for tick in ticks:
            track.add(tick)
            outcome, reason = judge_incidents(tick.incidents, outcome, reason)
            for result in tick.results if outcome not in ENDS else ():
                if result.ok:
                    begun = True
                    error = float(result.record.law.error_linear)
                    if not error < LOST_ERROR_M:
                        outcome, reason = "lost", f"{tick.time_s:.3f} s: the pad is {error:.2f} m off its path"
                        break
                elif begun and outcome == "ok":
                    outcome, reason = "held", f"{tick.time_s:.3f} s: {result.reason}"
                elif not begun:
                    waits = result
            if outcome in ENDS:
                break
    except DivergenceError as failure:
        outcome, reason = "lost", str(failure)
    except LawError as failure:
        outcome, reason = "failed", str(failure)
    if waits is not None and not begun and outcome == "ok":
        outcome, reason = "held", f"the law never began: {waits.reason}"
    return Run(scenario, outcome, reason, track.data())


def judge_incidents(incidents: Iterable[Incident], outcome: Outcome = "ok", reason: str = "") -> tuple[Outcome, str]:
    """Return outcome and reason of a run after some incidents, from those before."""
    for incident in incidents:
        found = OF_INCIDENT[incident.kind]
        if outcome in _MILD or found in ENDS:
            outcome, reason = found, str(incident)
    return outcome, reason


def judge_bag(path: Path, scenario: Scenario, incidents: Iterable[Incident] = ()) -> Run:
    """Return the recorded run of a scenario; incidents: what its processes reported.

    Raises:
        InputError: the bag lacks a topic that a run has.
    """
    return Run(scenario, *judge_incidents(incidents), read_data(path))
