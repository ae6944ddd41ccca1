"""What the sensors make of the truth: rate, latency and seeded noise; a sample keeps the stamp of its measurement.

Every sensor draws from a random stream of its own, so that switching one on does not change another one's noise.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from functools import partial
from operator import attrgetter
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.random import Generator

from slip_core.arrays import Array
from slip_core.stamps import NS_PER_S, seconds_to_ns
from slip_core.types import DisplacementSample, JointSample, SlipSample, WrenchSample
from slip_sim_bridge.params import BridgeParams
from slip_sim_bridge.sensors.params import JointSensorParams, SensorsParams, WrenchSensorParams
from slip_sim_bridge.sensors.slip import SlipMeasurement, displacement, flag

Sample = TypeVar("Sample", WrenchSample, SlipSample | DisplacementSample, JointSample)

_STREAMS = {
    "slip": 0,
    "wrench": 1,
    "joint": 2,
    "slip faults": 3,
}  # never renumber: the numbers are part of what a seed means


class Sensor(Generic[Sample]):
    """Measures the truth at its own rate and hands a measurement over once its latency has passed.

    Args:
        measure: makes a measured sample of a true one, or None where the sample is lost.
        rate_hz: measuring rate; 0 measures at every update. The first update is a measurement.
        latency_s: time from measurement to publication.
        rng: random stream of the sensor.
    """

    def __init__(
        self, measure: Callable[[Any, Generator], Sample | None], rate_hz: float, latency_s: float, rng: Generator
    ) -> None:
        self.measure: Callable[[Any, Generator], Sample | None] = measure
        self._rate_hz = rate_hz
        self._latency_ns = seconds_to_ns(latency_s)
        self._rng = rng
        self._pending: deque[Sample] = deque()
        self._first_ns: int | None = None
        self._measured = 0

    def update(self, truth: Any) -> tuple[Sample, ...]:
        """Take the truth of this tick and return the samples that are published now, oldest first.

        Measurement k at the first tick not before k / rate; published latency later.
        """
        if self._due(truth.stamp_ns):
            sample = self.measure(truth, self._rng)
            if sample is not None:
                self._pending.append(sample)
        published = []
        while self._pending and self._pending[0].stamp_ns + self._latency_ns <= truth.stamp_ns:
            published.append(self._pending.popleft())
        return tuple(published)

    def _due(self, stamp_ns: int) -> bool:
        if self._rate_hz == 0.0:
            return True
        if self._first_ns is None:
            self._first_ns = stamp_ns
        periods = int((stamp_ns - self._first_ns) * self._rate_hz / NS_PER_S + 1e-9)
        if periods < self._measured:
            return False
        self._measured = periods + 1
        return True


class JointSensor:
    """Joint encoders: a joint state every tick, its values as old and as noisy as the parameters say."""

    def __init__(self, params: JointSensorParams, rng: Generator) -> None:
        self._params, self._rng = params, rng
        self._held = params.rate_hz > 0.0 or params.latency_s > 0.0
        noisy = params.noise_position > 0.0 or params.noise_velocity > 0.0
        exact = params.quantum_position == 0.0 and params.velocity_filter_hz == 0.0 and params.velocity
        self._ideal = not self._held and not noisy and exact
        self._source: Sensor[JointSample] = Sensor(lambda truth, _rng: truth, params.rate_hz, params.latency_s, rng)
        self._newest: JointSample | None = None
        self._read: tuple[JointSample, Array, Array] | None = None
        self._before: tuple[int, Array] | None = None
        self._filtered = np.zeros(0)

    def update(self, truth: JointSample) -> JointSample:
        """Return the measured joint state of this tick; the effort is the applied one.

        White noise and quantum on positions [rad]; velocities [rad/s] by the filter from these positions, where
        there is one, and with white noise.
        """
        if self._ideal:
            return truth
        source = truth
        if self._held:
            self._newest = next(reversed(self._source.update(truth)), self._newest)
            source = truth if self._newest is None else self._newest
            if self._read is not None and self._read[0] is source:  # a driver repeats what it has read, noise and all
                _, position, velocity = self._read
                return JointSample(truth.stamp_ns, position, velocity, truth.effort)
        noise_position, noise_velocity = self._params.noise_position, self._params.noise_velocity
        size = truth.position.size
        position = source.position + noise_position * self._rng.standard_normal(size)
        noise = noise_velocity * self._rng.standard_normal(size)
        if self._params.quantum_position > 0.0:
            position = self._params.quantum_position * np.round(position / self._params.quantum_position)
        velocity = source.velocity + noise
        if self._params.velocity_filter_hz > 0.0:
            velocity = self._filter(source.stamp_ns, position) + noise
        if not self._params.velocity:
            velocity = np.full(size, np.nan)
        self._read = source, position, velocity
        return JointSample(truth.stamp_ns, position, velocity, truth.effort)

    def _filter(self, stamp_ns: int, position: Array) -> Array:
        """Return the velocity of a first-order filter on differences of measured positions; from rest at first."""
        if self._before is None:
            self._before, self._filtered = (stamp_ns, position), np.zeros(position.size)
        passed_s = (stamp_ns - self._before[0]) / NS_PER_S
        if passed_s > 0.0:
            share = 1.0 - math.exp(-2.0 * math.pi * self._params.velocity_filter_hz * passed_s)
            difference = (position - self._before[1]) / passed_s
            self._filtered = self._filtered + share * (difference - self._filtered)
            self._before = stamp_ns, position
        return self._filtered


class SensorSuite:
    """All sensors of one arm, as `sensors.*` describes them.

    Attributes:
        slip: gives what `slip_input` says.
        slip_truth: takes what `slip` measures out of an arm's `Readings`.
    """

    def __init__(self, params: BridgeParams) -> None:
        sensors = params.sensors

        def stream(name: str) -> Generator:
            return np.random.default_rng(np.random.SeedSequence(params.seed, spawn_key=(_STREAMS[name],)))

        slip, wrench, radius = sensors.slip, sensors.wrench, params.friction.torsional_radius
        axes = np.array(params.contacts.slip_axes[:6], dtype=float)
        self.slip_truth = attrgetter("seen" if slip.sees_pads else "slip")
        measure: Any = SlipMeasurement(slip, axes, stream("slip faults"))
        self._measure_slip: SlipMeasurement = measure
        if params.slip_input == "flag":
            measure = partial(flag, measure, radius)
        elif params.slip_input == "displacement":
            measure, self.slip_truth = partial(displacement, measure, radius), attrgetter("displaced")
        self.slip: Sensor[SlipSample | DisplacementSample]
        self.slip = Sensor(measure, slip.rate_hz, slip.latency_s, stream("slip"))
        self.wrench: Sensor[WrenchSample]
        self.wrench = Sensor(partial(measured_wrench, wrench), wrench.rate_hz, wrench.latency_s, stream("wrench"))
        self.joint = JointSensor(sensors.joint, stream("joint"))

    def set_faults(self, params: SensorsParams) -> None:
        """Switch faults on and off from the next measurement on; what is under way stays as it is."""
        self._measure_slip.faults = params.slip.faults
        self.wrench.measure = partial(measured_wrench, params.wrench)


def measured_wrench(params: WrenchSensorParams, truth: WrenchSample, rng: Generator) -> WrenchSample | None:
    """Return a wrench with the errors of a real sensor, or None where it is lost; noise is drawn from `rng`.

    params: what the sensor is, faults included.
    """
    deviation = params.noise_force, params.noise_torque
    noise = rng.standard_normal(6) if max(deviation) > 0.0 else None
    if params.silent:
        return None
    if noise is None and params.gain == 1.0 and not any(params.bias):
        return truth
    wrench = params.gain * truth.wrench + np.array(params.bias)
    if noise is not None:
        wrench = wrench + np.repeat(deviation, 3) * noise
    return WrenchSample(truth.stamp_ns, wrench)
