"""The one judge of a run: how it ended, and the numbers that it is compared by, whatever ran it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np

from slip_core.incidents import Incident
from slip_sim_bridge.plant import DivergenceError
from slip_vic.run.data import ArmData, RunData, read_data
from slip_vic.run.in_process import Tick
from slip_vic.run.metrics import summarise
from slip_vic.run.track import Track
from slip_vic.scenarios.scenario import Scenario

Outcome = Literal["ok", "lost", "fault", "refused", "saturated", "held", "crashed"]
"""lost: the object left a pad, the pad left its path, or the simulation has no numbers any more. fault: the controller
gave up. refused: parameters that do not fit, or a path that cannot be followed. saturated: the arm has not the effort.
held: the law never began, or the mode machine stopped it for a while. crashed: a process died."""

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

    outcome, reason: see `Outcome`; reason is empty where all is well. arms: the numbers of each arm by its name, as in
    `summarise`; empty where nothing ran. together: what they do to the object, see there.
    """

    outcome: Outcome
    reason: str
    arms: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    together: Mapping[str, float] = field(default_factory=dict)

    def worst(self, name: str) -> float:
        """Return the largest of a number over the arms; NaN where there is none."""
        return max((float(numbers[name]) for numbers in self.arms.values()), default=math.nan)


def measured(scenario: Scenario, run: RunData, outcome: Outcome, reason: str) -> Verdict:
    """Return the verdict on a run from its data, wherever they are from."""
    found = {name: run.arm(name) for name in scenario.controllers}
    arms = {name: summarise(arm) for name, arm in found.items()}
    if outcome in _ENDS:
        for numbers in arms.values():
            numbers["arrival_s"] = math.nan
    return Verdict(outcome, reason, arms, together(list(found.values())))


def together(arms: Sequence[ArmData]) -> dict[str, float]:
    """Return what several arms do to the object: internal_peak_n, the largest force between them in the slip plane."""
    if not all("internal" in arm.channels for arm in arms):
        return {}
    forces = [np.linalg.norm(arm.channel("internal").rows[:, :2], axis=1).max() for arm in arms]
    return {"internal_peak_n": float(max(forces))}


def judge(ticks: Iterable[Tick], track: Track) -> Verdict:
    """Run to the end, or until there is nothing more to show, and return the verdict.

    Args:
        ticks: of a run, see `run_in_process`.
        track: takes every tick in.
    """
    outcome: Outcome = "ok"
    reason, begun, waits = "", False, None
    try:
        for tick in ticks:
            track.add(tick)
            outcome, reason = judge_incidents(tick.incidents, outcome, reason)
            for result in tick.results if outcome not in _ENDS else ():
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
            if outcome in _ENDS:
                break
    except DivergenceError as failure:
        outcome, reason = "lost", str(failure)
    if waits is not None and not begun and outcome == "ok":
        outcome, reason = "held", f"the law never began: {waits.reason}"
    if not track.ticks:
        return Verdict(outcome, reason)
    return measured(track.scenario, track.data(), outcome, reason)


def judge_incidents(incidents: Iterable[Incident], outcome: Outcome = "ok", reason: str = "") -> tuple[Outcome, str]:
    """Return outcome and reason of a run after some incidents, from those before."""
    for incident in incidents:
        found = OF_INCIDENT[incident.kind]
        if outcome in _MILD or found in _ENDS:
            outcome, reason = found, str(incident)
    return outcome, reason


def judge_bag(
    path: Path, scenario: Scenario, incidents: Iterable[Incident] = ()
) -> tuple[Verdict, dict[str, tuple[tuple[float, str], ...]]]:
    """Return the verdict on the recorded run of a scenario, and the changes of mode of each arm.

    incidents: what its processes reported.

    Raises:
        InputError: the bag lacks a topic that a run has.
    """
    run = read_data(path)
    modes = {name: run.arm(name).modes for name in scenario.controllers}
    return measured(scenario, run, *judge_incidents(incidents)), modes
