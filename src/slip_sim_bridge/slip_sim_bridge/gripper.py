"""The simulated gripper: its force follows what is commanded, in steps, over friction, and with a lag."""

from __future__ import annotations

import math

from slip_core.errors import InputError
from slip_core.params import range_of
from slip_sim_bridge.params import GripParams

LARGEST = range_of("N")[1]


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
