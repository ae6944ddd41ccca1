"""What a physics backend offers; `GraspSimulation` adds the clock, holding, clipping and refusal on top."""

from __future__ import annotations

from typing import Protocol

from slip_msgs_py.arrays import Array
from slip_msgs_py.errors import SlipVicError


class DivergenceError(SlipVicError):
    """The simulated state is no longer finite or physical; only a reset helps."""


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
