"""Physics backends behind one interface; `GraspSimulation` adds the clock, holding, clipping and refusal on top."""

from __future__ import annotations

import os
from typing import Protocol

import numpy as np

from slip_core.arrays import Array
from slip_core.errors import SlipVicError
from slip_core.records import REAL, layout

# No picture is drawn here. Without this, `import mujoco` looks for a window library in a process of its own.
os.environ.setdefault("MUJOCO_GL", "disable")

GRASP = layout(
    wrench=(REAL, 6),
    slip_displacement=(REAL, 6),
    slip_velocity=(REAL, 6),
    object_position=(REAL, 3),
    object_rotation=(REAL, (3, 3)),
    object_twist=(REAL, 6),
)
"""What can be read of the grasp at one stamp.

wrench h_ee of the object on the robot at the pad centre in the step that just ended [N, N m] {ee} (Eq. 1);
slip_displacement: pose of {ee} relative to {p} as (translation, rotation vector) [m, rad] {p};
slip_velocity v_s of the pad relative to the object's material under it [m/s, rad/s] {ee} (Eq. 14);
object_position of the centre of mass [m] {w}; object_rotation {o} to {w}; object_twist at the centre of mass {w}.
"""


class DivergenceError(SlipVicError):
    """The simulated state is no longer finite or physical; only a reset helps."""


class ReadOut:
    """Where the numbers of a plant's read-out lie: `GRASP`, then joint positions and velocities, in one array.

    Every attribute is a slice, named as the fields.
    """

    def __init__(self, joints: int) -> None:
        self.layout = layout(grasp=GRASP, position=(REAL, joints), velocity=(REAL, joints))
        self.size = self.layout.itemsize // 8
        self.position, self.velocity = self._slice("position"), self._slice("velocity")
        self.wrench, self.slip_displacement = self._slice("wrench"), self._slice("slip_displacement")
        self.slip_velocity, self.object_position = self._slice("slip_velocity"), self._slice("object_position")
        self.object_rotation, self.object_twist = self._slice("object_rotation"), self._slice("object_twist")

    def _slice(self, name: str) -> slice:
        fields: dict[str, tuple[np.dtype[np.void], int]] = {**(GRASP.fields or {}), **(self.layout.fields or {})}  # type: ignore[dict-item]
        dtype, offset = fields[name]
        return slice(offset // 8, (offset + dtype.itemsize) // 8)


class Plant(Protocol):
    """Arm, grasp and object in one backend; joint vectors are in the order of `joint_names`."""

    @property
    def effort_limit(self) -> Array:
        """Joint effort limits; (n,) [N m], inf where the URDF has none."""
        ...

    @property
    def gripped_at(self) -> tuple[float, float]:
        """Where the point of the object that was gripped is on the pad, along x and y of {ee} [m]."""
        ...

    def reset(self, normal_force: float) -> None:
        """Put everything back to the initial posture, at rest, object centred in the grasp; [N]."""
        ...

    def advance(self, effort: Array, normal_force: float) -> None:
        """Advance one control period under constant effort; (n,) [N m], sum of pad forces [N].

        Raises:
            DivergenceError: where the state stopped being physical.
        """
        ...

    def push(self, wrench: Array) -> None:
        """Let a hand push the object where it is gripped from now on; (6,) [N, N m] {w}, zeros: no more.

        Raises:
            InputError: where the backend cannot.
        """
        ...

    def holding_effort(self, target: Array, stiffness: float, damping: float) -> Array:
        """Return gravity and Coriolis compensation plus M (stiffness (target - q) - damping qd); (n,) -> (n,) [N m]."""
        ...

    def read(self) -> Array:
        """Return everything that can be read, as a fresh array laid out by `ReadOut`; (2 n + 36,)."""
        ...
