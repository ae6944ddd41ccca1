"""What a bring-up hears: the messages of some time, by topic."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from slip_core.arrays import Array

BRIDGE: Final = "slip_sim_bridge"
"""Node of the simulated arm."""
SCALARS: Final = ("friction_limit", "load_commanded", "friction_events", "slipping")


class Status(NamedTuple):
    """The controller's mode by name, empty before there is one, and why it is in it, in words."""

    mode: str = ""
    text: str = ""

    def __str__(self) -> str:
        """Return both."""
        return f"{self.mode}: {self.text}" if self.mode else "no mode"


class Track(NamedTuple):
    """Samples of one topic: newest joint stamp when each arrived [s] (k,), own stamp [s] (k,), numbers (k, m)."""

    arrival: Array
    stamp: Array
    values: Array

    @property
    def rate(self) -> float:
        """Rate by stamps [Hz]; NaN with fewer than two. Gaps between recordings do not count."""
        steps = np.diff(np.unique(self.stamp))
        return 1.0 / float(steps[steps < 3.0 * np.median(steps)].mean()) if len(steps) else math.nan


class Heard(NamedTuple):
    """The messages of some time.

    joints: positions, then velocities (k, 2 n) [rad, rad/s]; wrench: as the driver gives it (k, 6) [N, N m];
    slip: twists (k, 6) [m/s, rad/s]; scalars: a column for each of `SCALARS`.
    """

    joints: Track
    wrench: Track
    slip: Track
    scalars: Track

    @property
    def position(self) -> Array:
        """Mean joint positions of the last tenth; (n,) [rad]."""
        q = self.joints.values[:, : self.joints.values.shape[1] // 2]
        return np.asarray(q[-max(1, len(q) // 10) :].mean(axis=0))


def joined(parts: Sequence[Heard]) -> Heard:
    """Return what was heard one after the other as one."""
    return Heard(*(Track(*map(np.concatenate, zip(*tracks, strict=True))) for tracks in zip(*parts, strict=True)))
