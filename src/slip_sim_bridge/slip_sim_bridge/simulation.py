"""N simulated arms with their slippery grasps on one object: clock, holding, effort limits and loss around a plant."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from slip_core.arms import prefix_of, shared
from slip_core.arrays import Array, readonly
from slip_core.errors import InputError
from slip_core.records import record
from slip_core.stamps import seconds_to_ns
from slip_core.types import JointSample, SlipSample, WrenchSample
from slip_sim_bridge.arm import EFFORT, Arm
from slip_sim_bridge.params import HOLD_STIFFNESS, WORLD, BridgeParams
from slip_sim_bridge.plant import DivergenceError
from slip_sim_bridge.plant.loose import LoosePlant
from slip_sim_bridge.plant.model import urdf_joints

if TYPE_CHECKING:  # what the plant that is not used compiles is not imported
    from slip_sim_bridge.plant.elastic import ElasticPlant
    from slip_sim_bridge.plant.rigid import RigidPlant


class Readings(NamedTuple):
    """The true samples of one arm at one stamp: joints, wrench h_ee and slip velocity on {ee} axes.

    grip: force of the gripper, sum over both pads [N]; truth: all numbers of the stamp by name, as `read_out` has them,
    read-only.
    """

    joint: JointSample
    wrench: WrenchSample
    slip: SlipSample
    grip: float
    truth: Any

    @property
    def seen(self) -> SlipSample:
        """The slip velocity of a sensor that observes the object: it includes the shear of the pads."""
        return SlipSample(self.slip.stamp_ns, self.slip.twist + self.truth.pad_yield)

    @property
    def displaced(self) -> SlipSample:
        """The slip displacement in the place of the velocity: translation and rotation vector [m, rad] {p}."""
        return SlipSample(self.slip.stamp_ns, self.truth.slip_displacement)


class Simulation:
    """Arms, one object and a slippery grasp of each, advanced one control period at a time.

    An arm holds its posture until its first effort arrives, whenever `step` gets None for it, and where its effort is
    not finite. An object that slides over the edge of a pad, or that a pad does not grip any more, has left this pad
    until `reset`; what no pad holds falls. A state that is no longer physical makes `step` raise `DivergenceError`
    until `reset`; the last good samples stay readable.

    Nothing here is random, and equal inputs give equal bits.

    Args:
        params: of each arm by its name; what describes the world (`WORLD`) is equal in all.
        urdfs: of each arm by its name, without a base.

    Raises:
        InputError: parameters and URDFs that do not fit.
    """

    def __init__(self, params: Mapping[str, BridgeParams], urdfs: Mapping[str, str]) -> None:
        shared(params, WORLD, "equal values: there is one world and one object")
        self.params = params
        self.names = tuple(params)
        self._held = make_plant(params, urdfs)
        self._loose = LoosePlant(params, urdfs)
        self.plant: RigidPlant | LoosePlant = self._held
        self.loss: tuple[int, str] | None = None
        """When the object left the first pad [ns], and how; None while all hold it."""
        self.arms = tuple(Arm(arm, urdf_joints(arm, urdfs[name])) for name, arm in params.items())
        self.notes = tuple(
            f"{prefix_of(name)}friction and damping of the URDF's joints are not simulated: use drive.coulomb, viscous"
            for name, arm in zip(params, self.arms, strict=True)
            if arm.joints.friction.any() or arm.joints.damping.any()
        )
        """What the simulation leaves out of its input, one line each."""
        self._drives: Array | None = None
        if any(arm.act_on_joints for arm in self.arms):
            self._drives = np.concatenate([arm.rows for arm in self.arms])
            ends = np.cumsum([len(arm.limits) for arm in self.arms])
            for arm, rows in zip(self.arms, np.split(self._drives, ends[:-1]), strict=True):
                arm.rows = rows
        self._period_ns = seconds_to_ns(self.arms[0].params.control_period_s)
        self._pushes, self._normal_forces = np.zeros((len(self.arms), 6)), np.zeros(len(self.arms))
        self.stamp_ns = 0
        """Simulated time [ns]; it never goes back, not even in a reset."""
        for index, arm in enumerate(self.arms):
            self.push(index, np.array(arm.params.push.wrench), np.array(arm.params.push.effort))
        self._diverged = False
        self._readings: list[Readings | None] = [None] * len(self.arms)
        """What was read of each arm at the present stamp."""
        self._start()

    def start_at(self, stamp_ns: int) -> None:
        """Set the clock before the first step; [ns], not below the present stamp.

        In real time stamps are those of the wall clock, as a driver's are.
        """
        if stamp_ns < self.stamp_ns:
            raise ValueError(f"the clock never goes back: {stamp_ns} ns is before {self.stamp_ns} ns")
        self.stamp_ns = self._started_ns = stamp_ns

    def set_grip_force(self, arm: int, force: float) -> None:
        """Command the gripper's normal force of the friction limit from the next step on; [N], sum over both pads.

        Raises:
            InputError: where it is negative or not finite.
        """
        self.arms[arm].gripper.command(force)

    def push(self, arm: int, wrench: Array, effort: Array) -> None:
        """Let a hand push object and joints from the next step on; (6,) [N, N m] {w}, (n,) or () [N m].

        The wrench acts where this arm grips the object. An object that is lost is pushed no more.
        """
        self._pushes[arm] = wrench
        self._held.push(self._pushes)
        self.arms[arm].pushed = effort if effort.any() else None

    def step(self, commands: Sequence[Array | None]) -> None:
        """Advance one control period under a command of each arm, as its `drive.interface` takes it; None holds it.

        Efforts (n,) [N m] are clipped to the URDF's limits and change no faster than `effort_rate`; velocities [rad/s]
        and positions [rad] to the joints' ranges and speeds, and followed by the drives' own loops within the effort
        limits.

        Raises:
            InputError: where an effort has the wrong size.
            DivergenceError: where the state stopped being physical, in this step or an earlier one.
        """
        if self._diverged:
            raise DivergenceError("simulation has diverged; reset it")
        joints, released, now = [], False, self.stamp_ns - self._started_ns
        for index, arm in enumerate(self.arms):
            command = commands[index]
            if command is not None and command.shape != arm.limits.shape:
                kind = arm.params.drive.interface
                raise InputError(kind, got=f"{command.size} numbers", expected=f"{arm.limits.size}, one per joint")
            posture = self._posture(index)
            effort = arm.take(command, posture)
            arm.coming = self._hold(index, arm) if effort is None else effort
            joints.append(arm.at_joints(arm.coming, posture))
            force = arm.gripper.step()
            if arm.has_lost or self._let_go(index, arm):
                force, released = 0.0, True
            # Friction is mu N in every law: less of mu is, for the pads, less of N.
            self._normal_forces[index] = force * arm.falls_to if now >= arm.falls_in_ns else force
        self._diverged = True  # until the step is over
        if released and self.plant is self._held and all(arm.has_lost for arm in self.arms):
            self._loose.take_over([self._held.read(index) for index in range(len(self.arms))])
            self.plant = self._loose
        efforts = joints[0] if len(joints) == 1 else np.concatenate(joints)
        self.plant.advance(efforts, self._normal_forces, self._drives)
        self._diverged = False
        for arm in self.arms:
            arm.applied = arm.coming if arm.takes_efforts else readonly(arm.rows[:, EFFORT].copy())
        self.stamp_ns += self._period_ns

    def reset(self) -> None:
        """Put arms, object, grips and friction back to the start; time continues by one control period."""
        self.plant, self.loss = self._held, None
        for arm in self.arms:
            arm.gripper.put(arm.params.grip.force)
        self._held.reset(np.array([arm.gripper.force for arm in self.arms]))
        self.stamp_ns += self._period_ns
        self._start()

    def observe(self, arm: int) -> Readings:
        """Return everything of one arm at the present stamp, without noise or delay; all samples share one array.

        h_ee of Eq. (1) is that of the step that just ended, v_s that of Eq. (14).
        """
        kept = self._readings[arm]
        if kept is not None and kept.joint.stamp_ns == self.stamp_ns:
            return kept
        stamp_ns, numbers = self.stamp_ns, self.plant.read(arm)
        numbers.setflags(write=False)
        read = record(numbers, self.arms[arm].layout)
        readings = self._readings[arm] = Readings(
            JointSample(stamp_ns, read.position, read.velocity, self.arms[arm].applied),
            WrenchSample(stamp_ns, read.wrench),
            SlipSample(stamp_ns, read.slip_velocity),
            self.arms[arm].gripper.force,
            read,
        )
        return readings

    def _hold(self, index: int, arm: Arm) -> Array:
        """Return the effort that holds the arm where it was when this began; (n,) [N m]."""
        if arm.posture is None:
            arm.posture = self._posture(index)
        damping = 2.0 * math.sqrt(HOLD_STIFFNESS)
        applied = arm.limited(self.plant.holding_effort(index, arm.posture, HOLD_STIFFNESS, damping))
        if applied is None:
            self._diverged = True
            raise DivergenceError("simulation diverged: no finite effort holds the arm; reset it")
        return applied

    def _let_go(self, index: int, arm: Arm) -> bool:
        """Let the object leave a pad that does not hold it any more; return whether it did."""
        (x, y), (end_x, end_y) = self._held.gripped_at(index), arm.edge
        if arm.gripper.force <= 0.0:
            how = "the grip is zero"
        elif abs(x) > end_x or abs(y) > end_y:
            how = f"it has slid over the pad's edge, {1e3 * math.hypot(x, y):.0f} mm from where it was gripped"
        else:
            return False
        arm.has_lost = True
        who = f"{self.names[index]}: " if self.names[index] else ""
        self.loss = self.loss or (self.stamp_ns, f"{who}the object is lost: {how}")
        return True

    def _posture(self, index: int) -> Array:
        return np.array(record(self.plant.read(index), self.arms[index].layout).position)

    def _start(self) -> None:
        self._started_ns = self.stamp_ns
        for index, arm in enumerate(self.arms):
            posture = self._posture(index)
            arm.start(posture, self.plant.holding_effort(index, posture, 0.0, 0.0))
        self._diverged = False


def make_plant(params: Mapping[str, BridgeParams], urdfs: Mapping[str, str]) -> RigidPlant | ElasticPlant:
    """Return the plant that `plant` names."""
    if next(iter(params.values())).plant == "elastic":
        from slip_sim_bridge.plant.elastic import ElasticPlant

        return ElasticPlant(params, urdfs)
    from slip_sim_bridge.plant.rigid import RigidPlant

    return RigidPlant(params, urdfs)
