"""Parameters of the slip estimate: what is known of the wrench sensor, and the dead band of measured slip."""

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
