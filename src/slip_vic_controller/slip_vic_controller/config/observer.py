"""From parameters to the numbers of the slip observer."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import interpreted, part
from slip_core.records import new, record
from slip_vic_controller.contact.observer import CONTRADICTIONS, OBSERVER_CONFIG, ObserverConfig
from slip_vic_controller.params.controller_params import ControllerParams


class Tuning(NamedTuple):
    """What the observer is tuned with; noise of the sensors comes from their parameters.

    Of pairs the first is linear, the second angular.
    """

    false_alarm_rate: float = 1e-8  # probability, per tick in stick, that slip is declared: once a day at 1 kHz
    stick_share: float = 0.8  # share of noise that stays below the normalised square at which slip is over
    dwell_s: float = 0.005  # s; how long slip must be insignificant before it is over
    window_s: float = 0.04  # s; over which the model must show slip before it is declared
    memory_s: float = 0.3  # s; largest delay of a slip sample that is still used
    smoothing: float = 0.25  # weight of a new sample in the mean that is tested in stick
    outlier: float = 5.0  # standard deviations at which the influence of a sample is limited
    model_error: float = 0.2  # expected relative error of mass, inertia and centre of mass
    process_noise: tuple[float, float] = (0.003, 0.03)  # m/s^2, rad/s^2; of the model at every tick, white
    drift: tuple[float, float] = (0.003, 0.15)  # m/s^2, rad/s^2; random walk of the model's error after one second
    least_slip: tuple[float, float] = (5e-5, 2e-3)  # m/s, rad/s; standard deviation below which nothing is significant
    stick_acceleration: tuple[float, float] = (0.006, 0.3)  # m/s^2, rad/s^2; of the model's error, to accept stick
    stick_speed: tuple[float, float] = (6e-4, 0.1)  # m/s, rad/s; of the slip velocity, to accept stick
    drag_spread: float = 0.3  # rad; standard deviation of the angle between friction and slip, 0 = direction not used
    drag_memory_s: float = 0.03  # s; correlation time of its error


TUNING: Final = Tuning()


def slip_count(params: ControllerParams) -> int:
    """Return how many slip samples in a row count as slip: a real sensor has outliers, a flag has none.

    A sensor that is configured as perfect needs no second sample, unless the arm is not: then neither is perfect.
    """
    sensor = params.slip_sensor
    perfect = max(sensor.noise_linear, sensor.noise_angular, sensor.quantum_linear) == 0.0
    return 1 if (perfect and not params.estimates_joints) or params.slip_input == "flag" else CONTRADICTIONS


def observer_config(params: ControllerParams, tuning: Tuning = TUNING) -> Array:
    """Return the OBSERVER_CONFIG buffer: variances and thresholds that follow from the configured noise levels.

    Noise of the wrench enters the slip velocity once per tick, divided by mass or inertia.
    """
    sensor, wrench, model = params.slip_sensor, params.wrench_sensor, params.object
    T = params.control_period_s
    lever = math.hypot(*params.contacts.position[:3])
    inertia = float(np.min(model.inertia[:3]))

    def accelerations(force: float, torque: float) -> tuple[float, float]:
        """What a force and a torque accelerate the object's point under the pad by; [m/s^2], [rad/s^2]."""
        angular = math.hypot(torque, lever * force) / inertia
        return math.hypot(force / model.mass, lever * angular), angular

    of_force, of_torque = accelerations(1.0, 0.0), accelerations(0.0, 1.0)
    bias = accelerations(wrench.bias_force, wrench.bias_torque)
    root_T = math.sqrt(T)
    # A centre of mass that is off by model_error of the lever turns a force into an angular acceleration.
    onset = tuning.model_error * lever * model.mass / inertia

    deviations = {  # linear, angular
        "model_variance": (T * tuning.process_noise[0], T * tuning.process_noise[1]),
        "of_force": (T * of_force[0], T * of_force[1]),
        "of_torque": (T * of_torque[0], T * of_torque[1]),
        "drift_variance": (root_T * tuning.drift[0], root_T * tuning.drift[1]),
        "floor_variance": tuning.least_slip,
        "stick_P_bb": tuning.stick_acceleration,
        "stick_P_vv": tuning.stick_speed,
        "prior_P_bb": (wrench.bias_force / model.mass, bias[1]),
        "prior_P_cc": (tuning.model_error, tuning.model_error),
    }

    # scipy.stats has the same under a clearer name, and takes half a second to import; this is 4 MiB.
    from scipy.special import chdtri

    buffer = new(OBSERVER_CONFIG)
    config: ObserverConfig = record(buffer, OBSERVER_CONFIG)
    for name, (linear, angular) in deviations.items():
        of_axes = getattr(config, name)
        of_axes[:3], of_axes[3:] = linear**2, angular**2
    config.axes[:] = params.contacts.slip_axes[:6]  # of the own contact
    config.onset_gain[:3], config.onset_gain[3:] = lever * onset, onset
    config.dead_band[:3], config.dead_band[3:] = sensor.dead_band_linear, sensor.dead_band_angular
    count = max(int(np.sum(config.axes)), 1)
    config.nis_slip = float(chdtri(count, tuning.false_alarm_rate))
    config.nis_stick = float(chdtri(count, 1.0 - tuning.stick_share))
    needed = slip_count(params)  # so many samples shift the mean beyond what is significant, one less does not
    config.most_step = 1.0 / (needed - 0.5) if needed > 1 else math.inf
    config.quantum = sensor.quantum_linear
    interpreted(fill_variances)(
        config, sensor.noise_linear, sensor.noise_angular, wrench.noise_force, wrench.noise_torque
    )
    config.mean_share = tuning.smoothing / (2.0 - tuning.smoothing)
    config.smoothing, config.outlier_deviations = tuning.smoothing, tuning.outlier
    config.friction_spread, config.friction_memory_ticks = tuning.drag_spread, tuning.drag_memory_s / T
    config.dwell_ticks = max(1, round(tuning.dwell_s / T))
    config.window_ticks = max(1, round(tuning.window_s / T))
    config.memory_ns = round(tuning.memory_s * 1e9)
    buffer.setflags(write=False)
    return buffer


@part
def fill_variances(config: ObserverConfig, linear: float, angular: float, force: float, torque: float) -> None:
    """Fill in what follows from noise of slip [m/s], [rad/s] and wrench [N], [N m], standard deviations."""
    for j in range(6):
        slip = linear * linear + config.quantum * config.quantum if j < 3 else angular * angular
        of_wrench = force * force * config.of_force[j] + torque * torque * config.of_torque[j]
        config.measurement_variance[j] = max(slip, config.floor_variance[j])
        config.process_variance[j] = config.model_variance[j] + of_wrench
        config.information[j] = config.axes[j] / config.measurement_variance[j]


def capacity(params: ControllerParams, tuning: Tuning = TUNING) -> int:
    """Return how many rows the history needs: ticks of the memory, or the window in stick."""
    return math.ceil(max(tuning.memory_s, tuning.window_s) / params.control_period_s) + 2
