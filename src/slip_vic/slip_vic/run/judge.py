"""Judge a run: how it ended, and its data if it ran in this process."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from slip_core.arrays import Array
from slip_core.params import flatten
from slip_core.types import Incident
from slip_sim_bridge.plant import DivergenceError
from slip_vic.run.data import ArmData, Channel, RunData, read_data
from slip_vic.run.in_process import Tick
from slip_vic.run.run import ENDS, Outcome, Run
from slip_vic.scenarios.scenario import Scenario
from slip_vic_controller.safety.conditions import Mode

LOST_ERROR_M: Final = 1.0
"""Tracking error from which on a run counts as lost."""

OF_INCIDENT: Final[Mapping[str, Outcome]] = {
    "lost": "lost", "fault": "fault", "unreachable": "refused", "saturated": "saturated"
}  # fmt: skip
_MILD: Final = ("ok", "held")
"""Outcomes that a worse one replaces."""


class LawError(Exception):
    """A user's law broke the rules for laws; the text is one line."""


def judge(ticks: Iterable[Tick], scenario: Scenario) -> Run:
    """Run to the end, or until the outcome is known.

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
                if result.record.ok:
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


class Track:
    """Collects the ticks of a run.

    Args:
        scenario: what runs.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario, self.arms = scenario, tuple(scenario.controllers)
        self._times: list[float] = []
        self._object: list[Array] = []
        self._rows: list[defaultdict[str, list[Array]]] = [defaultdict(list) for _ in self.arms]
        self._symbols: list[tuple[str, ...]] = [() for _ in self.arms]
        self._modes: list[list[tuple[float, str]]] = [[] for _ in self.arms]
        self._said: list[tuple[int, ...]] = [() for _ in self.arms]

    def add(self, tick: Tick) -> None:
        """Take a tick in, with the effort that is applied."""
        if not self._times:
            self._symbols = [result.symbol_names for result in tick.results]
        self._times.append(tick.time_s)
        readings = [arm.readings for arm in tick.outputs.arms]
        thing = readings[0].truth
        self._object.append(np.concatenate((thing.object_position, thing.object_rotation.ravel())))
        if self.scenario.several:
            parts = tick.outputs.internal_wrenches(self.scenario.first.friction.torsional_radius)
            for rows, internal in zip(self._rows, parts, strict=True):
                rows["internal"].append(np.array(internal))
        for k, (reading, result, effort) in enumerate(zip(readings, tick.results, tick.efforts, strict=True)):
            rows, truth, joint = self._rows[k], reading.truth, reading.joint
            n = len(self.scenario.controllers[self.arms[k]].joint_names)
            rows["slip"].append(np.array(truth.slip_displacement))
            rows["slip_velocity"].append(np.array(truth.slip_velocity))
            rows["wrench"].append(np.array(reading.wrench.wrench))
            rows["joints"].append(np.array(joint.position[:n]))
            rows["joint_velocity"].append(np.array(joint.velocity[:n]))
            rows["effort"].append(np.array(effort) if len(effort) == n else np.full(n, np.nan))
            rows["law"].append(result.symbols())
            said = (result.mode, *(result.reason_key if result.mode is not Mode.ACTIVE else ()))
            if said != self._said[k]:
                self._said[k] = said
                words = result.reason if result.mode is not Mode.ACTIVE else ""
                self._modes[k].append((tick.time_s, f"{result.mode.name}: {words}" if words else result.mode.name))

    def data(self) -> RunData:
        """Return the run; without a tick it has no arms."""
        scenario, facts = self.scenario, {"scenario": self.scenario.name, "seed": str(self.scenario.seed)}
        if not self._times:
            return RunData((), None, flatten(scenario.first), facts)
        times, thing = np.array(self._times) - self._times[0], np.array(self._object)
        attitude = Rotation.from_matrix(thing[:, 3:].reshape(-1, 3, 3)).as_quat()
        arms = tuple(
            ArmData(
                name,
                scenario.placed[name],
                tuple(scenario.controllers[name].joint_names),
                flatten(scenario.controllers[name]),
                {channel: Channel(times, np.array(rows)) for channel, rows in self._rows[k].items()},
                self._symbols[k],
                tuple(self._modes[k]),
            )
            for k, name in enumerate(self.arms)
        )
        return RunData(arms, Channel(times, np.hstack((thing[:, :3], attitude))), flatten(scenario.first), facts)
