"""A posture to start a task from: away from limits and singular postures on its whole way, strong and fast enough."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slip_bringup.reach import Way, follow, posture_for
from slip_core.arrays import Array
from slip_vic_controller.robot import Robot

SAMPLES = 400
_COARSE = 6
"""Every so many points of the path are tried first."""
_FINALISTS = 12
_STEPS = np.repeat((0.1, 0.05, 0.02), 20)
"""[m] How far the best start is then moved, to see whether another one nearby is better."""
_SEED = 0
_WIDEST = np.pi
"""[rad] Joints that turn further are started within one turn."""
_LOWEST, _NEAREST = 0.1, 0.2
"""[m] The pad stays that high above the arm's base, and that far from the axis through it."""
_WORTH_MARGIN, _WORTH_SIGMA, _WORTH_FREE = 0.6, 0.2, 0.5
"""Margin to a limit [rad], singular value and free share of speed and effort beyond which more is no better."""


class Start(NamedTuple):
    """A start and what its way asks of the arm."""

    posture: Array
    way: Way

    @property
    def worth(self) -> float:
        """How good it is; below 0 the way cannot be gone."""
        way = self.way
        if way.blocked:
            return way.share - 2.0
        return min(
            1.0,
            float(way.margin.min()) / _WORTH_MARGIN,
            way.sigma / _WORTH_SIGMA,
            (1.0 - float(way.speed.max())) / _WORTH_FREE,
            (1.0 - float(way.load.max())) / _WORTH_FREE,
        )


def find_start(robot: Robot, rotation: Array, times: Array, path: Array, payload: Array) -> Start | None:
    """Search for the best start; None where the hand's first attitude was reached nowhere.

    Args:
        robot: the arm.
        rotation: attitude of {ee} at the start; (3, 3) {w}.
        times, path: as `pad_path` gives them.
        payload: weight of the object; (3,) [N] {w}.
    """
    rng = np.random.default_rng(_SEED)
    low = np.maximum(robot.position_lower, -_WIDEST)
    high = np.minimum(robot.position_upper, _WIDEST)
    coarse = [*range(0, len(path), _COARSE), len(path) - 1]
    found: list[Start] = []
    for _ in range(SAMPLES):
        q = rng.uniform(low + 0.1 * (high - low), high - 0.1 * (high - low))
        position = robot.frame(q)[0]
        if not _is_free(position + path[:, :3]):
            continue
        start = posture_for(robot, q, position, rotation, q)
        if start is None or (start < low).any() or (start > high).any():
            continue
        found.append(Start(start, follow(robot, start, times[coarse], path[coarse], payload)))
    found.sort(key=lambda start: start.worth, reverse=True)
    whole = [Start(one.posture, follow(robot, one.posture, times, path, payload)) for one in found[:_FINALISTS]]
    best = max(whole, key=lambda start: start.worth, default=None)
    for width in _STEPS if best is not None else ():
        assert best is not None
        position = robot.frame(best.posture)[0] + rng.normal(scale=width, size=3)
        moved = posture_for(robot, best.posture, position, rotation, best.posture)
        if moved is None or (moved < low).any() or (moved > high).any() or not _is_free(position + path[:, :3]):
            continue
        best = max(best, Start(moved, follow(robot, moved, times, path, payload)), key=lambda start: start.worth)
    return best


def _is_free(positions: Array) -> bool:
    """Whether the pad keeps clear of the floor and of the arm's own column; (k, 3) [m]."""
    return bool(positions[:, 2].min() > _LOWEST and np.hypot(positions[:, 0], positions[:, 1]).min() > _NEAREST)
