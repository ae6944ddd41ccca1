"""The drives of one arm: what becomes of a command before it reaches the joints."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from slip_core.arrays import Array
from slip_core.records import Records, records
from slip_sim_bridge.drives.params import DriveParams
from slip_sim_bridge.plant.joint_step import (
    FRICTION,
    JOINT_DRIVE,
    JOINT_DRIVE_SIZE,
    POSITION,
    TORQUE,
    VELOCITY,
    JointDrive,
)

_NAMES = JOINT_DRIVE.names or ()
COMMAND, EFFORT = _NAMES.index("command"), _NAMES.index("effort")
MODES = {"effort": FRICTION, "velocity": VELOCITY, "position": POSITION}


RIPPLE_CYCLES = 6.0
"""Of the ripple per turn of the joint."""


class Drives:
    """Delays a command by whole control periods, lets the effort lag, and adds what drives add to it.

    Args:
        params: of the drives.
        limits: of the joint efforts; (n,) [N m].
        period_s: control period.
    """

    def __init__(self, params: DriveParams, limits: Array, period_s: float) -> None:
        n = len(limits)
        coulomb, viscous, self._offset = (
            np.array(params.of_joints(name, n)) for name in ("coulomb", "viscous", "offset")
        )
        self.takes_efforts, self.takes_positions = params.interface == "effort", params.interface == "position"
        self._params, self._delay = params, round(params.delay_s / period_s)
        self._share = 1.0 - math.exp(-period_s / params.lag_s) if params.lag_s > 0.0 else 1.0
        self.act_on_joints = bool(coulomb.any() or viscous.any() or not self.takes_efforts)
        """Whether anything but the effort acts on the joints."""
        self.rows = np.zeros((n, JOINT_DRIVE_SIZE))
        """A JOINT_DRIVE per joint."""
        joints: Records[JointDrive] = records(self.rows, JOINT_DRIVE)
        for i, joint in enumerate(joints):
            joint.mode, joint.bandwidth, joint.limit = MODES[params.interface], params.bandwidth, limits[i]
            joint.coulomb, joint.viscous = coulomb[i], viscous[i]
        self.reset()

    def reset(self) -> None:
        """Forget the commands that are under way."""
        self._under_way: deque[Array | None] = deque([None] * self._delay)
        self.rows[:, TORQUE] = self.rows[:, EFFORT] = 0.0

    def arriving(self, command: Array | None) -> Array | None:
        """Take the command of this period and return that which takes effect in it."""
        if not self._delay:
            return command
        self._under_way.append(command)
        return self._under_way.popleft()

    def lagging(self, effort: Array, last: Array) -> Array:
        """Return the effort a period later on its way from the last one to that of the command; (n,) [N m]."""
        return effort if self._share == 1.0 else last + self._share * (effort - last)

    def at_joints(self, effort: Array, position: Array) -> Array:
        """Return what an effort of the drives is at the joints; (n,) [N m], position (n,) [rad]."""
        params = self._params
        torque = params.gain * effort + self._offset
        return torque + params.ripple * np.sin(RIPPLE_CYCLES * position) if params.ripple > 0.0 else torque

    def follow(self, command: Array) -> None:
        """Set velocities [rad/s] or positions [rad] that the drives' own loops follow; (n,)."""
        self.rows[:, COMMAND] = command

    @property
    def efforts(self) -> Array:
        """Efforts of drives with loops of their own in the step that just ended; (n,) [N m]."""
        return self.rows[:, EFFORT].copy()
