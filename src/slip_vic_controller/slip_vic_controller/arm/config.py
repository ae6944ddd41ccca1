"""From parameters to the joint state estimator: gains and covariance from the discrete Riccati equation."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_core.matrices import product, riccati, solve
from slip_core.records import new, record
from slip_vic_controller.arm.estimator import transition
from slip_vic_controller.arm.joint_estimate import ESTIMATOR_CONFIG, MAX_LATENCY, QUICK, EstimatorConfig, Trust
from slip_vic_controller.arm.plausibility import BIAS, DIFFERENCE, LATE_S, SIGNIFICANT, UNMOVED
from slip_vic_controller.arm.tare import Mean, Tare, deviation
from slip_vic_controller.params.arm_params import JointSensorConfig
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.sizes import MAX_JOINTS

DEVIATIONS, UNLIKELY = 6.0, 20.0
"""Standard deviations of positions that are no contradiction, and exponent of the chance that noise of the velocities
makes one in a sample."""
LEAST_POSITION, LEAST_VELOCITY = 2e-5, 1e-4
"""What is assumed of a sensor without noise [rad], [rad/s]."""
UNMEASURED_VELOCITY = 3e-3
"""What is assumed of a sensor until a tare has measured its noise, where none is configured [rad/s]."""
LAG_ACCELERATION: Final = 5.0
"""Acceleration at which the lag of a velocity filter counts as noise [rad/s^2]."""
MEAN_S, QUICK_S = 0.01, 0.03
"""Time over which innovations are averaged, and for which the quick filter stays."""

MODEL_NOISE, QUICK_DRIFT = 0.1, 100.0
"""Joint acceleration that the model leaves out, white, in every control period, and the drift of the disturbance where
friction turns round: standard deviations [rad/s^2]."""
SETTLES_AFTER, RATE = 5.0, 10.0
"""Of what is taken off: time constant with which it follows the estimate, over the control period, so that noise does
not shake the arm, and friction that turns round does not swing it; where arms share an object over all delays of the
loop, since each arm feels through the object what the other compensates. And fastest change, as a share of the joint's
effort limit [1/s]."""
COLLISION: Final = 0.3
"""Jump of the disturbance that is a collision, as a share of the joint's effort limit."""
LARGER: Final = 1.5
"""Measured noise over the configured one from which it is used: a spread of few samples is not exact."""


class Noise(NamedTuple):
    """Standard deviations of noise: position [rad], velocity [rad/s], acceleration in a period and its drift [rad/s^2].

    The drift is that of the disturbance after one second.
    """

    position: float
    velocity: float
    model: float
    drift: float


class SteadyState(NamedTuple):
    """A Kalman filter in steady state.

    F (3, 3); Q (3, 3); H (m, 3); predicted, updated: covariance before and after a sample (3, 3); gain (3, m).
    """

    F: Array
    Q: Array
    H: Array
    predicted: Array
    updated: Array
    gain: Array

    @property
    def change_variance(self) -> float:
        """Variance that the corrections add to the velocity in every period [(rad/s)^2]: (K S K^T)_vv."""
        return float((self.predicted - self.updated)[1, 1])


def process(noise: Noise, bandwidth: float, period: float) -> tuple[Array, Array]:
    """Return F and Q of (q, v, d) over a period [s]; bandwidth of a velocity drive [rad/s], 0 = efforts."""
    step = transition(bandwidth, period)
    F = np.array([[1.0, step.qv, step.qd], [0.0, step.vv, step.vd], [0.0, 0.0, 1.0]])
    white = noise.model * np.array([step.qd, step.vd, 0.0])
    return F, np.outer(white, white) + np.diag([0.0, 0.0, noise.drift**2 * period])


def process_over(noise: Noise, bandwidth: float, period: float, ticks: int) -> tuple[Array, Array]:
    """Return F and Q over a number of control periods; arguments as in `process`."""
    F, Q = process(noise, bandwidth, period)
    over, spread = F, Q
    for _ in range(ticks - 1):
        over, spread = product(F, over), product(F, spread, F.T) + Q
    return over, spread


def steady_state(noise: Noise, bandwidth: float, period: float, ticks: int = 1) -> SteadyState:
    """Return the filter of position and velocity that are new every `ticks` control periods."""
    F, Q = process_over(noise, bandwidth, period, ticks)
    return _filter(F, Q, np.eye(3)[:2], np.diag([noise.position**2, noise.velocity**2]))


def _filter(F: Array, Q: Array, H: Array, R: Array) -> SteadyState:
    P = riccati(F, H, Q, R)
    gain = solve(product(H, P, H.T) + R, product(H, P)).T
    kept = np.eye(len(F)) - product(gain, H)
    return SteadyState(F, Q, H, P, product(kept, P, kept.T) + product(gain, R, gain.T), gain)


def gains_by_trust(both: SteadyState, noise: Noise) -> Array:
    """Return the gains of the filter of both measurements, and of those of one of them alone, by Trust; (4, 3, 2).

    Position is not observable from velocity: it is integrated, v and d are filtered. By the model alone: zeros.
    """
    F, Q, gain = both.F, both.Q, np.zeros((len(Trust), 3, 2))
    gain[Trust.BOTH] = both.gain
    gain[Trust.POSITION, :, 0] = _filter(F, Q, both.H[:1], np.array([[noise.position**2]])).gain[:, 0]
    of_velocity = _filter(F[1:, 1:], Q[1:, 1:], np.eye(2)[:1], np.array([[noise.velocity**2]]))
    gain[Trust.VELOCITY, 1:, 1] = of_velocity.gain[:, 0]
    return gain


