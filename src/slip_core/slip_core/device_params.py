"""The configuration of both nodes of drives, sensors and gripper: the bridge simulates it, the controller uses it."""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal

from pydantic import Field

from slip_core.params import ParameterModel, parameter
from slip_core.types import CommandInterface as CommandInterface

EACH = "one number for all joints or one per joint, empty = none"
"""What a list of joints means; see `DriveModel.of_joints`."""


NotNegative = Annotated[float, Field(ge=0.0)]


class DriveModel(ParameterModel):
    """Drives of the joints: what is known of them; the launcher fills it from the drive's preset."""

    delay_s: float = parameter(
        0.0, "dead time from a command to its effect; whole control periods", unit="s", ge=0.0, le=0.1
    )
    lag_s: float = parameter(0.0, "interface effort: time constant of the effort; 0 = at once", unit="s", ge=0.0)
    bandwidth: float = parameter(
        300.0,
        "interfaces velocity and position: bandwidth of the joint's response to its command",
        unit="rad/s",
        gt=0.0,
    )
    armature: tuple[NotNegative, ...] = parameter(
        (), f"rotor inertia reflected to the joint (times gear ratio squared); {EACH}",
        unit="kg m2",
    )  # fmt: skip
    coulomb: tuple[NotNegative, ...] = parameter((), f"Coulomb friction of the joints; {EACH}", unit="N m")

    def of_joints(self, name: str, joints: int) -> tuple[float, ...]:
        """Return what is configured by such a list, of each joint.

        Raises:
            ValueError: neither one number nor one per joint.
        """
        values: tuple[float, ...] = getattr(self, name) or (0.0,)
        if len(values) not in (1, joints):
            raise ValueError(f"drive.{name}: {len(values)} numbers for {joints} joints; one for all, or one per joint")
        return values * joints if len(values) == 1 else values

    def check(self, joints: int) -> None:
        """See that the lists fit an arm.

        Raises:
            ValueError: a list of another length.
        """
        for name, value in self:
            if isinstance(value, tuple):
                self.of_joints(name, joints)


class JointSensorModel(ParameterModel):
    """Joint encoders: what is known of them."""

    rate_hz: float = parameter(
        0.0, "update rate of positions and velocities, which are repeated in between; 0 = every message",
        unit="Hz", ge=0.0, le=1e5,
    )  # fmt: skip
    latency_s: float = parameter(0.0, "delay of the driver that the stamps do not include", unit="s", ge=0.0, le=0.1)
    noise_position: float = parameter(0.0, "standard deviation of each joint position", unit="rad", ge=0.0, le=0.1)
    noise_velocity: float = parameter(
        0.0, "standard deviation of each joint velocity; if 0 and quantum_position is 0, joint states are not filtered",
        unit="rad/s", ge=0.0, le=10.0,
    )  # fmt: skip
    quantum_position: float = parameter(0.0, "step of each joint position; 0 = continuous", unit="rad", ge=0.0, le=0.1)
    velocity_filter_hz: float = parameter(
        0.0,
        "corner frequency of the filter of a driver that differentiates positions; 0 = velocities are measured",
        unit="Hz",
        ge=0.0,
        le=1e5,
    )


SlipInput = Literal["twist", "displacement", "flag"]
SLIP_INPUT: Final[Any] = parameter(
    "twist",
    "what the slip sensor reports. twist: slip velocity on `slip_velocity`; displacement: position of the pad on the "
    "object, on `slip_displacement`; flag: whether it slips, on `slip_flag`",
)


class SlipSensorModel(ParameterModel):
    """Slip velocity sensor: what is known of it; the launcher fills it from the sensor's preset."""

    rate_hz: float = parameter(0.0, "measuring rate; 0 = every control cycle", unit="Hz", ge=0.0)
    latency_s: float = parameter(0.0, "time from measurement to arrival", unit="s", ge=0.0)
    noise_linear: float = parameter(
        0.0, "standard deviation of each linear axis that can slip", unit="m/s", ge=0.0, le=0.1
    )
    noise_angular: float = parameter(
        0.0, "standard deviation of each angular axis that can slip", unit="rad/s", ge=0.0, le=10.0
    )
    quantum_linear: float = parameter(0.0, "step of the linear readings; 0 = continuous", unit="m/s", ge=0.0)
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


class GripperModel(ParameterModel):
    """A gripper whose force follows a command."""

    control: Literal["fixed", "follow"] = parameter(
        "fixed", "fixed: the grip force is constant; follow: the controller commands it on `grip_command`"
    )
    lag_s: float = parameter(0.0, "time constant of the grip force; 0 = at once", unit="s", ge=0.0)
    least_force: float = parameter(0.0, "smallest force that the gripper can hold", unit="N", ge=0.0)
