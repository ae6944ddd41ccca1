"""The simulated arm with its slippery grasp: clock, holding, effort limits and samples around a physics backend."""

from __future__ import annotations

import math

import numpy as np

from slip_msgs_py.arrays import Array
from slip_msgs_py.errors import InputError
from slip_msgs_py.types import JointSample, ObjectTruth, SlipSample, WrenchSample
from slip_sim_bridge.sim.implicit import ImplicitPlant
from slip_sim_bridge.sim.params import BridgeParams
from slip_sim_bridge.sim.plant import DivergenceError, Plant


class GraspSimulation:
    """One arm, one object, one slippery grasp, advanced one control period at a time.

    The arm holds its posture until the first effort arrives and whenever `step` gets None. An effort that is not
    finite is refused: the arm holds, and `command_refused` says so. A state that is no longer physical makes `step`
    raise `DivergenceError` until `reset`; the last good samples stay readable.

    Nothing here is random, and equal inputs give equal bits.
    """

    def __init__(self, params: BridgeParams, urdf_text: str) -> None:
        self.params = params
        self._plant: Plant = _plant(params, urdf_text)
        self._limit = self._plant.effort_limit
        self._lower_limit = -self._limit
        self._period_ns = params.control_period_ns
        self._grip = params.grip.force
        self._stamp_ns = 0
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

        Implements: ours: in real time stamps are those of the wall clock, as a driver's are.
        """
        if stamp_ns < self._stamp_ns:
            raise ValueError(f"the clock never goes back: {stamp_ns} ns is before {self._stamp_ns} ns")
        self._stamp_ns = stamp_ns

    @property
    def plant(self) -> Plant:
        """The physics backend."""
        return self._plant

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
        return self._grip

    def set_grip_force(self, force: float) -> None:
        """Set the normal force of the friction limit from the next step on; [N], sum over both pads.

        Raises:
            InputError: where it is negative or not finite.

        Implements: ours: the grip force is an input.
        """
        if not math.isfinite(force) or force < 0.0:
            raise InputError("grip force", got=force, expected="a finite number >= 0")
        self._grip = float(force)

    def step(self, effort: Array | None, largest_change: float | None = None) -> None:
        """Advance one control period under `effort`; (n,) [N m], clipped to the URDF's limits; None holds the arm.

        `largest_change` [N m] bounds how far the applied effort may be from the last one.

        Raises:
            InputError: where the effort has the wrong size.
            DivergenceError: where the state stopped being physical, in this step or an earlier one.

        Implements: ours: zero-order hold of the effort over one control period.
        """
        if self._diverged:
            raise DivergenceError("simulation has diverged; reset it")
        wanted = self._accept(effort)
        if wanted is None:
            if self._hold_posture is None:
                self._hold_posture = self._plant.joint_position()
            hold = self.params.hold
            wanted = self._plant.holding_effort(self._hold_posture, hold.stiffness, hold.damping)
        else:
            self._hold_posture = None
        if largest_change is not None:
            wanted = np.minimum(np.maximum(wanted, self._applied - largest_change), self._applied + largest_change)
        applied = _own(np.minimum(np.maximum(wanted, self._lower_limit), self._limit))
        self._saturated = applied.tolist() != wanted.tolist()
        try:
            self._plant.advance(applied, self._grip)
        except DivergenceError:
            self._diverged = True
            raise
        self._applied = applied
        self._stamp_ns += self._period_ns

    def reset(self) -> None:
        """Put arm, object, grip and friction back to the start; time goes on by one control period.

        Implements: ours: monotonic time over resets.
        """
        self._plant.reset(self.params.grip.force)
        self._grip = self.params.grip.force
        self._stamp_ns += self._period_ns
        self._start()

    def joint_sample(self) -> JointSample:
        """Return joint positions, velocities and the applied effort at the present stamp.

        Implements: ours: state read-out.
        """
        plant = self._plant
        return JointSample(self._stamp_ns, _own(plant.joint_position()), _own(plant.joint_velocity()), self._applied)

    def true_wrench(self) -> WrenchSample:
        """Return h_ee in the step that ended at the present stamp, without noise or delay; {ee} axes.

        Implements: h_ee of Eq. (1).
        """
        return WrenchSample(self._stamp_ns, _own(self._plant.wrench()))

    def true_slip(self) -> SlipSample:
        """Return v_s at the present stamp, without noise or delay; {ee} axes.

        Implements: v_s of Eq. (14).
        """
        return SlipSample(self._stamp_ns, _own(self._plant.slip_velocity()))

    def truth(self) -> ObjectTruth:
        """Return pose and twist of the object and the slip at the present stamp.

        Implements: ours: ground truth of the simulation.
        """
        plant = self._plant
        position, rotation = plant.object_pose()
        return ObjectTruth(
            stamp_ns=self._stamp_ns,
            position=_own(position),
            rotation=_own(rotation),
            twist=_own(plant.object_twist()),
            slip_displacement=_own(plant.slip_displacement()),
            slip_velocity=_own(plant.slip_velocity()),
        )

    def _start(self) -> None:
        self._hold_posture = self._plant.joint_position()
        self._applied = np.clip(
            self._plant.holding_effort(self._hold_posture, 0.0, 0.0), self._lower_limit, self._limit
        )
        self._refused = self._saturated = self._diverged = False

    def _accept(self, effort: Array | None) -> Array | None:
        self._refused = False
        if effort is None:
            return None
        if effort.shape != self._limit.shape:
            raise InputError("effort", got=f"{effort.size} numbers", expected=f"{self._limit.size}, one per joint")
        if not all(map(math.isfinite, effort.tolist())):
            self._refused = True
            return None
        return effort


def _own(fresh: Array) -> Array:
    """Make an array that nobody else holds read-only, which spares the sample its copy."""
    fresh.flags.writeable = False
    return fresh


def _plant(params: BridgeParams, urdf_text: str) -> Plant:
    if params.backend == "implicit":
        return ImplicitPlant(params, urdf_text)
    from slip_sim_bridge.sim.native import NativePlant

    return NativePlant(params, urdf_text)
