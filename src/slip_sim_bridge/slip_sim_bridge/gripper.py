"""The simulated gripper: its force follows what is commanded, with a lag of first order."""

from __future__ import annotations

import math

from slip_core.errors import InputError
from slip_core.params import range_of
from slip_sim_bridge.params import GripParams

LARGEST = range_of("N")[1]


class Gripper:
    """Force of the grip, sum over both pads [N]; without lag it is what is commanded, to the last bit.

    Args:
        params: of the grip.
        period_s: control period.
    """

    def __init__(self, params: GripParams, period_s: float) -> None:
        self._share = 1.0 - math.exp(-period_s / params.lag_s) if params.lag_s > 0.0 else 1.0
        self.put(params.force)

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
        self._commanded = float(force)

    def step(self) -> float:
        """Follow the command for one control period and return the force [N]."""
        if self.force != self._commanded:
            late = self._share < 1.0
            self.force = self.force + self._share * (self._commanded - self.force) if late else self._commanded
        return self.force
