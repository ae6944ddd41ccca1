"""A pad that sticks and slips on a turning hand, with wrong forces and a sensor of late samples and outliers."""

from __future__ import annotations

import hashlib
import random
from collections.abc import Callable

import numpy as np

from test.unit.contact.rig import MS, Observer, given, make_motion

SENSOR = {"slip_sensor__noise_linear": 2e-3, "slip_sensor__noise_angular": 0.05}
SLIDE = np.array((0.5, -0.3, 0.4, 2.0, -1.5, 3.0))


def turned(phi: np.ndarray) -> np.ndarray:
    """Return the rotation by phi [rad]: Rodrigues' formula."""
    theta = float(np.linalg.norm(phi))
    x, y, z = phi / theta
    S = np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))
    return np.eye(3) + np.sin(theta) * S + (1.0 - np.cos(theta)) * S @ S


class Ride:
    """A ride.

    Args:
        move: does a tick: MOTION buffer, stamp, samples; returns the OBSERVER record.
        seed: of everything.
        lateness: most ticks that a sample comes late.
    """

    def __init__(self, move: Callable, seed: int, lateness: int) -> None:
        self.move, self.rng, self.mix, self.lateness = move, np.random.default_rng(seed), random.Random(seed), lateness
        self.slip, self.twist, self.R = np.zeros(6), np.zeros(6), turned(self.rng.standard_normal(3))
        self.stamp_ns, self.tick = 0, 0
        self.arrivals: dict[int, list[tuple[int, np.ndarray]]] = {}

    def run(self, ticks: int, slip_acceleration: np.ndarray | float, noise: float = 1.0) -> list[bool]:
        """Return whether it slides at each tick; slip_acceleration (6,) {ee}, or a factor by which slip fades."""
        return [self._tick(slip_acceleration, noise) for _ in range(ticks)]

    def _tick(self, slip_acceleration: np.ndarray | float, noise: float) -> bool:
        rng, before = self.rng, self.slip
        dt_ns = int(rng.integers(700_000, 1_300_000)) if rng.random() < 0.97 else int(rng.integers(0, 2)) * 9 * MS
        dt = 1e-9 * dt_ns
        self.stamp_ns += dt_ns
        w = 0.3 * rng.standard_normal(3)
        self.R = self.R @ turned(1e-3 * w)
        self.slip = before * slip_acceleration if np.isscalar(slip_acceleration) else before + dt * slip_acceleration
        follow = np.array((0.3, -0.1, 0.2, 0.1, 0.0, -0.3)) + 0.02 * rng.standard_normal(6)
        slip = ((self.slip - before).reshape(2, 3) @ self.R.T).ravel()
        self.twist = self.twist + dt * follow + slip + 1e-6 * rng.standard_normal(6)
        reported = 1.1 * follow + 0.03
        drag = self.R @ (self.slip[:3] * 2.0 + 0.05 * rng.standard_normal(3))
        if rng.random() < 0.5:
            twist = self.slip + noise * np.array((2e-3,) * 3 + (0.05,) * 3) * rng.standard_normal(6)
            twist += float(noise == 1.0 and rng.random() < 0.02)  # an outlier
            twist[:3] *= rng.random() > 0.1  # the dead band
            arrives = self.tick + int(rng.integers(0, self.lateness + 1))
            self.arrivals.setdefault(arrives, []).append((self.stamp_ns - int(rng.integers(0, dt_ns + 1)), twist))
        coming = self.arrivals.pop(self.tick, [])
        self.mix.shuffle(coming)
        self.tick += 1
        return bool(
            self.move(make_motion(self.twist, reported, reported, drag, w, self.R), self.stamp_ns, coming).sliding
        )


def digests() -> list[str]:
    """Return the digest of all bits after every tick of two rides."""
    digest = hashlib.sha256()
    for seed, axes in ((1, (True, True, False, False, False, True)), (2, (True,) * 6)):
        values = {"slip_sensor__dead_band_linear": 2e-3, "observer__memory_s": 0.02, "contacts__slip_axes": axes}
        observer = Observer(*given(**SENSOR, **values), rows=200)

        def move(motion, stamp_ns, samples, observer=observer):
            assert observer.observe(motion, stamp_ns, samples)
            digest.update(observer.buffer.tobytes())
            return observer.state

        ride = Ride(move, seed, lateness=8)
        ride.run(60, 1.0)
        slides = ride.run(40, SLIDE * np.array(axes)) + ride.run(40, 0.7) + ride.run(160, 1.0, noise=0.05)
        assert True in slides, "no slip"
        digest.update(observer.history.tobytes())
    return [digest.hexdigest()]
