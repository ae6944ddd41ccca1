"""The configuration of both nodes of the sensors: the bridge simulates it, the controller counts on it."""

from __future__ import annotations

from typing import Any, Final, Literal

from slip_core.params import ParameterModel, parameter

SlipInput = Literal["twist", "displacement", "flag"]
SLIP_INPUT: Final[Any] = parameter(
    "twist",
    "what the slip sensor reports. twist: slip velocity on `slip_velocity`; displacement: where the pad is on the "
    "object, on `slip_displacement`; flag: whether it slips, on `slip_flag`",
)


class SlipSensorModel(ParameterModel):
    """Slip velocity sensor: what is known of it; the launcher fills it from the sensor's preset."""

    rate_hz: float = parameter(0.0, "measuring rate; 0 measures at every control cycle", unit="Hz", ge=0.0)
    latency_s: float = parameter(0.0, "time from measurement to arrival", unit="s", ge=0.0)
    noise_linear: float = parameter(0.0, "standard deviation of each linear axis that can slip", unit="m/s", ge=0.0)
    noise_angular: float = parameter(0.0, "standard deviation of each angular axis that can slip", unit="rad/s", ge=0.0)
    quantum_linear: float = parameter(0.0, "step of the linear readings", unit="m/s", ge=0.0)
    dead_band_linear: float = parameter(0.0, "linear speed below which the sensor reads zero", unit="m/s", ge=0.0)
    dead_band_angular: float = parameter(0.0, "angular speed below which the sensor reads zero", unit="rad/s", ge=0.0)

    @property
    def period_s(self) -> float:
        """Time between samples; 0 for every control cycle [s]."""
        return 1.0 / self.rate_hz if self.rate_hz > 0.0 else 0.0


class WrenchSensorModel(ParameterModel):
    """Force and torque sensor at the pad centre: what is known of it."""

    noise_force: float = parameter(0.0, "standard deviation of each force axis", unit="N", ge=0.0)
    noise_torque: float = parameter(0.0, "standard deviation of each torque axis", unit="N m", ge=0.0)
