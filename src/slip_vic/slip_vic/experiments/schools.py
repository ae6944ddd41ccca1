"""What laws of other schools share: the load of the pad, measured or planned, and laws that change the motion alone."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, Final

import numpy as np

from slip_core.arrays import Array
from slip_core.types import PadMotion
from slip_vic.experiments.law import Answer, Pad, Seen, Setup
from slip_vic.retime.certificate import pad_wrench

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
    def wanted(self, seen: Seen) -> PadMotion:
        """Return the reference of this tick."""


def measured_load(setup: Setup, wrench: Array) -> Array:
    """Return the load on the pad's plane and about its normal; (3,) [N], the torque over the torsional radius.

    Limit surface as an ellipsoid: R. Howe, M. Cutkosky, Int. J. Robotics Research 15 (1996) 531-549.
    """
    return np.array([wrench[0], wrench[1], wrench[5] / setup.torsional_radius])


def planned_load(setup: Setup, at: PadMotion) -> Array:
    """Return the load of an object that moves with the pad as (3,) [N], see `measured_load`."""
    wrench = pad_wrench(next(iter(setup.parameters.values())), at)
    back = at.rotation.T
    return measured_load(setup, np.concatenate((back @ wrench[:3], back @ wrench[3:])))


def timed(setup: Setup, at: float, rate: float, rate_rate: float) -> PadMotion:
    """Return the path at its own time [s], run through with this rate [1] and its change [1/s]."""
    point = setup.reference(at)
    acceleration = point.acceleration * rate**2 + point.twist * rate_rate
    return point._replace(twist=point.twist * rate, acceleration=acceleration)
