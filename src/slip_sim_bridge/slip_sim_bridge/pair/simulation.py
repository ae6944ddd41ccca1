"""Two arms and their object between ticks: clock, holding, effort limits, sensors and samples, without ROS."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from slip_core.arrays import Array, readonly
from slip_core.errors import InputError
from slip_core.stamps import seconds_to_ns
from slip_core.types import EffortCommand, JointSample, SlipSample, WrenchSample
from slip_sim_bridge.pair.params import PairParams
from slip_sim_bridge.plant import DivergenceError, ReadOut
from slip_sim_bridge.plant.pair import PairPlant
from slip_sim_bridge.sensors.suite import SensorSuite
from slip_sim_bridge.simulation import NOT_FINITE, Readings, drive

SIDE_COUNT = 2


class PairTick(NamedTuple):
    """What both sides measure at one tick, left first; wrenches and slips that are due now, oldest first.

    counts: of each side, wrench and slip samples published so far: what a lockstep controller waits for.
    readings: the truth of each side; pads: true positions [m] and attitudes of the pads {w}.
    """

    tick: int
    stamp_ns: int
    joints: tuple[JointSample, ...]
    wrenches: tuple[tuple[WrenchSample, ...], ...]
    slips: tuple[tuple[SlipSample, ...], ...]
    counts: tuple[int, ...]
    readings: tuple[Readings, ...]
    pads: tuple[tuple[Array, ...], tuple[Array, ...]]


class PairSimulation:
    """Two arms, one object, two elastic and slippery grasps, with the sensors of each side.

    An arm holds its posture until the first effort arrives, and whenever `step` gets None for it. Nothing here is
    random but the sensors' seeded noise, and equal inputs give equal bits.

    Args:
        params: of both sides.
        urdf_texts: of the arms, left and right.
    """

    def __init__(self, params: PairParams, urdf_texts: Sequence[str]) -> None:
        self.params = params
        self.plant = PairPlant(params, urdf_texts)
        self._at = [ReadOut(len(limit)) for limit in self.plant.effort_limits]
        self._period_ns = params.left.control_period_ns
        self._duration_ns = seconds_to_ns(params.left.duration_s)
        self._sensors = [
            SensorSuite(arm.model_copy(update={"seed": arm.seed + side})) for side, arm in enumerate(params.arms)
        ]
        self._counts = [0] * (2 * SIDE_COUNT)
        self._posture: list[Array | None] = [None] * SIDE_COUNT
        self._diverged = False
        self._stamp_ns = self._start_ns = 0
        self.tick = 0
        self._applied = [
            readonly(np.clip(self.plant.holding_effort(side, self._joints(side), 0.0, 0.0), -limit, limit))
            for side, limit in enumerate(self.plant.effort_limits)
        ]

    @property
    def stamp_ns(self) -> int:
        """Simulated time [ns]."""
        return self._stamp_ns

    @property
    def finished(self) -> bool:
        """Whether the run's duration is over."""
        return self._stamp_ns - self._start_ns >= self._duration_ns

    def set_grip_force(self, side: int, force: float) -> None:
        """Set the normal force of one grasp from the next step on [N]; 0 lets go.

        Raises:
            InputError: where it is negative or not finite.
        """
        if not math.isfinite(force) or force < 0.0:
            raise InputError("grip force", got=force, expected="a finite number >= 0")
        self.plant.grip[side] = force

    def observe(self) -> PairTick:
        """Measure everything at the present stamp; once per tick."""
        readings = tuple(self.truth(side) for side in range(SIDE_COUNT))
        joints, wrenches, slips = [], [], []
        for side, (sensors, truth) in enumerate(zip(self._sensors, readings, strict=True)):
            wrenches.append(tuple(sensors.wrench.update(truth.wrench)))
            slips.append(tuple(sensors.slip.update(truth.slip)))
            joints.append(sensors.joint.update(truth.joint))
            self._counts[2 * side] += len(wrenches[-1])
            self._counts[2 * side + 1] += len(slips[-1])
        return PairTick(
            self.tick, self._stamp_ns, tuple(joints), tuple(wrenches), tuple(slips), tuple(self._counts), readings,
            self.plant.pads,
        )  # fmt: skip

    def truth(self, side: int) -> Readings:
        """Return everything of one side at the present stamp, without noise or delay."""
        at, numbers = self._at[side], self.plant.read(side)
        numbers.setflags(write=False)
        return Readings(
            JointSample(self._stamp_ns, numbers[at.position], numbers[at.velocity], self._applied[side]),
            WrenchSample(self._stamp_ns, numbers[at.wrench]),
            SlipSample(self._stamp_ns, numbers[at.slip_velocity]),
            numbers,
            at,
        )

    def advance(self, commands: Sequence[EffortCommand | None]) -> None:
        """Apply a command of each side for one control period; None, an empty or an old one holds that arm.

        Raises:
            DivergenceError: where the state stopped being physical, in this step or an earlier one.
        """
        self.step([self._accepted(side, command) for side, command in enumerate(commands)])

    def step(self, efforts: Sequence[Array | None]) -> None:
        """Advance one control period under an effort of each side; (n,) [N m], None or not finite holds that arm.

        Raises:
            DivergenceError: as of `advance`.
        """
        if self._diverged:
            raise DivergenceError("simulation has diverged")
        self._diverged = True  # until the step is over
        applied = [self._drive(side, effort) for side, effort in enumerate(efforts)]
        self.plant.advance(applied)
        self._diverged = False
        self._applied = applied
        self._stamp_ns += self._period_ns
        self.tick += 1

    def _drive(self, side: int, effort: Array | None) -> Array:
        arm, limit = self.params.arms[side], self.plant.effort_limits[side]
        largest = arm.effort_rate * arm.control_period_s
        applied = np.empty(len(limit))
        if effort is not None and effort.shape != limit.shape:
            raise InputError("effort", got=f"{effort.size} numbers", expected=f"{limit.size}, one per joint")
        outcome = NOT_FINITE if effort is None else drive(effort, self._applied[side], largest, limit, applied)
        if outcome != NOT_FINITE:
            self._posture[side] = None
        else:
            if self._posture[side] is None:
                self._posture[side] = self._joints(side)
            hold = arm.hold
            posture = self._posture[side]
            assert posture is not None
            holding = self.plant.holding_effort(side, posture, hold.stiffness, hold.damping)
            if drive(holding, self._applied[side], largest, limit, applied) == NOT_FINITE:
                raise DivergenceError("simulation diverged: no finite effort holds the arm")
        applied.setflags(write=False)
        return applied

    def _joints(self, side: int) -> Array:
        return self.plant.read(side)[self._at[side].position]

    def _accepted(self, side: int, command: EffortCommand | None) -> Array | None:
        if command is None or not len(command.effort):
            return None
        age_ns = self._stamp_ns - command.stamp_ns
        return command.effort if 0 <= age_ns <= seconds_to_ns(self.params.arms[side].command_timeout_s) else None
