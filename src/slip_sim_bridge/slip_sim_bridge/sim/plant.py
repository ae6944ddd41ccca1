"""What a physics backend offers; `GraspSimulation` adds the clock, holding, clipping and refusal on top."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from slip_core.arrays import Array
from slip_core.errors import SlipVicError


class DivergenceError(SlipVicError):
    """The simulated state is no longer finite or physical; only a reset helps."""


class Record:
    """Where the numbers of a plant's read-out lie in one array of 2 n + 36: a tick makes one array, not eight.

    position, velocity (n,), wrench, slip_displacement, slip_velocity (6,), object_position (3,), object_rotation (9,)
    by rows, object_twist (6,); units and frames as the methods of `Plant` say.
    """

    def __init__(self, joints: int) -> None:
        ends = np.cumsum([joints, joints, 6, 6, 6, 3, 9, 6]).tolist()
        parts = [slice(start, end) for start, end in zip([0, *ends], ends, strict=False)]
        self.size = ends[-1]
        self.position, self.velocity, self.wrench, self.slip_displacement, self.slip_velocity, *pose = parts
        self.object_position, self.object_rotation, self.object_twist = pose


class Plant(Protocol):
    """Arm, grasp and object in one backend. Arrays returned are fresh copies in the order of `joint_names`."""

    @property
    def effort_limit(self) -> Array:
        """Joint effort limits; (n,) [N m], inf where the URDF has none."""
        ...

    def reset(self, normal_force: float) -> None:
        """Put everything back to the initial posture, at rest, object centred in the grasp."""
        ...

    def advance(self, effort: Array, normal_force: float) -> None:
        """Advance one control period under constant effort; (n,) [N m], sum of pad forces [N].

        Raises:
            DivergenceError: where the state stopped being physical.
        """
        ...

    def holding_effort(self, target: Array, stiffness: float, damping: float) -> Array:
        """Return gravity and Coriolis compensation plus M (stiffness (target - q) - damping qd); (n,) -> (n,) [N m]."""
        ...

    def read(self) -> Array:
        """Everything that can be read, as a fresh array laid out by `Record`; (2 n + 36,)."""
        ...

    def joint_position(self) -> Array:
        """Joint positions; (n,) [rad]."""
        ...

    def joint_velocity(self) -> Array:
        """Joint velocities; (n,) [rad/s]."""
        ...

    def wrench(self) -> Array:
        """Wrench h_ee of the object on the robot at the pad centre; (6,) [N, N m] {ee} axes."""
        ...

    def slip_displacement(self) -> Array:
        """Pose s of {ee} relative to {p} as (translation, rotation vector); (6,) [m, rad] {p} axes."""
        ...

    def slip_velocity(self) -> Array:
        """Slip v_s of the pad relative to the object's material under it; (6,) [m/s, rad/s] {ee} axes."""
        ...

    def object_pose(self) -> tuple[Array, Array]:
        """Centre of mass (3,) [m] {w} and rotation (3, 3) from {o} to {w}."""
        ...

    def object_twist(self) -> Array:
        """Twist of the object at its centre of mass; (6,) [m/s, rad/s] {w}."""
        ...


def gather(plant: Plant) -> Array:
    """Return what the read-out methods of a plant say, as an array laid out by `Record`; (2 n + 36,).

    Implements: ours: the plain form of `Plant.read`.
    """
    position, rotation = plant.object_pose()
    return np.concatenate(
        (
            plant.joint_position(),
            plant.joint_velocity(),
            plant.wrench(),
            plant.slip_displacement(),
            plant.slip_velocity(),
            position,
            rotation.ravel(),
            plant.object_twist(),
        )
    )
