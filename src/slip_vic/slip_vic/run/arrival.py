"""When the pad has arrived, from one cycle of a run after the other."""

from __future__ import annotations

import math

import numpy as np

from slip_core.arrays import Array
from slip_vic.run.metrics import ARRIVED
from slip_vic_controller.session import CycleResult


class Arrival:
    """When the pad has arrived for good, as `arrival_s`, from one cycle of a run after the other."""

    def __init__(self) -> None:
        self._times: list[float] = []
        self._poses: list[Array] = []
        self._goal: Array = np.zeros(12)

    def add(self, time_s: float, result: CycleResult) -> None:
        """Take a cycle in which the law was at work."""
        arm, reference = result.arm, result.record.reference
        self._times.append(time_s)
        self._poses.append(np.concatenate((arm.position, arm.rotation.ravel())))
        self._goal = np.concatenate((reference.position, reference.rotation.ravel()))

    @property
    def since_s(self) -> float:
        """From when on the pad stays within ARRIVED of the last desired pose [s]; NaN where it does not."""
        if not self._times:
            return math.nan
        poses = np.array(self._poses)
        cosine = 0.5 * (poses[:, 3:] @ self._goal[3:] - 1.0)
        near = np.linalg.norm(poses[:, :3] - self._goal[:3], axis=1) < ARRIVED[0]
        near &= cosine > math.cos(ARRIVED[1])
        if not near[-1]:
            return math.nan
        away = np.flatnonzero(~near)
        return self._times[0 if not away.size else int(away[-1]) + 1]