def predicted_covariance(steady: SteadyState, noise: Noise, bandwidth: float, period: float, ticks: int) -> Array:
    """Return the covariance of the estimate predicted so many control periods beyond the last sample; (3, 3)."""
    P, (F, Q) = steady.updated, process(noise, bandwidth, period)
    for _ in range(ticks):
        P = product(F, P, F.T) + Q
    return P


def sensor_noise(sensor: JointSensorConfig, period: float) -> tuple[float, float]:
    """Return the standard deviations of position [rad] and velocity [rad/s] that a sensor's numbers come to.

    A count is uniform noise. A velocity that is made of counts has the noise of their difference, less by its filter,
    and the filter's lag at LAG_ACCELERATION.
    """
    quantum = sensor.quantum_position / math.sqrt(12.0)
    position = max(math.hypot(sensor.noise_position, quantum), LEAST_POSITION)
    velocity = sensor.noise_velocity if sensor.estimates else UNMEASURED_VELOCITY
    if sensor.filter_s > 0.0:
        weight = 1.0 - math.exp(-period / sensor.filter_s)
        counted = math.sqrt(2.0) * quantum / period * weight / math.sqrt(2.0 - weight)
        velocity = math.hypot(velocity, counted, LAG_ACCELERATION * sensor.filter_s)
    return position, max(velocity, LEAST_VELOCITY)


def with_measured_noise(params: ControllerParams, tare: Tare) -> ControllerParams:
    """Return the parameters with the noise that a tare has measured so far, where it is larger than what is configured.

    Before the tare is done that is the noise of the joint velocities alone, from their differences.
    """

    def spread(mean: Mean) -> Array:
        return np.array([deviation(mean, k) for k in range(MAX_JOINTS)])

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


class Tuning(NamedTuple):
    """What a filter of a joint is made for: noise, bandwidth of velocity drives [rad/s], periods between samples."""

    noise: Noise
    bandwidth: float
    ticks: int


def tuning_of(params: ControllerParams) -> Tuning:
    """Return what the filter of a joint is made for."""
    sensor, model, period = params.joint_sensor, params.disturbance, params.control_period_s
    noise = Noise(*sensor_noise(sensor, period), MODEL_NOISE, model.drift)
    ticks = max(1, round(1.0 / (sensor.rate_hz * period))) if sensor.rate_hz > 0.0 else 1
    return Tuning(noise, 0.0 if params.command.interface == "effort" else params.drive.bandwidth, ticks)


def estimator_config(params: ControllerParams, effort_limit: Array) -> Array:
    """Return the EstimatorConfig buffer; effort_limit (n,) [N m].

    Raises:
        InputError: the latency is more than MAX_LATENCY control periods.
    """
    buffer = new(ESTIMATOR_CONFIG)
    config: EstimatorConfig = record(buffer, ESTIMATOR_CONFIG)
    sensor, model, period, n = params.joint_sensor, params.disturbance, params.control_period_s, len(effort_limit)
    config.joints, config.period = n, period
    by_effort, (noise, config.bandwidth, ticks) = params.command.interface == "effort", tuning_of(params)
    config.on = int(params.estimates_joints)
    config.late_ticks = round(sensor.latency_s / period)
    config.sensor_ticks, config.sensor_period = ticks, ticks * period
    config.drive_ticks = round((params.drive.delay_s + (params.drive.lag_s if by_effort else 0.0)) / period)
    if config.late_ticks + config.drive_ticks + 1 > MAX_LATENCY:
        raise InputError(
            "parameter joint_sensor.latency_s and drive.delay_s",
            got=f"{sensor.latency_s:g} + {params.drive.delay_s:g}",
            expected=f"together below {MAX_LATENCY * period:g} s",
            fix="raise control_period_s",
        )  # fmt: skip
    both = steady_state(noise, config.bandwidth, period, ticks)
    config.gain[: len(Trust)], H = gains_by_trust(both, noise), both.H
    quick = noise._replace(drift=max(QUICK_DRIFT, model.drift))
    config.gain[QUICK] = steady_state(quick, config.bandwidth, period, ticks).gain
    S = product(H, both.predicted, H.T) + np.diag([noise.position**2, noise.velocity**2])
    config.quick_ticks = max(1, round(QUICK_S / config.sensor_period))
    config.scale[:], config.weight = 1.0 / np.sqrt(np.diag(S)), 1.0 - math.exp(-config.sensor_period / MEAN_S)
    config.gate = SIGNIFICANT * SIGNIFICANT * config.weight / (2.0 - config.weight)
    ahead = predicted_covariance(both, noise, config.bandwidth, period, config.late_ticks)
    config.velocity_variance, config.change_variance = ahead[1, 1], both.change_variance
    # The sum diffuses with noise of the velocities: its chance to be at S is exp(-2 BIAS S / (noise^2 period)).
    diffused = UNLIKELY * noise.velocity**2 * config.sensor_period / (2.0 * BIAS)
    config.difference = max(DIFFERENCE, diffused) + DEVIATIONS * math.sqrt(2.0) * noise.position
    config.late = LATE_S + sensor.filter_s
    config.unmoved = max(UNMOVED, 2.0 * sensor.quantum_position)
    late_s = sensor.latency_s + params.drive_lag_s + sensor.filter_s
    config.settling = SETTLES_AFTER * max(period, late_s)
    config.bound[:n], config.rate[:n] = model.limit * effort_limit, RATE * effort_limit
    config.collision[:n] = COLLISION * effort_limit
    config.friction[:n] = params.drive.of_joints("coulomb", n)
    return buffer
