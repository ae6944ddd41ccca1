"""A posture to start a task from: away from limits and singular postures on its whole way, strong and fast enough."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slip_core.arrays import Array
from slip_vic.scenarios.reach import Way, follow, posture_for
from slip_vic_controller.robot import Robot

SAMPLES = 1500
_COARSE = 6
"""Every so many points of the path are tried first."""
_FINALISTS = 12
_GOOD = 0.6
"""So many starts that are worth that much end the search."""
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
    """A start and what its path requires of the arm."""

    posture: Array
    way: Way

    @property
    def worth(self) -> float:
        """How good it is; below 0 the way cannot be gone."""
        way = self.way
        if way.blocked:
            return way.share - 2.0
        worth = min(
            1.0,
            float(way.margin.min()) / _WORTH_MARGIN,
            way.sigma / _WORTH_SIGMA,
            (1.0 - float(way.speed.max())) / _WORTH_FREE,
            (1.0 - float(way.load.max())) / _WORTH_FREE,
        )
        return worth if worth > 0.0 else worth / (1.0 - worth)  # too weak or slow is still better than out of reach


def postures(robot: Robot, rotation: Array) -> list[Array]:
    """Return postures with {ee} in an attitude (3, 3) {w}, wherever it is: what a search for a start begins with."""
    rng = np.random.default_rng(_SEED)
    low, high = _range(robot)
    found = []
    for _ in range(SAMPLES):
        q = rng.uniform(low + 0.1 * (high - low), high - 0.1 * (high - low))
        position = robot.frame(q)[0]
        start = posture_for(robot, q, position, rotation, q) if _is_free(position[None]) else None
        if start is not None and (start >= low).all() and (start <= high).all():
            found.append(start)
    return found


def best_start(robot: Robot, known: list[Array], times: Array, path: Array, payload: Array) -> Start | None:
    """Return the best start among `known` postures and near the best of them; None where there is none.

    Args:
        robot: the arm.
        known: (n,) each.
        times, path: as `pad_path` gives them.
        payload: weight of the object; (3,) [N] {w}.
    """
    coarse = [*range(0, len(path), _COARSE), len(path) - 1]
    found: list[Start] = []
    good = 0
    for q in known:
        if good == _FINALISTS:
            break
        if _is_free(robot.frame(q)[0] + path[:, :3]):
            found.append(Start(q, follow(robot, q, times[coarse], path[coarse], payload)))
            good += found[-1].worth > _GOOD
    found.sort(key=lambda start: start.worth, reverse=True)
    whole = [Start(one.posture, follow(robot, one.posture, times, path, payload)) for one in found[:_FINALISTS]]
    if not whole:
        return None
    best = max(whole, key=lambda start: start.worth)
    rng = np.random.default_rng(_SEED)
    (low, high), rotation = _range(robot), robot.frame(best.posture)[1]
    for width in _STEPS:
        position = robot.frame(best.posture)[0] + rng.normal(scale=width, size=3)
        moved = posture_for(robot, best.posture, position, rotation, best.posture)
        if moved is not None and (moved >= low).all() and (moved <= high).all() and _is_free(position + path[:, :3]):
            best = max(best, Start(moved, follow(robot, moved, times, path, payload)), key=lambda start: start.worth)
    return best


def _range(robot: Robot) -> tuple[Array, Array]:
    """Return from where to where joints are started; (n,) each."""
    return np.maximum(robot.position_lower, -_WIDEST), np.minimum(robot.position_upper, _WIDEST)


def _is_free(positions: Array) -> bool:
    """Whether the pad keeps clear of the floor and of the arm's own column; (k, 3) [m]."""
    return bool(positions[:, 2].min() > _LOWEST and np.hypot(positions[:, 0], positions[:, 1]).min() > _NEAREST)
