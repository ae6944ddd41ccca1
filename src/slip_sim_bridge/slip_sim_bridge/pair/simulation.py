"""Two arms and their object between ticks: clock, holding, effort limits, sensors and samples, without ROS."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from slip_core.arrays import Array, readonly
from slip_core.errors import InputError
from slip_core.incidents import Incident
from slip_core.stamps import seconds_to_ns
from slip_core.types import EffortCommand, JointSample, ObjectTruth, SlipSample, WrenchSample
from slip_sim_bridge.pair.params import SIDES, PairParams
from slip_sim_bridge.plant import DivergenceError, ReadOut
from slip_sim_bridge.sensors.params import SensorsParams
from slip_sim_bridge.sensors.suite import SensorSuite
from slip_sim_bridge.session import ArmOutputs
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

    @property
    def arms(self) -> tuple[ArmOutputs, ...]:
        """What each arm measures."""
        each = zip(self.joints, self.wrenches, self.slips, self.readings, strict=True)
        return tuple(ArmOutputs(joint, (wrenches,), (slips,), truth) for joint, wrenches, slips, truth in each)

    @property
    def truth(self) -> ObjectTruth:
        """Ground truth of the object at this tick; slip is that of the left pad."""
        return self.readings[0].truth


class PairSimulation:
    """Two arms, one object, two elastic and slippery grasps, with the sensors of each side.

    An arm holds its posture until the first effort arrives, and whenever `step` gets None for it. Nothing here is
    random but the sensors' seeded noise, and equal inputs give equal bits.

    Args:
        params: of both sides.
        urdf_texts: of the arms, left and right.
    """

    def __init__(self, params: PairParams, urdf_texts: Sequence[str]) -> None:
        from slip_sim_bridge.plant.pair import PairPlant  # compiled here, so that one arm waits for nothing of two

        self.params = params
        self.plant = PairPlant(params, urdf_texts)
        self._at = [ReadOut(len(limit)) for limit in self.plant.effort_limits]
        self._period_ns = params.left.control_period_ns
        self._duration_ns = seconds_to_ns(params.left.duration_s)
        self._sensors = [
            SensorSuite(arm.model_copy(update={"seed": arm.seed + side})) for side, arm in enumerate(params.arms)
        ]
        self._counts = [0] * (2 * SIDE_COUNT)
        self._stamp_ns = self._start_ns = 0
        self.tick = 0
        self._diverged = self._reset_wanted = False
        self._lost: Incident | None = None
        self._start()

    def start_at(self, stamp_ns: int) -> None:
        """Let time begin at this stamp [ns]; before the first tick."""
        self._stamp_ns = self._start_ns = stamp_ns

    @property
    def elapsed_s(self) -> float:
        """Simulated time since the start [s]."""
        return (self._stamp_ns - self._start_ns) * 1e-9

    @property
    def stamp_ns(self) -> int:
        """Simulated time [ns]."""
        return self._stamp_ns

    @property
    def finished(self) -> bool:
        """Whether the run's duration is over."""
        over = self._stamp_ns - self._start_ns >= self._duration_ns
        return self.params.left.stop_after_duration and over

    @property
    def lost(self) -> Incident | None:
        """When and how the object left a pad; None while both hold it. The simulation goes on as if they did."""
        return self._lost

    def set_faults(self, side: int, sensors: SensorsParams) -> None:
        """Switch sensor faults of one side on and off from the next measurement on."""
        self._sensors[side].set_faults(sensors)

    def request_reset(self) -> None:
        """Put both arms and the object back before the next tick; time goes on."""
        self._reset_wanted = True

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
        if self._reset_wanted:
            self._reset()
        readings = tuple(self.truth(side) for side in range(SIDE_COUNT))
        joints, wrenches, slips = [], [], []
        for side, (sensors, truth) in enumerate(zip(self._sensors, readings, strict=True)):
            wrenches.append(tuple(sensors.wrench.update(truth.wrench)))
            slips.append(tuple(sensors.slip.update(truth.slip)))
            joints.append(sensors.joint.update(truth.joint))
            self._counts[2 * side] += len(wrenches[-1])
            self._counts[2 * side + 1] += len(slips[-1])
            self._look_at_contact(side, truth)
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

    def _reset(self) -> None:
        self.plant.reset()
        for sensors in self._sensors:
            sensors.reset()
        self._start()
        self._stamp_ns += self._period_ns

    def _start(self) -> None:
        """Forget what happened: both arms hold the posture of the start."""
        self._posture: list[Array | None] = [None] * SIDE_COUNT
        self._diverged = self._reset_wanted = False
        self._lost = None
        self._applied = [
            readonly(np.clip(self.plant.holding_effort(side, self._joints(side), 0.0, 0.0), -limit, limit))
            for side, limit in enumerate(self.plant.effort_limits)
        ]

    def _look_at_contact(self, side: int, truth: Readings) -> None:
        """Notice an object that has slid over the edge of a pad, or that a pad does not grip."""
        if self._lost is not None:
            return
        x, y = truth.numbers[truth.layout.slip_displacement][:2].tolist()
        edge_x, edge_y = (0.5 * size for size in self.params.arms[side].grip.pad_size[:2])
        if self.plant.grip[side] <= 0.0:
            how = "the grip is zero"
        elif abs(x) > edge_x or abs(y) > edge_y:
            how = f"it has slid over the pad's edge, {1e3 * math.hypot(x, y):.0f} mm from where it was gripped"
        else:
            return
        self._lost = Incident("lost", self.elapsed_s, f"{SIDES[side]}: the object is lost: {how}")

    def _joints(self, side: int) -> Array:
        return self.plant.read(side)[self._at[side].position]

    def _accepted(self, side: int, command: EffortCommand | None) -> Array | None:
        if command is None or not len(command.effort):
            return None
        age_ns = self._stamp_ns - command.stamp_ns
        return command.effort if 0 <= age_ns <= seconds_to_ns(self.params.arms[side].command_timeout_s) else None
