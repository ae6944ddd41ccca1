"""Slip sensors that give no slip velocity: a flag, and where the pad is on the object."""

from __future__ import annotations

import math

import numpy as np
from numpy.random import Generator

from slip_core.arrays import Array, readonly
from slip_core.types import DisplacementSample, ObjectTruth, SlipSample
from slip_sim_bridge.sensors.params import SlipSensorParams
from slip_sim_bridge.sensors.slip import SlipMeasurement

_INVALID = readonly(np.full(7, math.nan))


class FlagMeasurement:
    """Says whether it slips: whether what a slip sensor reads, faults included, is faster than `flag_speed`.

    Args:
        reading: the sensor.
        flag_speed: |(v, rho w)| at which the flag rises [m/s].
        radius: rho [m].
    """

    def __init__(self, reading: SlipMeasurement, flag_speed: float, radius: float) -> None:
        self._reading, self._least, self._radius = reading, flag_speed, radius

    def __call__(self, truth: SlipSample, rng: Generator) -> SlipSample | None:
        """Return all ones or zeros, or None where the sample is lost."""
        read = self._reading(truth, rng)
        if read is None or not read.valid:
            return read
        v = read.twist
        up = math.hypot(*v[:3].tolist(), *(self._radius * v[3:]).tolist()) > self._least
        return SlipSample(truth.stamp_ns, np.full(6, float(up)))


class DisplacementMeasurement:
    """Measures the pose of the pad on the object with white noise; `faults` of the slip sensor lose or spoil samples.

    Args:
        params: the sensor.
        slip_axes: where the contact can slip; (6,) 0 or 1 on pad axes.
        reading: whose faults count.
        fault_rng: random stream of the losses.
    """

    def __init__(
        self, params: SlipSensorParams, slip_axes: Array, reading: SlipMeasurement, fault_rng: Generator
    ) -> None:
        self._reading, self._rng = reading, fault_rng
        self._deviation = np.repeat((params.noise_position, params.noise_angle), 3) * slip_axes

    def __call__(self, truth: ObjectTruth, rng: Generator) -> DisplacementSample | None:
        """Return the measured pose, or None where the sample is lost."""
        faults, noise, chance = self._reading.faults, self._deviation * rng.standard_normal(6), self._rng.random()
        if faults.silent or chance < faults.dropout_probability:
            return None
        if faults.invalid:
            return DisplacementSample(truth.stamp_ns, _INVALID, valid=False)
        return DisplacementSample(truth.stamp_ns, pose_of(truth.slip_displacement + noise))


def pose_of(displacement: Array) -> Array:
    """Return position and quaternion x y z w of a translation and rotation vector; (6,) [m, rad] -> (7,)."""
    angle = math.sqrt(float(displacement[3:] @ displacement[3:]))
    axis = displacement[3:] * (math.sin(0.5 * angle) / angle if angle > 0.0 else 0.5)
    return np.array([*displacement[:3].tolist(), *axis.tolist(), math.cos(0.5 * angle)])
