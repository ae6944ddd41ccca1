"""Noise of the sensors in a CONFIG, and that which a tare has measured where it is larger than what is configured."""

from __future__ import annotations

import math
from typing import Final

from slip_core.arrays import Array
from slip_core.compiled import IN1, OUT1, VOID, kernel, part
from slip_core.records import place, record
from slip_vic_controller.arm.tare import deviation
from slip_vic_controller.config.joints import DEVIATIONS, LEAST_VELOCITY, fill_filters
from slip_vic_controller.config.observer import fill_variances
from slip_vic_controller.governor.layouts import GovernorConfig
from slip_vic_controller.sizes import MAX_JOINTS
from slip_vic_controller.state import ARM_STATE, CONFIG

LARGER: Final = 1.5
"""Measured noise over the configured one from which it is used: a spread of few samples is not exact."""
_ESTIMATOR = place(CONFIG, "estimator")
_BEGIN, _END = _ESTIMATOR.start, _ESTIMATOR.stop


@part
def _larger(measured: float, configured: float) -> float:
    return measured if measured > LARGER * configured else configured


@part
def fill_threshold(governor: GovernorConfig, linear: float, angular: float) -> None:
    """Fill in the slip speed that counts with noise of the slip sensor, standard deviations [m/s], [rad/s]."""
    turning = governor.radius * angular
    noise = math.sqrt(2.0 * linear * linear + turning * turning)
    governor.friction.threshold = max(governor.friction.least_threshold, DEVIATIONS * noise)


@kernel(VOID, OUT1, IN1)
def use_tare(config: Array, state: Array) -> None:
    """Use the noise that a tare has measured so far, where it is larger than what is configured.

    Before the tare is done that is the noise of the joint velocities alone, from their differences.

    Args:
        config: CONFIG of the arm; changed.
        state: its ARM_STATE.
    """
    c, tare = record(config, CONFIG), record(state, ARM_STATE).tare
    velocity, linear, angular, force, torque = LEAST_VELOCITY, 0.0, 0.0, 0.0, 0.0
    for j in range(MAX_JOINTS):
        change = deviation(tare.change, j) / math.sqrt(2.0 / c.estimator.sensor_ticks)
        velocity = max(velocity, change if tare.done == 0 else deviation(tare.velocity, j))
    for k in range(3 if tare.done != 0 else 0):
        linear = max(linear, c.governor.slip_axes[k] * deviation(tare.slip, k))
        angular = max(angular, c.governor.slip_axes[3 + k] * deviation(tare.slip, 3 + k))
        force, torque = max(force, deviation(tare.wrench, k)), max(torque, deviation(tare.wrench, 3 + k))
    linear, angular = _larger(linear, c.tare.noise_linear), _larger(angular, c.tare.noise_angular)
    force, torque = _larger(force, c.tare.noise_force), _larger(torque, c.tare.noise_torque)
    if c.has_observer != 0:
        fill_variances(c.observer, linear, angular, force, torque)
    fill_filters(config[_BEGIN:_END], _larger(velocity, c.tare.noise_velocity))
    fill_threshold(c.governor, linear, angular)
