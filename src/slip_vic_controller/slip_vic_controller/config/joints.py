"""From parameters to the joint state estimator: gains and covariance from the discrete Riccati equation."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from slip_core.arrays import Array, riccati, solve, times
from slip_core.compiled import OUT1, REAL, VOID, kernel, part
from slip_core.errors import InputError
from slip_core.records import new, record
from slip_vic_controller.arm.estimator import (
    BIAS,
    DIFFERENCE,
    ESTIMATOR_CONFIG,
    MAX_LATENCY,
    MEAN_S,
    QUICK,
    SIGNIFICANT,
    EstimatorConfig,
    Trust,
    transition,
)
from slip_vic_controller.params.controller_params import ControllerParams

DEVIATIONS: Final = 6.0
"""Standard deviations of a sample that are no noise."""
LEAST_POSITION, LEAST_VELOCITY = 2e-5, 1e-4
"""What is assumed of a sensor without noise [rad], [rad/s]."""
UNMEASURED_VELOCITY = 3e-3
"""What is assumed of a sensor until a tare has measured its noise, where none is configured [rad/s]."""
LAG_ACCELERATION: Final = 5.0
"""Acceleration at which the lag of a velocity filter counts as noise [rad/s^2]."""
MODEL_NOISE, QUICK_DRIFT = 0.1, 100.0
"""Joint acceleration that the model leaves out, white, in every control period, and the drift of the disturbance where
friction turns round: standard deviations [rad/s^2]."""
SETTLES_AFTER: Final = 5.0
"""Of the compensation: time constant with which it follows the estimate, over the control period or all delays of the
loop, so that noise does not shake the arm, friction that turns round does not swing it, and arms that share an object
do not answer what the others compensate."""
RATE, COLLISION = 10.0, 0.3
"""Fastest change of the compensation [1/s], and jump of the disturbance that is a collision, as shares of the joint's
effort limit."""


@part
def predict(config: EstimatorConfig, drift: float, P: Array, ticks: int) -> tuple[Array, Array]:
    """Return F of (q, v, d) over a number of control periods, and a covariance P after them; (3, 3), (3, 3)."""
    step, over = transition(config.bandwidth, config.period), np.eye(3)
    F = np.array(((1.0, step.qv, step.qd), (0.0, step.vv, step.vd), (0.0, 0.0, 1.0)))
    white = MODEL_NOISE * np.array((step.qd, step.vd, 0.0))
    Q = np.outer(white, white)
    Q[2, 2] = drift * drift * config.period
    for _ in range(ticks):
        over, P = times(F, over), times(times(F, P), F.T) + Q
    return over, P


@part
def steady_state(config: EstimatorConfig, velocity: float, drift: float, trust: int) -> tuple[Array, Array]:
    """Return the covariance (3, 3) after a sample of a joint's Kalman filter in steady state, and that before it.

    Position is not observable from velocity: it is integrated, v and d are filtered.

    Args:
        config: its gain for this `trust` is written.
        velocity: noise of the velocities, a standard deviation [rad/s].
        drift: of the disturbance after one second [rad/s^2].
        trust: which of position and velocity are measured, a Trust; QUICK is both.
    """
    first, last = 1 if trust == Trust.VELOCITY else 0, 1 if trust == Trust.POSITION else 2
    F, Q = predict(config, drift, np.zeros((3, 3)), config.sensor_ticks)
    deviations, H = np.array((config.noise, velocity))[first:last], np.eye(3)[first:last, first:]
    R = np.diag(deviations * deviations)
    P = riccati(F[first:, first:], H, Q[first:, first:], R)
    K = solve(times(times(H, P), H.T) + R, times(H, P)).T
    config.gain[trust] = 0.0
    for i in range(len(K)):
        config.gain[trust, first + i, first:last] = K[i]
    kept = np.eye(3 - first) - times(K, H)
    return times(times(kept, P), kept.T) + times(times(K, R), K.T), P


@kernel(VOID, OUT1, REAL)
def fill_filters(config: Array, noise: float) -> None:
    """Fill in what of an ESTIMATOR_CONFIG follows from the noise of joint velocities, a standard deviation [rad/s]."""
    c = record(config, ESTIMATOR_CONFIG)
    velocity = max(math.sqrt(noise * noise + c.more_noise * c.more_noise), LEAST_VELOCITY)
    updated, P = steady_state(c, velocity, c.drift, Trust.BOTH.value)
    steady_state(c, velocity, c.drift, Trust.POSITION.value)
    steady_state(c, velocity, c.drift, Trust.VELOCITY.value)
    steady_state(c, velocity, max(QUICK_DRIFT, c.drift), QUICK)
    c.scale[0] = 1.0 / math.sqrt(P[0, 0] + c.noise * c.noise)
    c.scale[1] = 1.0 / math.sqrt(P[1, 1] + velocity * velocity)
    _, ahead = predict(c, c.drift, updated, c.late_ticks)
    # The corrections change the velocity by a variance of (K S K^T)_vv in every period.
    c.velocity_variance, c.change_variance = ahead[1, 1], P[1, 1] - updated[1, 1]
    # The sum diffuses with noise of the velocities: its chance to be at S is exp(-2 BIAS S / (noise^2 period)), that
    # of a sample beyond DEVIATIONS about exp(-DEVIATIONS^2 / 2).
    diffused = DEVIATIONS * velocity * (DEVIATIONS * velocity) * c.sensor_period / (4.0 * BIAS)
    c.difference = max(DIFFERENCE, diffused) + DEVIATIONS * math.sqrt(2.0) * c.noise


def estimator_config(params: ControllerParams, effort_limit: Array) -> Array:
    """Return the EstimatorConfig buffer; effort_limit (n,) [N m].

    A count is uniform noise. A velocity that is made of counts has the noise of their difference, less by its filter,
    and the filter's lag at LAG_ACCELERATION.

    Raises:
        InputError: the latency is more than MAX_LATENCY control periods.
    """
    buffer = new(ESTIMATOR_CONFIG)
    config: EstimatorConfig = record(buffer, ESTIMATOR_CONFIG)
    sensor, model, n, period = params.joint_sensor, params.disturbance, len(effort_limit), params.control_period_s
    by_effort, quantum = params.command.interface == "effort", sensor.quantum_position / math.sqrt(12.0)
    config.joints, config.period, config.bandwidth = n, period, 0.0 if by_effort else params.drive.bandwidth
    config.on, config.drift = int(params.estimates_joints), model.drift
    config.noise = max(math.hypot(sensor.noise_position, quantum), LEAST_POSITION)
    if sensor.filter_s > 0.0:
        weight = 1.0 - math.exp(-period / sensor.filter_s)
        counted = math.sqrt(2.0) * quantum / period * weight / math.sqrt(2.0 - weight)
        config.more_noise = math.hypot(counted, LAG_ACCELERATION * sensor.filter_s)
    config.late_ticks = round(sensor.latency_s / period)
    config.sensor_ticks = max(1, round(1.0 / (sensor.rate_hz * period))) if sensor.rate_hz > 0.0 else 1
    config.sensor_period = config.sensor_ticks * period
    config.drive_ticks = round((params.drive.delay_s + (params.drive.lag_s if by_effort else 0.0)) / period)
    if config.late_ticks + config.drive_ticks + 1 > MAX_LATENCY:
        raise InputError(
            "parameter joint_sensor.latency_s and drive.delay_s",
            got=f"{sensor.latency_s:g} + {params.drive.delay_s:g}",
            expected=f"together below {MAX_LATENCY * period:g} s",
            fix="raise control_period_s",
        )  # fmt: skip
    config.quick_ticks = max(1, round(3.0 * MEAN_S / config.sensor_period))
    config.weight = 1.0 - math.exp(-config.sensor_period / MEAN_S)
    config.gate = SIGNIFICANT * SIGNIFICANT * config.weight / (2.0 - config.weight)
    config.unmoved = DEVIATIONS * math.sqrt(2.0) * config.noise + 2.0 * sensor.quantum_position
    config.late = MEAN_S + sensor.filter_s
    late_s = sensor.latency_s + params.drive_lag_s + sensor.filter_s
    config.settling = SETTLES_AFTER * max(period, late_s)
    config.bound[:n], config.rate[:n] = model.limit * effort_limit, RATE * effort_limit
    config.collision[:n] = COLLISION * effort_limit
    config.friction[:n] = params.drive.of_joints("coulomb", n)
    fill_filters(buffer, sensor.noise_velocity if sensor.estimates else UNMEASURED_VELOCITY)
    return buffer
