"""What is found and heard of the inputs of a controller that runs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from slip_core.arrays import Array


class Endpoint(NamedTuple):
    """One input of the controller as it is found: who publishes it, and what a first message says of itself.

    topic: its full name; publishers: how many; kinds: their types; wanted: the type that is wanted; frame: of the
    first message, wanted_frame: "" where any will do; names: of the joints in it.
    """

    topic: str
    publishers: int
    kinds: tuple[str, ...]
    wanted: str
    frame: str = ""
    wanted_frame: str = ""
    names: tuple[str, ...] = ()


class Track(NamedTuple):
    """Samples of one topic: newest joint stamp when each arrived [s] (k,), own stamp [s] (k,), numbers (k, m)."""

    arrival: Array
    stamp: Array
    values: Array


class Heard(NamedTuple):
    """What was heard for a time.

    joints: positions, then velocities (k, 2 n) [rad, rad/s]; wrench: as the driver gives it (k, 6) [N, N m];
    slip: twists (k, 6) [m/s, rad/s], poses (k, 7) [m] or flags (k, m), as `slip_input` says; scalars: by name (k,).
    """

    joints: Track
    wrench: Track
    slip: Track
    scalars: Mapping[str, Array]

    @property
    def position(self) -> Array:
        """Mean joint positions of the last tenth of what was heard; (n,) [rad]."""
        q = self.joints.values[:, : self.joints.values.shape[1] // 2]
        return np.asarray(q[-max(1, len(q) // 10) :].mean(axis=0))
