"""What a slip sensor makes of the truth: a slip velocity, a flag, or where the pad is on the object.

Noise and faults draw from two streams: switching a fault on does not change the noise.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.random import Generator

from slip_core.arrays import Array, readonly
from slip_core.types import DisplacementSample, SlipSample
from slip_sim_bridge.sensors.params import CHIPS, SlipSensorParams

_INVALID, _INVALID_POSE = (readonly(np.full(size, math.nan)) for size in (6, 7))
_STILL = readonly(np.zeros(3))
CHIP_RADIUS = 0.01
"""Circle on which the chips of an optical sensor sit [m]."""
FLAG_SPEED = 1e-3
"""|(v, rho w)| at which a flag rises [m/s]."""
OUTLIER = readonly(np.array((0.2, 0.2, 0.2, 5.0, 5.0, 5.0)))
"""Standard deviation of an outlier [m/s, rad/s]."""


class SlipMeasurement:
    """Measures slip velocity: chips, gain, noise, outliers, saturation, quantum, dead band; `faults` may change.

    Args:
        params: the sensor.
        slip_axes: where the contact can slip, and so where there is something to measure; (6,) 0 or 1 on pad axes.
        fault_rng: random stream of the faults.
    """

    def __init__(self, params: SlipSensorParams, slip_axes: Array, fault_rng: Generator) -> None:
        self.params = params
        self.axes = slip_axes
        self._deviation = np.repeat((params.noise_linear, params.noise_angular), 3) * slip_axes
        self._noisy = bool(self._deviation.any())
        self._exact = max(params.quantum_linear, params.dead_band_linear, params.dead_band_angular) == 0.0
        self.fault_rng = fault_rng
        self.faults = params.faults
        self._last: Array | None = None

    def __call__(self, truth: SlipSample, rng: Generator) -> SlipSample | None:
        """Return the measured sample, or None where it is lost; noise is drawn from `rng`."""
        noise = rng.standard_normal(6) if self._noisy else None
        faults = self.faults
        lossy = faults.silent or faults.invalid or faults.frozen or faults.dropout_probability > 0.0
        if not lossy and faults.outlier_probability == 0.0:
            twist = self._read(truth.twist, noise)
        else:
            chances, odd = self.fault_rng.random(2), self.fault_rng.standard_normal(6)
            if faults.silent or chances[0] < faults.dropout_probability:
                return None
            if faults.invalid:
                return SlipSample(truth.stamp_ns, _INVALID, valid=False)
            if faults.frozen and self._last is not None:
                return SlipSample(truth.stamp_ns, self._last)
            twist = self._read(truth.twist, noise)
            if chances[1] < faults.outlier_probability:
                twist = self._digitise(OUTLIER * odd * self.axes)
        self._last = twist
        return truth if twist is truth.twist else SlipSample(truth.stamp_ns, twist, truth.valid)

    def _read(self, truth: Array, noise: Array | None) -> Array:
        faults, twist = self.faults, truth
        if faults.lifted_chips:
            twist = lifted_chip_reading(twist, faults.lifted_chips)
        if faults.gain != 1.0:
            twist = faults.gain * twist
        if noise is not None:
            twist = twist + self._deviation * noise
        if any(faults.bias):
            twist = twist + np.array(faults.bias)
        return self._digitise(twist)

    def _digitise(self, twist: Array) -> Array:
        params = self.params
        if (np.abs(twist[:3]) > params.saturation_linear).any():
            most = params.saturation_linear
            twist = np.concatenate((np.clip(twist[:3], -most, most), twist[3:]))
        if self._exact:
            return twist
        if params.quantum_linear > 0.0:
            twist = np.concatenate((params.quantum_linear * np.round(twist[:3] / params.quantum_linear), twist[3:]))
        return dead_band(twist, params.dead_band_linear, params.dead_band_angular)


def dead_band(twist: Array, linear: float, angular: float) -> Array:
    """Return the twist with its linear, angular half zero where that half's norm is below the dead band.

    twist (6,) [m/s, rad/s], linear [m/s], angular [rad/s], any axes; the same array where nothing is in the band.

    Slow motion gives an optical sensor no counts.
    """
    x, y, z, about_x, about_y, about_z = twist.tolist()
    moves, turns = math.hypot(x, y, z) >= linear, math.hypot(about_x, about_y, about_z) >= angular
    return (
        twist if moves and turns else np.concatenate((twist[:3] if moves else _STILL, twist[3:] if turns else _STILL))
    )


def lifted_chip_reading(twist: Array, lifted: int) -> Array:
    """Return what optical chips on a circle make of a twist while the first `lifted` of them read zero.

    Every chip reads the two linear velocities at its place; x, y and the turn about z follow by least squares, as a
    driver does that does not know which chip is off. twist (6,) [m/s, rad/s] {ee}.
    """
    angles = 2.0 * math.pi * np.arange(CHIPS) / CHIPS
    rows = np.zeros((CHIPS, 2, 3))
    rows[:, 0, 0] = rows[:, 1, 1] = 1.0
    rows[:, 0, 2], rows[:, 1, 2] = -CHIP_RADIUS * np.sin(angles), CHIP_RADIUS * np.cos(angles)
    readings = rows @ twist[[0, 1, 5]]
    readings[:lifted] = 0.0
    out = twist.copy()
    out[[0, 1, 5]] = np.linalg.lstsq(rows.reshape(-1, 3), readings.ravel(), rcond=None)[0]
    return out


def flag(reading: SlipMeasurement, radius: float, truth: SlipSample, rng: Generator) -> SlipSample | None:
    """Return all ones where what a slip sensor reads, faults included, is faster than `FLAG_SPEED`, else zeros.

    None where the sample is lost. radius: rho [m].
    """
    read = reading(truth, rng)
    if read is None or not read.valid:
        return read
    v = read.twist
    up = math.hypot(*v[:3].tolist(), *(radius * v[3:]).tolist()) > FLAG_SPEED
    return SlipSample(truth.stamp_ns, np.full(6, float(up)))


def displacement(
    reading: SlipMeasurement, radius: float, truth: SlipSample, rng: Generator
) -> DisplacementSample | None:
    """Return the pose of the pad on the object with white noise; faults of the slip sensor lose or spoil samples.

    Args:
        reading: the slip sensor.
        radius: at which an error of position is one of angle [m].
        truth: the displacement in place of a twist.
        rng: of the noise.
    """
    deviation = reading.params.noise_position * np.repeat((1.0, 1.0 / radius), 3) * reading.axes
    noise, chance = deviation * rng.standard_normal(6), reading.fault_rng.random()
    if reading.faults.silent or chance < reading.faults.dropout_probability:
        return None
    if reading.faults.invalid:
        return DisplacementSample(truth.stamp_ns, _INVALID_POSE, valid=False)
    return DisplacementSample(truth.stamp_ns, pose_of(truth.twist + noise))


def pose_of(displacement: Array) -> Array:
    """Return position and quaternion x y z w of a translation and rotation vector; (6,) [m, rad] -> (7,)."""
    angle = math.sqrt(float(displacement[3:] @ displacement[3:]))
    axis = displacement[3:] * (math.sin(0.5 * angle) / angle if angle > 0.0 else 0.5)
    return np.array([*displacement[:3].tolist(), *axis.tolist(), math.cos(0.5 * angle)])
