"""What a run in this process was, tick by tick, as arrays: what it is judged by, drawn from and looked at."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from slip_core.arrays import Array
from slip_core.records import place
from slip_sim_bridge.internal import internal_wrenches
from slip_vic.run.in_process import Tick
from slip_vic.run.series import AXES, RunSeries
from slip_vic.scenarios.scenario import Scenario
from slip_vic_controller.safety.modes import Mode
from slip_vic_controller.state import INPUTS, OUTPUTS

SIX = tuple(f"_{axis}" for axis in AXES)
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

    def series(self) -> tuple[RunSeries, ...]:
        """Return the run of each arm as arrays."""
        return tuple(self._series(k) for k in range(len(self.arms)))

    def joints(self, arm: int) -> Array:
        """Return position and velocity of the joints of an arm; (N, 2 n) [rad, rad/s]."""
        return np.array(self._joints[arm])

    def _series(self, k: int) -> RunSeries:
        rows, places = np.array(self._rows[k]), {}
        at = 0
        for name, width in _PARTS.items():
            places[name] = rows[:, at : at + width]
            at += width
        evaluated = np.array(self._evaluated[k])
        times = np.array(self._times)
        law = self._law(k, places, evaluated)
        position, rotation = places["object_position"], places["object_rotation"].reshape(-1, 3, 3)
        joints = max((len(effort) for effort in self._efforts[k]), default=0)
        efforts = [effort if len(effort) == joints else np.full(joints, np.nan) for effort in self._efforts[k]]
        return RunSeries(
            time=times - times[0],
            slip_displacement=places["slip"],
            slip_velocity=places["slip_velocity"],
            effort=np.array(efforts).reshape(len(times), joints),
            law_time=times - times[0],
            law=law,
            arm=self.arms[k],
            wrench=places["wrench"],
            object_position=position,
            object_rotation=rotation,
            internal=np.array(self._internal[k]),
        )

    def _law(self, k: int, places: dict[str, Array], evaluated: NDArray[np.bool_]) -> dict[str, Array]:
        if self._whole:
            return dict(zip(self._symbol_names[k], np.array(self._symbols[k]).T.copy(), strict=True))
        law: dict[str, Array] = {}
        for name, pose in (("position", "position"), ("desired", "desired_position")):
            turned = places["rotation" if name == "position" else "desired_rotation"].reshape(-1, 3, 3).copy()
            turned[~evaluated] = np.eye(3)  # the record of a cycle without the law holds no attitude
            six = np.hstack([places[pose], Rotation.from_matrix(turned).as_rotvec()])
            law |= _columns(name, np.where(evaluated[:, None], six, np.nan))
        return law | _columns("e", np.where(evaluated[:, None], places["e"], np.nan))


def _columns(name: str, six: Array) -> dict[str, Array]:
    return {f"{name}{end}": six[:, j] for j, end in enumerate(SIX)}
