"""What the baselines share: laws that change the motion alone, and the load of the pad, measured or of a path."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, Final

import numpy as np

from slip_core.arrays import Array, inertia_from_six
from slip_vic.experiments.law import Answer, Pad, Reference, Seen, Setup

PLAN_POINTS: Final = 100
"""Points of the path at which a law that plans looks at the load (ours)."""


class MotionLaw(ABC):
    """The grip stays; `wanted` changes the reference, which impedance of the configured gains follows."""

    needs: ClassVar[frozenset[str]] = frozenset()

    def reset(self, setup: Setup) -> None:
        """Begin a run."""
        gains = next(iter(setup.parameters.values())).gains
        self.setup, inertia = setup, np.array(gains.inertia)
        self._stiffness, self._damping = np.array(gains.stiffness) / inertia, np.array(gains.damping) / inertia

    def step(self, seen: Seen) -> Answer:
        """Answer a tick."""
        wanted = self.wanted(seen)
        error = self._stiffness * seen.way_to(wanted)
        return Pad(wanted.acceleration + error + self._damping * (wanted.twist - seen.twist))

    @abstractmethod
    def wanted(self, seen: Seen) -> Reference:
        """Return the reference of this tick."""


def measured_load(setup: Setup, wrench: Array) -> Array:
    """Return the load on the pad's plane and about its normal; (3,) [N], the torque over the torsional radius.

    Limit surface as an ellipsoid: R. Howe, M. Cutkosky, Int. J. Robotics Research 15 (1996) 531-549.
    """
    return np.array([wrench[0], wrench[1], wrench[5] / setup.torsional_radius])


def planned_load(setup: Setup, at: Reference) -> Array:
    """Return the load of an object that moves with the pad as (3,) [N], see `measured_load`; Newton and Euler."""
    R = at.rotation
    to_object = R @ setup.grasp_rotation.T
    lever = lever_of_object(setup, R)
    spin, turn = at.twist[3:], at.acceleration[3:]
    own: Array = inertia_from_six(setup.inertia.tolist(), "inertia")
    I = to_object @ own @ to_object.T  # noqa: E741
    acceleration = at.acceleration[:3] + np.cross(turn, lever) + np.cross(spin, np.cross(spin, lever))
    force = setup.mass * (acceleration - setup.gravity)
    torque = np.cross(lever, force) + I @ turn + np.cross(spin, I @ spin)
    return measured_load(setup, np.concatenate((R.T @ force, R.T @ torque)))


def lever_of_object(setup: Setup, rotation: Array) -> Array:
    """Return the object's centre of mass from the pad with this attitude (3, 3), as (3,) [m] {w}."""
    lever: Array = -rotation @ setup.grasp_rotation.T @ setup.grasp_position
    return lever


def load_of_acceleration(setup: Setup, rotation: Array) -> Array:
    """Return what a linear acceleration of the pad adds to its load, as a matrix (3, 3) [N s2/m]."""
    x, y, z = rotation.T
    lever = lever_of_object(setup, rotation)
    return setup.mass * np.array([x, y, np.cross(z, lever) / setup.torsional_radius])


def timed(setup: Setup, at: float, rate: float, rate_rate: float) -> Reference:
    """Return the path at its own time [s], run through with this rate [1] and its change [1/s]."""
    point = setup.reference(at)
    acceleration = point.acceleration * rate**2 + point.twist * rate_rate
    return Reference(point.position, point.rotation, point.twist * rate, acceleration)
