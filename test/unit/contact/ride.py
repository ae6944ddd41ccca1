"""A pad that sticks, slips and sticks again on a turning hand, with wrong forces and a sensor that can be anything."""

from __future__ import annotations

import hashlib
import random
from collections.abc import Callable

import numpy as np

from test.unit.contact.rig import MS, Observer, make_motion, make_params

SENSOR = {"slip_sensor__noise_linear": 2e-3, "slip_sensor__noise_angular": 0.05}
EAGER = {  # to end a slip, of any doubt
    "observer__stick_share": 0.999,
    "observer__stick_acceleration_std_m_s2": 0.5,
    "observer__stick_acceleration_std_rad_s2": 10.0,
    "observer__stick_speed_std_m_s": 1.0,
    "observer__stick_speed_std_rad_s": 100.0,
}
SLIDE = np.array((0.5, -0.3, 0.4, 2.0, -1.5, 3.0))
Samples = list[tuple[int, np.ndarray]]


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
        start_ns: stamp of the tick before the first one.
        seed: of everything.
        rate: samples per tick.
        lateness: most ticks that a sample comes late.
        axes: in which the contact can slip.
    """

    def __init__(
        self, move: Callable, start_ns: int, seed: int, *, rate: float = 0.5, lateness: int = 0, axes=(True,) * 6
    ) -> None:
        self.move, self.rng, self.mix = move, np.random.default_rng(seed), random.Random(seed)
        self.rate, self.lateness, self.direction = rate, lateness, SLIDE * np.array(axes)
        self.slip, self.twist, self.R = np.zeros(6), np.zeros(6), turned(self.rng.standard_normal(3))
        self.stamp_ns = start_ns
        self.arrivals: dict[int, Samples] = {}
        self.seen: list[bool] = []

    def go(self, ticks: int, slip_acceleration: np.ndarray | float, noise: float = 1.0) -> None:
        """Go on for some ticks; slip_acceleration (6,) {ee}, or a factor by which slip fades."""
        rng = self.rng
        for _ in range(ticks):
            dt_ns = int(rng.integers(700_000, 1_300_000)) if rng.random() < 0.97 else int(rng.integers(0, 2)) * 9 * MS
            dt, k = 1e-9 * dt_ns, len(self.seen)
            self.stamp_ns += dt_ns
            w = 0.3 * rng.standard_normal(3)
            self.R = self.R @ turned(1e-3 * w)
            before = self.slip
            self.slip = (
                before * slip_acceleration if np.isscalar(slip_acceleration) else before + dt * slip_acceleration
            )
            follow = np.array((0.3, -0.1, 0.2, 0.1, 0.0, -0.3)) + 0.02 * rng.standard_normal(6)
            slip = ((self.slip - before).reshape(2, 3) @ self.R.T).ravel()
            self.twist = self.twist + dt * follow + slip + 1e-6 * rng.standard_normal(6)
            reported = 1.1 * follow + 0.03
            drag = self.R @ (self.slip[:3] * 2.0 + 0.05 * rng.standard_normal(3))
            motion = make_motion(self.twist, reported, reported, drag, w, self.R)
            for _ in range(rng.poisson(self.rate)):
                self._measure(k, dt_ns, noise)
            coming = self.arrivals.pop(k, [])
            self.mix.shuffle(coming)
            self.seen.append(bool(self.move(motion, self.stamp_ns, coming).sliding))

    def _measure(self, k: int, dt_ns: int, noise: float) -> None:
        rng = self.rng
        stamp_ns = self.stamp_ns - int(rng.integers(0, dt_ns + 1)) + (MS if rng.random() < 0.02 else 0)
        deviation = np.array((2e-3, 2e-3, 2e-3, 0.05, 0.05, 0.05))
        twist = self.slip + noise * deviation * rng.standard_normal(6)
        if noise == 1.0 and rng.random() < 0.02:
            twist = twist + 1.0  # an outlier
        if rng.random() < 0.1:
            twist[:3] = 0.0  # the dead band
        self.arrivals.setdefault(k + int(rng.integers(0, self.lateness + 1)), []).append((stamp_ns, twist))

    def stick_slip_stick(self) -> None:
        """Slip twice, in opposite directions, and come to rest again."""
        self.go(70, 1.0)
        for sign in (1.0, -1.0):
            self.go(50, sign * self.direction)
            self.go(50, 1.0)
            self.go(50, 0.85)
            self.slip = np.zeros(6)
            self.go(120, 1.0, noise=0.05)


def digests() -> list[str]:
    """Return what the bits after every tick of two rides come to."""
    digest = hashlib.sha256()
    for seed, axes in ((1, (True, True, False, False, False, True)), (2, (True,) * 6)):
        values = {**SENSOR, **EAGER, "slip_sensor__dead_band_linear": 2e-3, "observer__memory_s": 0.02}
        observer = Observer(make_params(**values, contacts__slip_axes=axes), rows=200)

        def move(motion, stamp_ns, samples, observer=observer):
            assert observer.observe(motion, stamp_ns, samples)
            digest.update(observer.buffer.tobytes())
            return observer.state

        ride = Ride(move, 0, seed, lateness=8, axes=axes)
        ride.go(60, 1.0)
        ride.go(40, ride.direction)
        ride.go(40, 0.7)
        ride.go(60, 1.0, noise=0.05)
        assert {True, False} <= set(ride.seen[100:]), "no slip, or no end of it"
        digest.update(observer.history.tobytes())
    return [digest.hexdigest()]
