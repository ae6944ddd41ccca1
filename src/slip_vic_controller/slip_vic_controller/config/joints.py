"""From parameters to the joint state estimator: gains and covariance from the discrete Riccati equation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from slip_core.arrays import Array, product, riccati, solve
from slip_core.errors import InputError
from slip_core.records import new, record
from slip_core.vectors import interpreted
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
from slip_vic_controller.arm.tare import Mean, Tare, deviation
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.sizes import MAX_JOINTS

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
LARGER: Final = 1.5
"""Measured noise over the configured one from which it is used: a spread of few samples is not exact."""


class Tuning(NamedTuple):
    """What the filter of a joint is made for.

    position, velocity: standard deviations of their noise [rad], [rad/s]; drift: of the disturbance after one second
    [rad/s^2]; bandwidth: of a velocity drive [rad/s], 0 = efforts; period: of control [s]; ticks: control periods after
    which a sample is new.
    """

    position: float
    velocity: float
    drift: float
    bandwidth: float
    period: float
    ticks: int = 1


class SteadyState(NamedTuple):
    """A Kalman filter in steady state: covariance before and after a sample (3, 3), and its gain (3, 2)."""

    predicted: Array
    updated: Array
    gain: Array

    @property
    def change_variance(self) -> float:
        """Variance that the corrections add to the velocity in every period [(rad/s)^2]: (K S K^T)_vv."""
        return float((self.predicted - self.updated)[1, 1])


def predict(tuning: Tuning, P: Array, ticks: int) -> tuple[Array, Array]:
    """Return F of (q, v, d) over a number of control periods, and a covariance P after them; (3, 3), (3, 3)."""
    step, over = interpreted(transition)(tuning.bandwidth, tuning.period), np.eye(3)
    F = np.array([[1.0, step.qv, step.qd], [0.0, step.vv, step.vd], [0.0, 0.0, 1.0]])
    white = MODEL_NOISE * np.array([step.qd, step.vd, 0.0])
    Q = np.outer(white, white) + np.diag([0.0, 0.0, tuning.drift**2 * tuning.period])
    for _ in range(ticks):
        over, P = product(F, over), product(F, P, F.T) + Q
    return over, P


def steady_state(tuning: Tuning, measured: Sequence[int] = (0, 1)) -> SteadyState:
    """Return the filter of a joint of which position (0), velocity (1) or both are measured.

    Position is not observable from velocity: it is integrated, v and d are filtered.
    """
    rows, first = list(measured), measured[0]
    F, Q = (A[first:, first:] for A in predict(tuning, np.zeros((3, 3)), tuning.ticks))
    H, R = np.eye(3)[rows, first:], np.diag([tuning[k] ** 2 for k in rows])
    P, gain = riccati(F, H, Q, R), np.zeros((3, 2))
    K = solve(product(H, P, H.T) + R, product(H, P)).T
    kept = np.eye(len(F)) - product(K, H)
    gain[first:, rows] = K
    return SteadyState(P, product(kept, P, kept.T) + product(K, R, K.T), gain)


def tuning_of(params: ControllerParams) -> Tuning:
    """Return the assumptions of a joint's filter.

    A count is uniform noise. A velocity that is made of counts has the noise of their difference, less by its filter,
    and the filter's lag at LAG_ACCELERATION.
    """
    sensor, period = params.joint_sensor, params.control_period_s
    quantum = sensor.quantum_position / math.sqrt(12.0)
    position = max(math.hypot(sensor.noise_position, quantum), LEAST_POSITION)
    velocity = sensor.noise_velocity if sensor.estimates else UNMEASURED_VELOCITY
    if sensor.filter_s > 0.0:
        weight = 1.0 - math.exp(-period / sensor.filter_s)
        counted = math.sqrt(2.0) * quantum / period * weight / math.sqrt(2.0 - weight)
        velocity = math.hypot(velocity, counted, LAG_ACCELERATION * sensor.filter_s)
    bandwidth = 0.0 if params.command.interface == "effort" else params.drive.bandwidth
    ticks = max(1, round(1.0 / (sensor.rate_hz * period))) if sensor.rate_hz > 0.0 else 1
    return Tuning(position, max(velocity, LEAST_VELOCITY), params.disturbance.drift, bandwidth, period, ticks)


def with_measured_noise(params: ControllerParams, tare: Tare) -> ControllerParams:
    """Return the parameters with the noise that a tare has measured so far, where it is larger than what is configured.

    Before the tare is done that is the noise of the joint velocities alone, from their differences.
    """

    def spread(mean: Mean) -> Array:
        return np.array([interpreted(deviation)(mean, k) for k in range(MAX_JOINTS)])

    velocity = spread(tare.velocity) if tare.done else spread(tare.change) / math.sqrt(2.0 / tuning_of(params).ticks)
    found = {"joint_sensor": {"noise_velocity": max(velocity.max(), LEAST_VELOCITY)}}
    if tare.done:
        slip, wrench = spread(tare.slip)[:6] * params.contacts.slip_axes[:6], spread(tare.wrench)
        found["slip_sensor"] = {"noise_linear": slip[:3].max(), "noise_angular": slip[3:].max()}
        found["wrench_sensor"] = {"noise_force": wrench[:3].max(), "noise_torque": wrench[3:6].max()}
    groups = {}
    for group, numbers in found.items():
        of = getattr(params, group)
        more = {name: float(value) for name, value in numbers.items() if value > LARGER * getattr(of, name)}
        groups[group] = of.model_copy(update=more)
    return params.model_copy(update=groups)


def estimator_config(params: ControllerParams, effort_limit: Array) -> Array:
    """Return the EstimatorConfig buffer; effort_limit (n,) [N m].

    Raises:
        InputError: the latency is more than MAX_LATENCY control periods.
    """
    buffer = new(ESTIMATOR_CONFIG)
    config: EstimatorConfig = record(buffer, ESTIMATOR_CONFIG)
    sensor, model, n = params.joint_sensor, params.disturbance, len(effort_limit)
    by_effort, tuning = params.command.interface == "effort", tuning_of(params)
    config.joints, config.period, config.bandwidth = n, tuning.period, tuning.bandwidth
    config.on, period = int(params.estimates_joints), tuning.period
    config.late_ticks = round(sensor.latency_s / period)
    config.sensor_ticks, config.sensor_period = tuning.ticks, tuning.ticks * period
    config.drive_ticks = round((params.drive.delay_s + (params.drive.lag_s if by_effort else 0.0)) / period)
    if config.late_ticks + config.drive_ticks + 1 > MAX_LATENCY:
        raise InputError(
            "parameter joint_sensor.latency_s and drive.delay_s",
            got=f"{sensor.latency_s:g} + {params.drive.delay_s:g}",
            expected=f"together below {MAX_LATENCY * period:g} s",
            fix="raise control_period_s",
        )  # fmt: skip
    both = steady_state(tuning)
    config.gain[Trust.BOTH] = both.gain
    config.gain[Trust.POSITION], config.gain[Trust.VELOCITY] = (steady_state(tuning, (k,)).gain for k in range(2))
    config.gain[QUICK] = steady_state(tuning._replace(drift=max(QUICK_DRIFT, model.drift))).gain
    S = np.diag(both.predicted)[:2] + np.array(tuning[:2]) ** 2
    config.quick_ticks = max(1, round(3.0 * MEAN_S / config.sensor_period))
    config.scale[:], config.weight = 1.0 / np.sqrt(S), 1.0 - math.exp(-config.sensor_period / MEAN_S)
    config.gate = SIGNIFICANT * SIGNIFICANT * config.weight / (2.0 - config.weight)
    _, ahead = predict(tuning, both.updated, config.late_ticks)
    config.velocity_variance, config.change_variance = ahead[1, 1], both.change_variance
    # The sum diffuses with noise of the velocities: its chance to be at S is exp(-2 BIAS S / (noise^2 period)), that
    # of a sample beyond DEVIATIONS about exp(-DEVIATIONS^2 / 2).
    diffused = (DEVIATIONS * tuning.velocity) ** 2 * config.sensor_period / (4.0 * BIAS)
    shown = DEVIATIONS * math.sqrt(2.0) * tuning.position
    config.difference, config.unmoved = max(DIFFERENCE, diffused) + shown, shown + 2.0 * sensor.quantum_position
    config.late = MEAN_S + sensor.filter_s
    late_s = sensor.latency_s + params.drive_lag_s + sensor.filter_s
    config.settling = SETTLES_AFTER * max(period, late_s)
    config.bound[:n], config.rate[:n] = model.limit * effort_limit, RATE * effort_limit
    config.collision[:n] = COLLISION * effort_limit
    config.friction[:n] = params.drive.of_joints("coulomb", n)
    return buffer
