"""What a run in this process was, tick by tick, as arrays: what it is judged by, drawn from and looked at."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from scipy.spatial.transform import Rotation

from slip_core.arrays import Array
from slip_core.params import flatten
from slip_sim_bridge.internal import internal_wrenches
from slip_vic.run.data import ArmData, Channel, RunData
from slip_vic.run.in_process import Tick
from slip_vic.scenarios.scenario import Scenario
from slip_vic_controller.safety.modes import Mode


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
        self._object.append(np.concatenate((thing.position, thing.rotation.ravel())))
        if self.scenario.several:
            positions, rotations = zip(*(reading.pad for reading in readings), strict=True)
            wrenches = [reading.wrench.wrench for reading in readings]
            radius = self.scenario.first.friction.torsional_radius
            parts = internal_wrenches(wrenches, positions, rotations, thing.position, radius)
            for rows, internal in zip(self._rows, parts, strict=True):
                rows["internal"].append(np.array(internal))
        for k, (reading, result, effort) in enumerate(zip(readings, tick.results, tick.efforts, strict=True)):
            rows, truth, joint = self._rows[k], reading.truth, reading.joint
            n = len(self.scenario.controllers[self.arms[k]].joint_names)
            applied = effort if len(effort) == n else np.full(n, np.nan)
            measured = joint.position[:n], joint.velocity[:n]
            numbers = truth.slip_displacement, truth.slip_velocity, reading.wrench.wrench, *measured, applied
            rows["all"].append(np.concatenate(numbers))
            rows["law"].append(result.symbols())
            said = (result.mode, *(result.reason_key if result.mode is not Mode.ACTIVE else ()))
            if said != self._said[k]:
                self._said[k] = said
                words = result.reason if result.mode is not Mode.ACTIVE else ""
                self._modes[k].append((tick.time_s, f"{result.mode.name}: {words}" if words else result.mode.name))

    def _channels(self, k: int) -> dict[str, Array]:
        """Return the rows of each channel of an arm."""
        found = {name: np.array(rows) for name, rows in self._rows[k].items()}
        parts = np.split(found.pop("all"), [6, 12, 18], axis=1)
        names = "slip", "slip_velocity", "wrench", "joints", "joint_velocity", "effort"
        return found | dict(zip(names, (*parts[:3], *np.split(parts[3], 3, axis=1)), strict=True))

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
                {channel: Channel(times, rows) for channel, rows in self._channels(k).items()},
                self._symbols[k],
                tuple(self._modes[k]),
            )
            for k, name in enumerate(self.arms)
        )
        return RunData(arms, Channel(times, np.hstack((thing[:, :3], attitude))), flatten(scenario.first), facts)
