"""From parameters to the numbers of the slip observer."""

from __future__ import annotations

import math

import numpy as np
from scipy.special import chdtri  # scipy.stats has the same under a clearer name, and takes half a second to import

from slip_vic_controller.core.observer_types import ObserverConfig
from slip_vic_controller.core.params import ControllerParams


def observer_config(params: ControllerParams) -> ObserverConfig:
    """Return the variances and thresholds that follow from the configured noise levels.

    Implements: ours: noise of the wrench enters the slip velocity once per tick, divided by mass or inertia.
    """
    tuning, sensor, wrench, model = params.observer, params.slip_sensor, params.wrench_sensor, params.object
    T = params.control_period_s
    axes = tuple(i for i in range(6) if params.contacts.slip_axes[i])
    lever = math.hypot(*params.contacts.position[:3])
    inertia = float(np.min(model.inertia[:3]))

    def both(linear: float, angular: float) -> tuple[float, ...]:
        """Squares of the two numbers, per axis."""
        return tuple((linear if i < 3 else angular) ** 2 for i in axes)

    def accelerations(force: float, torque: float) -> tuple[float, float]:
        angular = math.hypot(torque, lever * force) / inertia
        return math.hypot(force / model.mass, lever * angular), angular

    noise = accelerations(wrench.noise_force, wrench.noise_torque)
    bias = accelerations(wrench.bias_force, wrench.bias_torque)
    root_T = math.sqrt(T)
    # A centre of mass that is off by model_error of the lever turns a force into an angular acceleration.
    onset = tuning.model_error * lever * model.mass / inertia
    return ObserverConfig(
        axes=axes,
        noise=both(
            max(math.hypot(sensor.noise_linear, sensor.quantum_linear), tuning.min_slip_std_m_s),
            max(sensor.noise_angular, tuning.min_slip_std_rad_s),
        ),
        force_noise=both(
            T * math.hypot(noise[0], tuning.process_noise_linear),
            T * math.hypot(noise[1], tuning.process_noise_angular),
        ),
        floor=both(tuning.min_slip_std_m_s, tuning.min_slip_std_rad_s),
        rest=both(tuning.stick_acceleration_std_m_s2, tuning.stick_acceleration_std_rad_s2),
        prior_b=both(wrench.bias_force / model.mass, bias[1]),
        prior_c=both(tuning.model_error, tuning.model_error),
        drift_b=both(root_T * tuning.drift_linear, root_T * tuning.drift_angular),
        onset_b=tuple(lever * onset if i < 3 else onset for i in axes),
        calm=both(tuning.stick_speed_std_m_s, tuning.stick_speed_std_rad_s),
        dead_band=(sensor.dead_band_linear, sensor.dead_band_angular),
        chi_on=float(chdtri(max(len(axes), 1), tuning.false_alarm_rate)),
        chi_off=float(chdtri(max(len(axes), 1), 1.0 - tuning.stick_share)),
        dwell=max(1, round(tuning.dwell_s / T)),
        memory_ns=round(tuning.memory_s * 1e9),
        smoothing=tuning.smoothing,
        window=max(1, round(tuning.window_s / T)),
        outlier=tuning.outlier,
        drag_spread=tuning.drag_spread,
        drag_memory=tuning.drag_memory_s / T,
    )
