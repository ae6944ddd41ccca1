"""Referee: what a disc under uniform pressure with Coulomb friction in every point can carry: a sum of its points."""

from __future__ import annotations

import numpy as np

RINGS, RAYS = 150, 150


def disc_limit(degrees: float) -> float:
    """Largest load in a direction from pure force (0) to pure torque (90), over mu N; torque counts as tau / (2/3 r).

    The ellipsoid of a limit surface has 1 in every direction. A disc that slips turns about some point at a distance
    `away` from its centre: far away it is pure force, at the centre pure torque.
    """
    rings, rays = (np.arange(RINGS) + 0.5) / RINGS, (np.arange(RAYS) + 0.5) / RAYS * 2.0 * np.pi
    x, y = np.outer(rings, np.cos(rays)), np.outer(rings, np.sin(rays))
    share = np.repeat(rings[:, None], RAYS, axis=1)
    share /= share.sum()

    def load(away: float) -> tuple[float, float]:
        speed = np.hypot(x + away, y)
        force = (share * (x + away) / speed).sum()
        return force, (share * (x * (x + away) + y * y) / speed).sum() / (2.0 / 3.0)

    low, high = -4.0, 4.0  # of log10(away)
    for _ in range(40):
        middle = 0.5 * (low + high)
        force, torque = load(10.0**middle)
        low, high = (middle, high) if np.degrees(np.arctan2(torque, force)) > degrees else (low, middle)
    return float(np.hypot(force, torque))
