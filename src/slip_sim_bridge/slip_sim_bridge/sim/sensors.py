"""What the sensors make of the truth: rate, latency and seeded noise; a sample keeps the stamp of its measurement.

Every sensor draws from a random stream of its own, so that switching one on does not change another one's noise.
"""

from __future__ import annotations

import dataclasses
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

import numpy as np

from slip_msgs_py.arrays import Array
from slip_msgs_py.types import JointSample, SlipSample, WrenchSample
from slip_sim_bridge.sim.params import BridgeParams, JointSensorParams

Sample = TypeVar("Sample", WrenchSample, SlipSample)
Measure = Callable[[Sample, np.random.Generator], Sample]

_NS_PER_S = 1_000_000_000
_STREAMS = {"slip": 0, "wrench": 1, "joint": 2}  # never renumber: the numbers are part of what a seed means


class Sensor(Generic[Sample]):
    """Measures the truth at its own rate and hands a measurement over once its latency has passed.

    Args:
        measure: makes a measured sample of a true one.
        rate_hz: measuring rate; 0 measures at every update. The first update is a measurement.
        latency_s: time from measurement to publication.
        rng: makes the sensor's random stream from its beginning.
    """

    def __init__(
        self, measure: Measure[Sample], rate_hz: float, latency_s: float, rng: Callable[[], np.random.Generator]
    ) -> None:
        self._measure: Measure[Sample] = measure
        self._rate_hz = rate_hz
        self._latency_ns = round(latency_s * _NS_PER_S)
        self._make_rng = rng
        self.reset()

    def reset(self) -> None:
        """Forget what is under way and start noise and measuring times afresh."""
        self._rng = self._make_rng()
        self._pending: deque[Sample] = deque()
        self._first_ns: int | None = None
        self._measured = 0

    def update(self, truth: Sample) -> list[Sample]:
        """Take the truth of this tick and return the samples that are published now, oldest first.

        Implements: ours: measurement k at the first tick not before k / rate; published latency later.
        """
        if self._due(truth.stamp_ns):
            self._pending.append(self._measure(truth, self._rng))
        published = []
        while self._pending and self._pending[0].stamp_ns + self._latency_ns <= truth.stamp_ns:
            published.append(self._pending.popleft())
        return published

    def _due(self, stamp_ns: int) -> bool:
        if self._rate_hz == 0.0:
            return True
        if self._first_ns is None:
            self._first_ns = stamp_ns
        periods = int((stamp_ns - self._first_ns) * self._rate_hz / _NS_PER_S + 1e-9)
        if periods < self._measured:
            return False
        self._measured = periods + 1
        return True


class JointSensor:
    """Joint encoders: every tick, without delay."""

    def __init__(self, params: JointSensorParams, rng: Callable[[], np.random.Generator]) -> None:
        self._params = params
        self._make_rng = rng
        self.reset()

    def reset(self) -> None:
        """Start the noise afresh."""
        self._rng = self._make_rng()

    def update(self, truth: JointSample) -> JointSample:
        """Return the measured joint state of this tick; the effort is the applied one.

        Implements: ours: white noise on positions [rad] and velocities [rad/s].
        """
        position, velocity = self._params.noise_position, self._params.noise_velocity
        if position == 0.0 and velocity == 0.0:
            return truth
        size = truth.position.size
        return dataclasses.replace(
            truth,
            position=truth.position + position * self._rng.standard_normal(size),
            velocity=truth.velocity + velocity * self._rng.standard_normal(size),
        )


class SensorSuite:
    """All sensors of one arm, as `sensors.*` describes them."""

    def __init__(self, params: BridgeParams) -> None:
        sensors = params.sensors

        def stream(name: str) -> Callable[[], np.random.Generator]:
            return lambda: np.random.default_rng(np.random.SeedSequence(params.seed, spawn_key=(_STREAMS[name],)))

        slip, wrench = sensors.slip, sensors.wrench
        slip_noise = np.repeat((slip.noise_linear, slip.noise_angular), 3) * params.contacts.slip_axes[:6]
        wrench_noise = np.repeat((wrench.noise_force, wrench.noise_torque), 3)
        self.slip: Sensor[SlipSample] = Sensor(_noisy_slip(slip_noise), slip.rate_hz, slip.latency_s, stream("slip"))
        self.wrench: Sensor[WrenchSample] = Sensor(
            _noisy_wrench(wrench_noise), wrench.rate_hz, wrench.latency_s, stream("wrench")
        )
        self.joint = JointSensor(sensors.joint, stream("joint"))

    def reset(self) -> None:
        """Put all sensors back to their start, noise included."""
        self.slip.reset()
        self.wrench.reset()
        self.joint.reset()


def _noisy_slip(deviation: Array) -> Measure[SlipSample]:
    if not deviation.any():
        return lambda truth, rng: truth
    return lambda truth, rng: dataclasses.replace(truth, twist=truth.twist + deviation * rng.standard_normal(6))


def _noisy_wrench(deviation: Array) -> Measure[WrenchSample]:
    if not deviation.any():
        return lambda truth, rng: truth
    return lambda truth, rng: dataclasses.replace(truth, wrench=truth.wrench + deviation * rng.standard_normal(6))
