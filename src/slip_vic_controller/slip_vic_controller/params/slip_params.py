"""Parameters of the slip estimate: what is known of the sensors, which estimator, and its parameters."""

from __future__ import annotations

from slip_core import device_params
from slip_core.params import ParameterModel, parameter


class WrenchSensorModel(device_params.WrenchSensorModel):
    """What is known of the wrench sensor, and by how much it may be off."""

    bias_force: float = parameter(0.1, "expected size of a constant force error", unit="N", gt=0.0)
    bias_torque: float = parameter(2e-3, "expected size of a constant torque error", unit="N m", gt=0.0)


class MeasuredParams(ParameterModel):
    """slip_estimator measured: the newest sample as it is."""

    dead_band_linear: float = parameter(
        0.0, "linear slip speed that counts as none; 0 = the printed law", unit="m/s", ge=0.0
    )
    dead_band_angular: float = parameter(
        0.0, "angular slip speed that counts as none; 0 = the printed law", unit="rad/s", ge=0.0
    )


class ObserverParams(ParameterModel):
    """slip_estimator observer: tuning; noise levels come from slip_sensor and wrench_sensor."""

    false_alarm_rate: float = parameter(1e-8, "probability, per tick in stick, that slip is declared", gt=0.0, lt=0.1)
    stick_share: float = parameter(
        0.8,
        "slip is over when its normalised square is below the value that noise alone stays below with this probability",
        gt=0.0,
        lt=1.0,
    )
    dwell_s: float = parameter(0.005, "how long slip must be insignificant before it is over", unit="s", ge=0.0)
    window_s: float = parameter(
        0.04, "time over which the model must show slip before slip is declared", unit="s", gt=0.0
    )
    memory_s: float = parameter(0.3, "largest delay of a slip sample that is still used", unit="s", gt=0.0)
    smoothing: float = parameter(
        0.25, "weight of a new sample in the running mean of samples that is tested in stick", gt=0.0, le=1.0
    )
    outlier: float = parameter(
        5.0, "number of standard deviations at which the influence of a sample is limited", gt=0.0
    )
    model_error: float = parameter(0.2, "expected relative error of mass, inertia and centre of mass", ge=0.0, lt=1.0)
    process_noise_linear: float = parameter(
        0.003,
        "standard deviation of the linear acceleration that the model leaves out, white, at every tick",
        unit="m/s^2",
        gt=0.0,
    )
    process_noise_angular: float = parameter(
        0.03,
        "standard deviation of the angular acceleration that the model leaves out, white, at every tick",
        unit="rad/s^2",
        gt=0.0,
    )
    drift_linear: float = parameter(
        0.003,
        "random walk of the model's linear acceleration error: its standard deviation after one second",
        unit="m/s^2",
        ge=0.0,
    )
    drift_angular: float = parameter(
        0.15,
        "random walk of the model's angular acceleration error: its standard deviation after one second",
        unit="rad/s^2",
        ge=0.0,
    )
    min_slip_std_m_s: float = parameter(
        5e-5,
        "smallest standard deviation that is assumed of a linear slip speed, so that less is never significant",
        unit="m/s",
        gt=0.0,
    )
    min_slip_std_rad_s: float = parameter(
        2e-3,
        "smallest standard deviation that is assumed of an angular slip speed, so that less is never significant",
        unit="rad/s",
        gt=0.0,
    )
    stick_acceleration_std_m_s2: float = parameter(
        0.006,
        "stick is accepted only while the standard deviation of the model's linear acceleration error is below this",
        unit="m/s^2",
        gt=0.0,
    )
    stick_acceleration_std_rad_s2: float = parameter(
        0.3,
        "stick is accepted only while the standard deviation of the model's angular acceleration error is below this",
        unit="rad/s^2",
        gt=0.0,
    )
    stick_speed_std_m_s: float = parameter(
        6e-4,
        "stick is accepted only while the standard deviation of the linear slip speed is below this",
        unit="m/s",
        gt=0.0,
    )
    stick_speed_std_rad_s: float = parameter(
        0.1,
        "stick is accepted only while the standard deviation of the angular slip speed is below this",
        unit="rad/s",
        gt=0.0,
    )
    drag_spread: float = parameter(
        0.3,
        "standard deviation of the angle between friction and slip; 0 = do not use the direction of friction",
        unit="rad",
        ge=0.0,
    )
    drag_memory_s: float = parameter(0.03, "correlation time of the error of friction's direction", unit="s", gt=0.0)
