"""Parameters of the joint state estimator: the joint sensor, and what the model of the arm leaves out."""

from __future__ import annotations

import math

from slip_core.device_params import JointSensorModel
from slip_core.params import ParameterModel, parameter


class JointSensorConfig(JointSensorModel):
    """Joint sensor, as configured; the launcher fills it from the drive's preset.

    Without noise of the velocities and without a quantum the samples are used as they are, and nothing is estimated.
    """

    @property
    def estimates(self) -> bool:
        """Whether the joint state is estimated: where something is known of the noise."""
        return self.noise_velocity > 0.0 or self.quantum_position > 0.0

    @property
    def filter_s(self) -> float:
        """Time constant of the filter of velocities, 0 without one [s]."""
        return 1.0 / (2.0 * math.pi * self.velocity_filter_hz) if self.velocity_filter_hz > 0.0 else 0.0


class TareParams(ParameterModel):
    """Tare at rest: bias and noise of the sensors, measured in HOLD before the law begins."""

    duration_s: float = parameter(
        0.0, "time at rest over which the sensors are read; 0 = they are used as they are", unit="s", ge=0.0, le=10.0
    )
    slip: tuple[float, float] = parameter(
        (0.02, 0.3), "largest bias of the slip velocity that is taken out, linear and angular", unit="m/s, rad/s"
    )
    wrench: tuple[float, float] = parameter(
        (0.3, 0.03), "largest bias of force and torque that is taken out", unit="N, N m"
    )
    mass_share: float = parameter(
        0.5,
        "share of object.mass by which the weight on the wrench sensor may differ; the law uses the measured mass",
        ge=0.0,
        lt=1.0,
    )


class DisturbanceParams(ParameterModel):
    """Joint accelerations that the model of the arm leaves out: friction, torque offset, a push."""

    drift: float = parameter(
        3.0, "random walk of the disturbance: its standard deviation after one second", unit="rad/s^2", gt=0.0, le=1e4
    )
    limit: float = parameter(
        0.25, "most that is taken off the effort, as a share of the joint's effort limit", ge=0.0, le=1.0
    )
