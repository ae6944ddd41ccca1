"""What a bring-up needs of a system that runs: over DDS, or in one process for tests."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

import numpy as np

from slip_core.arrays import Array
from slip_vic_controller.params import ControllerParams


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


class System(Protocol):
    """A controller with its drivers."""

    @property
    def params(self) -> ControllerParams:
        """Parameters of the controller."""
        ...

    @property
    def urdf(self) -> str:
        """The controller's arm."""
        ...

    @property
    def mode(self) -> str:
        """The newest text of `controller/mode`, "" before the first."""
        ...

    @property
    def goal(self) -> str:
        """The newest text of `controller/goal`, "" before the first."""
        ...

    def look(self) -> tuple[Endpoint, ...]:
        """Return how the inputs are found."""
        ...

    def listen(self, seconds: float) -> Heard:
        """Return what comes until the joint states' stamps are `seconds` later, or nothing comes any more."""
        ...

    def set_active(self, active: bool) -> None:
        """Activate or deactivate the controller; inactive it gives no effort."""
        ...

    def ask(self, request: str) -> None:
        """Call the controller's service "enable" or "hold"."""
        ...

    def tune(self, values: Mapping[str, Any]) -> None:
        """Set parameters of the controller."""
        ...

    def send_goal(self, position: Array, rotation: Array, duration_s: float) -> None:
        """Publish a goal; (3,) [m], (3, 3) {w}."""
        ...

    def tune_bridge(self, values: Mapping[str, Any]) -> None:
        """Set parameters of the simulated arm."""
        ...

    def reset_bridge(self) -> None:
        """Put the simulated arm and its object back to the start."""
        ...
