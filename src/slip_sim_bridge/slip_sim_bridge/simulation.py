"""The simulated arm with its slippery grasp: clock, holding, effort limits and samples around a physics backend."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slip_core.arrays import Array, readonly
from slip_core.compiled import IN1, INT, OUT1, REAL, kernel
from slip_core.errors import InputError
from slip_core.types import JointSample, ObjectTruth, SlipSample, WrenchSample
from slip_sim_bridge.gripper import Gripper
from slip_sim_bridge.params import BridgeParams
from slip_sim_bridge.plant import DivergenceError, Plant, ReadOut
from slip_sim_bridge.plant.loose import LoosePlant

OBEYED, CLIPPED, NOT_FINITE = 0, 1, 2


class Readings(NamedTuple):
    """The true samples of one stamp: joints, wrench h_ee and slip velocity on {ee} axes; the object when asked for.

    numbers, layout: all numbers of the stamp in one read-only array, and where they lie in it.
    """

    joint: JointSample
    wrench: WrenchSample
    slip: SlipSample
    numbers: Array
    layout: ReadOut

    @property
    def truth(self) -> ObjectTruth:
        """Pose and twist of the object and the slip; made when asked for, as a controller does not wait for it."""
        numbers, at = self.numbers, self.layout
        return ObjectTruth(
            self.slip.stamp_ns,
            numbers[at.object_position],
            numbers[at.object_rotation].reshape(3, 3),
            numbers[at.object_twist],
            numbers[at.slip_displacement],
            self.slip.twist,
        )


class Loss(NamedTuple):
    """When the object left the pads [ns], and how."""

    stamp_ns: int
    text: str


class GraspSimulation:
    """One arm, one object, one slippery grasp, advanced one control period at a time.

    An object that slides over the edge of a pad, or that nothing grips any more, is lost until `reset`: it falls.

    The arm holds its posture until the first effort arrives and whenever `step` gets None. An effort that is not
    finite is refused: the arm holds, and `command_refused` says so. A state that is no longer physical makes `step`
    raise `DivergenceError` until `reset`; the last good samples stay readable.

    Nothing here is random, and equal inputs give equal bits.
    """

    def __init__(self, params: BridgeParams, urdf_text: str) -> None:
        self.params = params
        self._grasping = make_plant(params, urdf_text)
        self._empty = LoosePlant(params, urdf_text)
        self.plant: Plant | LoosePlant = self._grasping
        self.loss: Loss | None = None
        """When and how the object was lost; None while it is held."""
        self._edge = 0.5 * params.grip.pad_size[0], 0.5 * params.grip.pad_size[1]
        self._limit = self._grasping.effort_limit
        self._at = ReadOut(len(self._limit))
        self._period_ns = params.control_period_ns
        self._gripper = Gripper(params.grip, params.control_period_s)
        self._falls_in_ns = round(1e9 * params.friction.falls_at_s)
        self._stamp_ns = 0
        self._leaning: Array | None = None
        self.push(np.array(params.push.wrench), np.array(params.push.effort))
        self._hold_posture: Array | None = None
        self._applied = np.zeros_like(self._limit)
        self._refused = self._saturated = self._diverged = False
        self._start()

    @property
    def stamp_ns(self) -> int:
        """Simulated time [ns]; it never goes back, not even in a reset."""
        return self._stamp_ns

    def start_at(self, stamp_ns: int) -> None:
        """Set the clock before the first step; [ns], not below the present stamp.

        In real time stamps are those of the wall clock, as a driver's are.
        """
        if stamp_ns < self._stamp_ns:
            raise ValueError(f"the clock never goes back: {stamp_ns} ns is before {self._stamp_ns} ns")
        self._stamp_ns = self._started_ns = stamp_ns

    @property
    def holding(self) -> bool:
        """True where the last step held the arm instead of obeying an effort."""
        return self._hold_posture is not None

    @property
    def command_refused(self) -> bool:
        """True where the last effort was not finite."""
        return self._refused

    @property
    def effort_saturated(self) -> bool:
        """True where the last effort was clipped to the limits."""
        return self._saturated

    @property
    def grip_force(self) -> float:
        """Normal force of the friction limit, summed over both pads [N]."""
        return self._gripper.force

    def set_grip_force(self, force: float) -> None:
        """Ask the gripper for a normal force of the friction limit from the next step on; [N], sum over both pads.

        Raises:
            InputError: where it is negative or not finite.
        """
        self._gripper.command(force)

    def push(self, wrench: Array, effort: Array) -> None:
        """Let a hand lean on object and joints from the next step on; (6,) [N, N m] {w}, (n,) or () [N m].

        It leans on what it finds: an object that is lost is pushed no more.
        """
        self._grasping.push(wrench)
        self._leaning = effort if effort.any() else None

    def step(self, effort: Array | None, largest_change: float | None = None) -> None:
        """Advance one control period under `effort`; (n,) [N m], clipped to the URDF's limits; None holds the arm.

        `largest_change` [N m] bounds how far the applied effort may be from the last one.

        Raises:
            InputError: where the effort has the wrong size.
            DivergenceError: where the state stopped being physical, in this step or an earlier one.
        """
        if self._diverged:
            raise DivergenceError("simulation has diverged; reset it")
        if effort is not None and effort.shape != self._limit.shape:
            raise InputError("effort", got=f"{effort.size} numbers", expected=f"{self._limit.size}, one per joint")
        bound = math.inf if largest_change is None else largest_change
        applied = np.empty(len(self._limit))
        outcome = NOT_FINITE if effort is None else drive(effort, self._applied, bound, self._limit, applied)
        self._refused = effort is not None and outcome == NOT_FINITE
        if outcome != NOT_FINITE:
            self._hold_posture = None
        else:
            if self._hold_posture is None:
                self._hold_posture = self._posture()
            hold = self.params.hold
            holding = self.plant.holding_effort(self._hold_posture, hold.stiffness, hold.damping)
            outcome = drive(holding, self._applied, bound, self._limit, applied)
        self._diverged = True  # until the step is over
        if outcome == NOT_FINITE:
            raise DivergenceError("simulation diverged: no finite effort holds the arm; reset it")
        self._saturated = outcome == CLIPPED
        applied.setflags(write=False)
        self._gripper.step()
        if self.loss is None:
            self._look_at_contact()
        # Friction is mu N in every law: less of mu is, for the pads, less of N.
        fallen = self._stamp_ns - self._started_ns >= self._falls_in_ns
        normal = self._gripper.force * self.params.friction.falls_to if fallen else self._gripper.force
        self.plant.advance(applied if self._leaning is None else applied + self._leaning, normal)
        self._diverged = False
        self._applied = applied
        self._stamp_ns += self._period_ns

    def reset(self) -> None:
        """Put arm, object, grip and friction back to the start; time goes on by one control period."""
        self.plant, self.loss = self._grasping, None
        self._grasping.reset(self.params.grip.force)
        self._gripper.put(self.params.grip.force)
        self._stamp_ns += self._period_ns
        self._start()

    def observe(self) -> Readings:
        """Return everything at the present stamp, without noise or delay; all samples share one array.

        h_ee of Eq. (1) is that of the step that just ended, v_s that of Eq. (14).
        """
        stamp_ns, at, numbers = self._stamp_ns, self._at, self.plant.read()
        numbers.setflags(write=False)
        return Readings(
            JointSample(stamp_ns, numbers[at.position], numbers[at.velocity], self._applied),
            WrenchSample(stamp_ns, numbers[at.wrench]),
            SlipSample(stamp_ns, numbers[at.slip_velocity]),
            numbers,
            at,
        )

    def _look_at_contact(self) -> None:
        """Let the object fall where nothing holds it any more."""
        x, y = self._grasping.gripped_at
        if self._gripper.force <= 0.0:
            how = "the grip is zero"
        elif abs(x) > self._edge[0] or abs(y) > self._edge[1]:
            how = f"it has slid over the pad's edge, {1e3 * math.hypot(x, y):.0f} mm from where it was gripped"
        else:
            return
        self.loss = Loss(self._stamp_ns, f"the object is lost: {how}")
        self._empty.take_over(self._grasping.read())
        self.plant = self._empty

    def _posture(self) -> Array:
        return self.plant.read()[self._at.position]

    def _start(self) -> None:
        self._started_ns = self._stamp_ns
        self._hold_posture = self._posture()
        holding = self.plant.holding_effort(self._hold_posture, 0.0, 0.0)
        self._applied = readonly(np.clip(holding, -self._limit, self._limit))
        self._refused = self._saturated = self._diverged = False


@kernel(INT(IN1, IN1, REAL, IN1, OUT1))
def drive(wanted: Array, last: Array, largest_change: float, limit: Array, out: Array) -> int:
    """Write the effort that the drives apply to `out`; return `OBEYED`, `CLIPPED` by the limits, or `NOT_FINITE`.

    wanted, last, limit, out (n,) [N m]; largest_change [N m] from the last effort to this one, inf where unbounded.

    A drive follows at most `largest_change` from its last effort to this one.
    """
    outcome = OBEYED
    for i in range(len(wanted)):
        effort = wanted[i]
        if not math.isfinite(effort):
            return NOT_FINITE
        effort = min(max(effort, last[i] - largest_change), last[i] + largest_change)
        out[i] = min(max(effort, -limit[i]), limit[i])
        if out[i] != effort:
            outcome = CLIPPED
    return outcome


def make_plant(params: BridgeParams, urdf_text: str) -> Plant:
    """Return the backend that `params.backend` names."""
    if params.backend == "native":
        from slip_sim_bridge.plant.native import NativePlant

        return NativePlant(params, urdf_text)
    from slip_sim_bridge.plant.implicit import ImplicitPlant

    return ImplicitPlant(params, urdf_text)
