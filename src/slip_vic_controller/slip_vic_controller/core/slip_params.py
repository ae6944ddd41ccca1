"""Parameters of what the controller knows of its slip: the sensor, the estimator and its tuning."""

from __future__ import annotations

from slip_core.params import ParameterModel, parameter


class SlipSensorModel(ParameterModel):
    """What is known of the slip sensor; the launcher fills it from the sensor's preset."""

    rate_hz: float = parameter(0.0, "measuring rate; 0 = at every tick", unit="Hz", ge=0.0)
    latency_s: float = parameter(0.0, "time from measurement to arrival", unit="s", ge=0.0)
    noise_linear: float = parameter(0.0, "standard deviation of each linear axis", unit="m/s", ge=0.0)
    noise_angular: float = parameter(0.0, "standard deviation of each angular axis", unit="rad/s", ge=0.0)
    quantum_linear: float = parameter(0.0, "step of the linear readings", unit="m/s", ge=0.0)
    dead_band_linear: float = parameter(0.0, "linear speed below which the sensor reads zero", unit="m/s", ge=0.0)
    dead_band_angular: float = parameter(0.0, "angular speed below which the sensor reads zero", unit="rad/s", ge=0.0)

    @property
    def period_s(self) -> float:
        """Time between samples; 0 for every tick [s]."""
        return 1.0 / self.rate_hz if self.rate_hz > 0.0 else 0.0


class WrenchSensorModel(ParameterModel):
    """What is known of the wrench sensor."""

    noise_force: float = parameter(0.0, "standard deviation of each force axis", unit="N", ge=0.0)
    noise_torque: float = parameter(0.0, "standard deviation of each torque axis", unit="N m", ge=0.0)
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

    false_alarm_rate: float = parameter(1e-8, "share of ticks in stick that may be taken for slip", gt=0.0, lt=0.1)
    stick_share: float = parameter(
        0.8, "slip is over when its significance is where noise alone is with this probability", gt=0.0, lt=1.0
    )
    dwell_s: float = parameter(0.005, "how long slip must be insignificant until it is over", unit="s", ge=0.0)
    window_s: float = parameter(
        0.04, "time over which the model must show slip before it is believed", unit="s", gt=0.0
    )
    memory_s: float = parameter(0.3, "how late a slip sample may come and still be used", unit="s", gt=0.0)
    smoothing: float = parameter(
        0.25, "weight of a new sample in the mean of samples that is tested in stick", gt=0.0, le=1.0
    )
    outlier: float = parameter(5.0, "deviations beyond which a sample pulls no harder", gt=0.0)
    model_error: float = parameter(0.2, "expected relative error of mass, inertia and centre of mass", ge=0.0, lt=1.0)
    rough_linear: float = parameter(
        0.003, "what the model leaves out, per tick as white noise; linear", unit="m/s^2", gt=0.0
    )
    rough_angular: float = parameter(0.03, "and angular", unit="rad/s^2", gt=0.0)
    drift_linear: float = parameter(
        0.003, "random walk of the acceleration error, linear, in the root of a second", unit="m/s^2", ge=0.0
    )
    drift_angular: float = parameter(0.15, "and angular", unit="rad/s^2", ge=0.0)
    floor_linear: float = parameter(5e-5, "slip speed that never means anything, linear", unit="m/s", gt=0.0)
    floor_angular: float = parameter(2e-3, "and angular", unit="rad/s", gt=0.0)
    rest_linear: float = parameter(
        0.006,
        "doubt about the object's acceleration above which nothing is taken for rest, linear",
        unit="m/s^2",
        gt=0.0,
    )
    rest_angular: float = parameter(0.3, "and angular", unit="rad/s^2", gt=0.0)
    calm_linear: float = parameter(
        6e-4, "doubt about the slip speed above which nothing is taken for rest, linear", unit="m/s", gt=0.0
    )
    calm_angular: float = parameter(0.1, "and angular", unit="rad/s", gt=0.0)
    drag_spread: float = parameter(
        0.3, "how far friction may point away from the slip, as a share of its speed; 0 = do not use its direction",
        unit="rad", ge=0.0,
    )  # fmt: skip
    drag_memory_s: float = parameter(0.03, "time over which that error stays the same", unit="s", gt=0.0)
    correct_follow: bool = parameter(
        True, "use the estimated error of the object's acceleration in the compensation too"
    )
