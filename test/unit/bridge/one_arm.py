"""A simulation of one arm without a name: its methods take and return what belongs to this arm."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from slip_core.arrays import Array
from slip_sim_bridge.params import BridgeParams
from slip_sim_bridge.simulation import Arm, Readings, Simulation

UNBOUNDED = 1e8
"""Rate of the drives' efforts with which a test sets what it wants [N m/s]."""


class OneArm:
    """A `Simulation` without a bound on how fast efforts change."""

    def __init__(self, params: BridgeParams, urdf: str, plant: str = "rigid") -> None:
        self.params = params.model_copy(update={"effort_rate": UNBOUNDED, "plant": plant})
        self.all = Simulation({"": self.params}, {"": urdf})

    def __getattr__(self, name: str) -> Any:
        return getattr(self.all, name)

    @property
    def arm(self) -> Arm:
        return self.all.arms[0]

    @property
    def holding(self) -> bool:
        return self.arm.posture is not None

    @property
    def grip_force(self) -> float:
        return self.arm.gripper.force

    def set_grip_force(self, force: float) -> None:
        self.all.set_grip_force(0, force)

    def push(self, wrench: Array | Sequence[float], effort: Array) -> None:
        self.all.push(0, np.asarray(wrench), effort)

    def step(self, effort: Array | None) -> None:
        self.all.step([effort])

    def observe(self) -> Readings:
        return self.all.observe(0)

    def holding_effort(self, target: Array, stiffness: float, damping: float) -> Array:
        return self.all.plant.holding_effort(0, target, stiffness, damping)
