"""The one judge of a run: how it ended, and the numbers that it is compared by, whatever ran it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from slip_bags.reader import Bag
from slip_core.incidents import Incident
from slip_sim_bridge.params import BridgeParams
from slip_sim_bridge.plant import DivergenceError
from slip_vic.run.in_process import Tick
from slip_vic.run.metrics import summarise
from slip_vic.run.series import RunSeries, mode_changes, read_series
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
SETTLE_S: Final = 0.5
"""Time at the end over which the internal force counts as steady [s]."""
_ENDS: Final = ("lost", "fault")
"""Outcomes after which a run has nothing more to show."""
_MILD: Final = ("ok", "held")
"""Outcomes that a worse one replaces."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """How a run went.

    outcome, reason: see `Outcome`; reason is empty where all is well. arms: the numbers of each arm by its name, as in
    `summarise` and `share_of_friction`; empty where nothing ran. together: what they do to the object, see there.
    """

    outcome: Outcome
    reason: str
    arms: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    together: Mapping[str, float] = field(default_factory=dict)

    def worst(self, name: str) -> float:
        """Return the largest of a number over the arms; NaN where there is none."""
        return max((float(numbers[name]) for numbers in self.arms.values()), default=math.nan)


def measured(scenario: Scenario, series: Sequence[RunSeries], outcome: Outcome, reason: str) -> Verdict:
    """Return the verdict on a run from its arrays, wherever they are from; series: of each arm."""
    arms = {one.arm: {**summarise(one), **share_of_friction(one, scenario.bridges[one.arm])} for one in series}
    if outcome in _ENDS:
        for numbers in arms.values():
            numbers["arrival_s"] = math.nan
    return Verdict(outcome, reason, arms, together(scenario, series))


def share_of_friction(series: RunSeries, params: BridgeParams) -> dict[str, float]:
    """Return the largest share of the friction limit that the load of a pad took: load_peak."""
    if not series.wrench.size:
        return {"load_peak": math.nan}
    h, radius = series.wrench, params.friction.torsional_radius
    load = np.sqrt(h[:, 0] ** 2 + h[:, 1] ** 2 + (h[:, 5] / radius) ** 2)
    limit = params.friction.mu_s * params.grip.force
    return {"load_peak": float(load.max() / limit) if limit > 0.0 else math.nan}


def together(scenario: Scenario, series: Sequence[RunSeries]) -> dict[str, float]:
    """Return what all arms do to the object.

    object_error_m: largest distance of the object from where the path of the first pad has it, but for where it hangs
    at first. Of several arms also internal_peak_n and internal_steady_n: the largest force with which they work against
    each other in the slip plane, over the run and in its last half second.
    """
    first = series[0]
    grasp = next(iter(scenario.controllers.values())).contacts
    lever = Rotation.from_quat(grasp.orientation_xyzw[:4]).inv().apply(grasp.position[:3])
    desired = first.law_six("desired")
    known = np.isfinite(desired).all(axis=1)
    found = {"object_error_m": math.nan}
    if known.any() and first.object_position.size:
        wanted = desired[known, :3] - Rotation.from_rotvec(desired[known, 3:]).apply(lever)
        at = np.clip(np.searchsorted(first.time, first.law_time[known] - 1e-9), 0, len(first.time) - 1)
        apart = first.object_position[at] - wanted
        found["object_error_m"] = float(np.linalg.norm(apart - apart[0], axis=1).max())
    if all(one.internal.size for one in series) and scenario.several:
        size = np.max([np.linalg.norm(one.internal[:, :2], axis=1) for one in series], axis=0)
        steady = first.time >= scenario.duration_s - SETTLE_S
        found["internal_peak_n"] = float(size.max())
        found["internal_steady_n"] = float(size[steady].max(initial=0.0))
    return found


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
    return measured(track.scenario, track.series(), outcome, reason)


def judge_incidents(incidents: Iterable[Incident], outcome: Outcome = "ok", reason: str = "") -> tuple[Outcome, str]:
    """Return outcome and reason of a run after some incidents, from those before."""
    for incident in incidents:
        found = OF_INCIDENT[incident.kind]
        if outcome in _MILD or found in _ENDS:
            outcome, reason = found, str(incident)
    return outcome, reason


def judge_bag(path: Path, scenario: Scenario, incidents: Iterable[Incident] = ()) -> Verdict:
    """Return the verdict on the recorded run of a scenario; incidents: what its processes reported.

    Raises:
        InputError: the bag lacks a topic that a run has.
    """
    series = [read_series(path, arm) for arm in scenario.controllers]
    return measured(scenario, series, *judge_incidents(incidents))


def modes_of_bag(path: Path, scenario: Scenario) -> dict[str, tuple[tuple[float, str], ...]]:
    """Return the changes of mode of each arm in a bag: from when on [s], mode and reason."""
    found = {}
    with Bag(path) as bag:
        for name in scenario.controllers:
            states = bag.series(bag.ending("joint_states", name) or "joint_states")
            found[name] = mode_changes(bag, bag.ending("controller/mode", name), states, int(states.stamps[0]))
    return found
