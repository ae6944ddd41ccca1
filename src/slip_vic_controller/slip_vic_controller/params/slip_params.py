"""Parameters of the slip estimate: what is known of the wrench sensor."""

from __future__ import annotations

from slip_core import device_params
from slip_core.params import parameter


class WrenchSensorModel(device_params.WrenchSensorModel):
    """What is known of the wrench sensor, and by how much it may be off."""

    bias_force: float = parameter(0.1, "expected size of a constant force error", unit="N", gt=0.0)
    bias_torque: float = parameter(2e-3, "expected size of a constant torque error", unit="N m", gt=0.0)
