"""One simulated arm: drives between a command and the joints, and a gripper whose force follows its command."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from slip_core.arrays import Array, readonly
from slip_core.errors import InputError
from slip_core.params import range_of
from slip_core.records import records
from slip_core.stamps import seconds_to_ns
from slip_sim_bridge.params import BridgeParams, GripParams
from slip_sim_bridge.plant import read_out
from slip_sim_bridge.plant.joint_step import FRICTION, JOINT_DRIVE, JOINT_DRIVE_SIZE, POSITION, TORQUE, VELOCITY
from slip_sim_bridge.plant.model import UrdfJoints

_NAMES = JOINT_DRIVE.names or ()
COMMAND, EFFORT = _NAMES.index("command"), _NAMES.index("effort")
MODES = {"effort": FRICTION, "velocity": VELOCITY, "position": POSITION}
RIPPLE_CYCLES = 6.0
"""Of the ripple per turn of the joint."""
LARGEST = range_of("N")[1]
"""Of a grip force [N]."""


class Gripper:
    """Force of the grip, sum over both pads [N]; of an ideal gripper it is what is commanded, to the last bit.

    The command is rounded to the gripper's steps, and is at least its least force. Friction of the fingers is a play:
    the force stays while the command is within the hysteresis of it.

    Args:
        params: of the grip.
        period_s: control period.
    """

    def __init__(self, params: GripParams, period_s: float) -> None:
        self._share = 1.0 - math.exp(-period_s / params.lag_s) if params.lag_s > 0.0 else 1.0
        self._params = params
        self.put(max(params.force, params.least_force))

    def put(self, force: float) -> None:
        """Let it hold with a force, at once [N]."""
        self.force = self._commanded = force

    def command(self, force: float) -> None:
        """Ask for a force [N].

        Raises:
            InputError: where it is negative, beyond what a parameter may have, or not finite.
        """
        if not 0.0 <= force <= LARGEST:
            raise InputError("grip force", got=force, expected=f"a number from 0 to {LARGEST:g} N")
        quantum = self._params.quantum
        rounded = round(force / quantum) * quantum if quantum > 0.0 else float(force)
        self._commanded = max(rounded, self._params.least_force)

    def step(self) -> float:
        """Follow the command for one control period and return the force [N]."""
        play = self._params.hysteresis
        wanted = min(max(self.force, self._commanded - play), self._commanded + play)
        if self.force != wanted:
            self.force = self.force + self._share * (wanted - self.force) if self._share < 1.0 else wanted
        return self.force


class Arm:
    """What the simulation keeps of one arm: its drives between a command and the joints, its gripper, what it holds.

    Drives delay a command by whole control periods, let the effort lag, and change it by gain, offset and ripple.

    Args:
        params: of this arm.
        joints: of its URDF, to whose limits its drives keep.
    """

    def __init__(self, params: BridgeParams, joints: UrdfJoints) -> None:
        self.params, self.joints, self.limits = params, joints, joints.effort
        drive, period_s, n = params.drive, params.control_period_s, len(self.limits)
        self.layout = read_out(n)
        coulomb, viscous, self._offset = (
            np.array(drive.of_joints(name, n)) for name in ("coulomb", "viscous", "offset")
        )
        self.takes_efforts, self._takes_positions = drive.interface == "effort", drive.interface == "position"
        self._delay = round(drive.delay_s / period_s)
        self._share = 1.0 - math.exp(-period_s / drive.lag_s) if drive.lag_s > 0.0 else 1.0
        self.act_on_joints = bool(coulomb.any() or viscous.any() or not self.takes_efforts)
        """Whether anything but the effort acts on the joints."""
        self.rows = np.zeros((n, JOINT_DRIVE_SIZE))
        """A JOINT_DRIVE per joint."""
        for i, joint in enumerate(records(self.rows, JOINT_DRIVE)):
            joint.mode, joint.bandwidth, joint.limit = MODES[drive.interface], drive.bandwidth, self.limits[i]
            joint.coulomb, joint.viscous = coulomb[i], viscous[i]
        self._under_way: deque[Array | None] = deque()
        self.gripper = Gripper(params.grip, period_s)
        self.largest_change = params.effort_rate * period_s
        self.edge = 0.5 * params.grip.pad_size[0], 0.5 * params.grip.pad_size[1]
        self.falls_in_ns, self.falls_to = seconds_to_ns(params.friction.falls_at_s), params.friction.falls_to
        self.pushed: Array | None = None
        """Effort of a hand on the joints."""
        self.posture: Array | None = None
        """What the arm holds; None where it obeys."""
        self.applied = self.coming = np.zeros_like(self.limits)
        """Efforts of the drives in the step that just ended, and in that which is being made."""
        self.has_lost = False

    def start(self, posture: Array, holding: Array) -> None:
        """Hold a posture with the effort that holds it, and forget commands under way; (n,) [rad], [N m]."""
        self.posture = posture
        self.applied = readonly(np.clip(holding, -self.limits, self.limits))
        self._under_way = deque([None] * self._delay)
        self.rows[:, TORQUE] = self.rows[:, EFFORT] = 0.0
        self.has_lost = False

    def take(self, command: Array | None, posture: Array) -> Array | None:
        """Take the command of this period and return what the drives apply, (n,) [N m]; None: the arm is to be held.

        Drives with loops of their own follow what arrives, or rest, and have no effort; posture (n,) [rad].
        """
        if self._delay:
            self._under_way.append(command)
            command = self._under_way.popleft()
        if not self.takes_efforts:
            if command is not None and np.isfinite(command).all():
                self.posture = None
                self.rows[:, COMMAND] = self.followable(command, posture)
            else:
                self.posture = posture if self.posture is None else self.posture
                self.rows[:, COMMAND] = self.posture if self._takes_positions else 0.0
            return np.zeros_like(self.limits)
        if command is None:
            return None
        lagging = command if self._share == 1.0 else self.applied + self._share * (command - self.applied)
        applied = self.limited(lagging)
        if applied is not None:
            self.posture = None
        return applied

    def followable(self, command: Array, posture: Array) -> Array:
        """Return what drives with loops of their own follow of a command: inside the joints' ranges and speeds; (n,).

        A position [rad] leads the joint by no more than its speed makes good. A velocity [rad/s] shrinks ahead of the
        range's end, by a quarter of the loop's bandwidth for each radian, so that the joint does not overshoot.
        """
        lower, upper, speed = self.joints.lower, self.joints.upper, self.joints.speed
        bandwidth = self.params.drive.bandwidth
        if self._takes_positions:
            period = self.params.control_period_s
            lead = speed * period / -math.expm1(-bandwidth * period)
            return np.clip(np.clip(command, lower, upper), posture - lead, posture + lead)
        down, up = np.maximum(posture - lower, 0.0), np.maximum(upper - posture, 0.0)
        rate = 0.25 * bandwidth
        return np.clip(command, -np.minimum(rate * down, speed), np.minimum(rate * up, speed))

    def at_joints(self, effort: Array, posture: Array) -> Array:
        """Return what an effort of the drives, and a hand, are at the joints; (n,) [N m], posture (n,) [rad]."""
        drive = self.params.drive
        torque = drive.gain * effort + self._offset
        if drive.ripple > 0.0:
            torque = torque + drive.ripple * np.sin(RIPPLE_CYCLES * posture)
        return torque if self.pushed is None else torque + self.pushed

    def limited(self, effort: Array) -> Array | None:
        """Return an effort within the limits of effort and of its change; None where it is not finite. (n,) [N m]."""
        if not np.isfinite(effort).all():
            return None
        followed = np.clip(effort, self.applied - self.largest_change, self.applied + self.largest_change)
        return readonly(np.clip(followed, -self.limits, self.limits))
