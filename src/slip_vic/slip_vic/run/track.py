"""What a run in this process was, tick by tick, as arrays: what it is judged by, drawn from and looked at."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from slip_core.arrays import Array
from slip_core.params import flatten
from slip_core.records import place
from slip_sim_bridge.internal import internal_wrenches
from slip_vic.run.data import AXES, ArmData, Channel, RunData
from slip_vic.run.in_process import Tick
from slip_vic.scenarios.scenario import Scenario
from slip_vic_controller.safety.modes import Mode
from slip_vic_controller.state import INPUTS, OUTPUTS

_PARTS = {
    "slip": 6, "slip_velocity": 6, "wrench": 6, "object_position": 3, "object_rotation": 9,
    "position": 3, "rotation": 9, "desired_position": 3, "desired_rotation": 9, "e": 6,
}  # fmt: skip
_POSITION, _ROTATION = place(INPUTS, "arm.position"), place(INPUTS, "arm.rotation")
_DESIRED_POSITION, _DESIRED_ROTATION = place(OUTPUTS, "reference.position"), place(OUTPUTS, "reference.rotation")
_E = place(OUTPUTS, "law.e")
# Where the numbers stand in their buffers: by the names of records a tick costs three times as much.


class Track:
    """Collects the ticks of a run.

    Args:
        scenario: what runs.
        whole: whether every symbol of the law is kept too, of every tick; else what a judge needs.
    """

    def __init__(self, scenario: Scenario, *, whole: bool) -> None:
        self.scenario, self.arms = scenario, tuple(scenario.controllers)
        self._radius = scenario.first.friction.torsional_radius
        self._internal: list[list[Array]] = [[] for _ in self.arms]
        self._whole = whole
        self._times: list[float] = []
        self._rows: list[list[Array]] = [[] for _ in self.arms]
        self._evaluated: list[list[bool]] = [[] for _ in self.arms]
        self._efforts: list[list[Array]] = [[] for _ in self.arms]
        self._joints: list[list[Array]] = [[] for _ in self.arms]
        self._symbol_names: tuple[tuple[str, ...], ...] = ()
        self._symbols: list[list[Array]] = [[] for _ in self.arms]
        self._modes: list[list[tuple[float, str]]] = [[] for _ in self.arms]
        self._said: list[tuple[int, ...]] = [() for _ in self.arms]

    def add(self, tick: Tick) -> None:
        """Take a tick in, with the effort that is applied."""
        now = tick.time_s
        if self._whole and not self._times:
            self._symbol_names = tuple(result.symbol_names for result in tick.results)
        self._times.append(now)
        if self.scenario.several:
            readings = [arm.readings for arm in tick.outputs.arms]
            positions, rotations = zip(*(reading.pad for reading in readings), strict=True)
            wrenches = [reading.wrench.wrench for reading in readings]
            _, parts = internal_wrenches(wrenches, positions, rotations, readings[0].truth.position, self._radius)
            for kept, internal in zip(self._internal, parts, strict=True):
                kept.append(np.array(internal))
        for k, (outputs, result, effort) in enumerate(zip(tick.outputs.arms, tick.results, tick.efforts, strict=True)):
            truth, known, answered = outputs.readings.truth, result.inputs, result.outputs
            self._rows[k].append(
                np.concatenate(
                    (
                        truth.slip_displacement, truth.slip_velocity, outputs.readings.wrench.wrench,
                        truth.position, truth.rotation.ravel(), known[_POSITION], known[_ROTATION],
                        answered[_DESIRED_POSITION], answered[_DESIRED_ROTATION], answered[_E],
                    )
                )
            )  # fmt: skip
            self._evaluated[k].append(result.ok)
            self._efforts[k].append(np.array(effort))
            said = (result.mode, *(result.reason_key if result.mode is not Mode.ACTIVE else ()))
            if said != self._said[k]:
                self._said[k] = said
                words = result.reason if result.mode is not Mode.ACTIVE else ""
                self._modes[k].append((now, f"{result.mode.name}: {words}" if words else result.mode.name))
            if self._whole:
                self._joints[k].append(
                    np.concatenate((outputs.readings.joint.position, outputs.readings.joint.velocity))
                )
                self._symbols[k].append(result.symbols())

    @property
    def ticks(self) -> int:
        """How many have been taken in."""
        return len(self._times)

    def modes(self) -> dict[str, tuple[tuple[float, str], ...]]:
        """Return the changes of mode of each arm: from when on [s], mode and reason."""
        return {name: tuple(self._modes[k]) for k, name in enumerate(self.arms)}

    def data(self) -> RunData:
        """Return the run."""
        scenario, times = self.scenario, np.array(self._times) - self._times[0]
        parts = [self._parts(k) for k in range(len(self.arms))]
        pose = np.hstack(
            (parts[0]["object_position"], Rotation.from_matrix(parts[0]["object_rotation"].reshape(-1, 3, 3)).as_quat())
        )
        return RunData(
            tuple(self._arm(k, name, times, parts[k]) for k, name in enumerate(self.arms)),
            Channel(times, pose),
            flatten(scenario.first),
            {"scenario": scenario.name, "seed": str(scenario.seed)},
            {},
        )

    def _arm(self, k: int, name: str, times: Array, parts: dict[str, Array]) -> ArmData:
        controller = self.scenario.controllers[name]
        symbols, law = self._law(k, parts)
        joints = len(controller.joint_names)
        efforts = [effort if len(effort) == joints else np.full(joints, np.nan) for effort in self._efforts[k]]
        rows = {
            "slip": parts["slip"],
            "slip_velocity": parts["slip_velocity"],
            "wrench": parts["wrench"],
            "effort": np.array(efforts).reshape(len(times), joints),
            "law": law,
        }
        if self._internal[k]:
            rows["internal"] = np.array(self._internal[k])
        if self._joints[k]:
            measured, n = np.array(self._joints[k]), len(controller.joint_names)
            rows |= {"joints": measured[:, :n], "joint_velocity": measured[:, measured.shape[1] // 2 :][:, :n]}
        return ArmData(
            name,
            self.scenario.placed[name],
            tuple(controller.joint_names),
            flatten(controller),
            {channel: Channel(times, values) for channel, values in rows.items()},
            symbols,
            tuple(self._modes[k]),
        )

    def _parts(self, k: int) -> dict[str, Array]:
        ends = np.cumsum(list(_PARTS.values()))[:-1]
        return dict(zip(_PARTS, np.split(np.array(self._rows[k]), ends, axis=1), strict=True))

    def _law(self, k: int, parts: dict[str, Array]) -> tuple[tuple[str, ...], Array]:
        """Return the names of the symbols, and their values; (N, m)."""
        if self._whole:
            return tuple(self._symbol_names[k]), np.array(self._symbols[k])
        evaluated, columns = np.array(self._evaluated[k]), []
        for position, rotation in (("position", "rotation"), ("desired_position", "desired_rotation")):
            turned = parts[rotation].reshape(-1, 3, 3).copy()
            turned[~evaluated] = np.eye(3)  # the record of a cycle without the law holds no attitude
            columns.append(np.hstack([parts[position], Rotation.from_matrix(turned).as_rotvec()]))
        names = tuple(f"{name}_{axis}" for name in ("position", "desired", "e") for axis in AXES)
        return names, np.where(evaluated[:, None], np.hstack([*columns, parts["e"]]), np.nan)
