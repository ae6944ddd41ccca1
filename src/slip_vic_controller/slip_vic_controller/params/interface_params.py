"""What the drivers of arm, wrench sensor and slip sensor give and take; every default is the suite's own bridge."""

from __future__ import annotations

from typing import Literal

from slip_core import device_params
from slip_core.device_params import CommandInterface, GripperModel
from slip_core.grasp_params import Three
from slip_core.params import ParameterModel, parameter


class WrenchParams(ParameterModel):
    """How the wrench sensor's driver says what it measures; contacts of other arms are taken at the pad as they are."""

    source: Literal["sensor", "none"] = parameter(
        "sensor",
        "sensor: the topic `wrench`; none: there is no such sensor, and the load is that of the model, an object that "
        "is held and moves as the path does",
    )
    frame: str = parameter(
        "", "frame of the wrench messages; empty = ee_frame. Where it is a link of the URDF its place is known"
    )
    position: Three = parameter(
        (0.0, 0.0, 0.0), "place of the sensor's frame as seen from ee_frame, where it is no link of the URDF", unit="m"
    )
    rpy: Three = parameter(
        (0.0, 0.0, 0.0),
        "attitude of the sensor's frame as seen from ee_frame, where it is no link of the URDF: turns about the fixed "
        "x, y and z in this order",
        unit="rad",
    )
    sign: Literal[1, -1] = parameter(
        1, "1: the driver gives the wrench of the object on the robot; -1: that of the robot on the object"
    )
    force_scale: float = parameter(1.0, "factor that makes the driver's forces newtons", gt=0.0)
    torque_scale: float = parameter(1.0, "factor that makes the driver's torques newton metres", gt=0.0)
    tool_mass: float = parameter(
        0.0, "mass between sensor and pad, whose weight is taken out of the wrench", unit="kg", ge=0.0
    )
    tool_com: Three = parameter((0.0, 0.0, 0.0), "its centre of mass as seen from ee_frame, on its axes", unit="m")


class WrenchSensorModel(device_params.WrenchSensorModel):
    """What is known of the wrench sensor, and by how much it may be off."""

    bias_force: float = parameter(0.1, "expected size of a constant force error", unit="N", gt=0.0)
    bias_torque: float = parameter(2e-3, "expected size of a constant torque error", unit="N m", gt=0.0)


class EffortParams(ParameterModel):
    """What the arm's drives make of an effort."""

    gravity: Literal["include", "robot_compensates"] = parameter(
        "include",
        "include: efforts carry the arm's weight; robot_compensates: the arm adds the torque of its own weight itself",
    )


class CommandParams(ParameterModel):
    """What the arm's drives take, and the limits of velocities and positions; those of efforts are `safety.limits`."""

    interface: CommandInterface = parameter(
        "effort",
        "effort [N m] on `effort_command`, velocity [rad/s] on `velocity_command` or position [rad] on "
        "`position_command`; the last two for drives with a loop of their own",
    )
    acceleration_limit: float = parameter(
        10.0, "interfaces velocity and position: largest acceleration of the command of each joint", unit="rad/s^2",
        gt=0.0, le=1e4,
    )  # fmt: skip


class GripParams(GripperModel):
    """Grip as a second output, where the gripper can follow and the object may be squeezed."""

    nominal_force: float = parameter(
        0.5, "grip for which governor.friction_limit holds; with control follow also the first one, and the least in "
        "HOLD", unit="N", gt=0.0,
    )  # fmt: skip
    cap: float = parameter(
        10.0, "control follow: largest grip, what object and gripper stand; the path is planned for it", unit="N",
        gt=0.0,
    )  # fmt: skip
    error_force: float = parameter(
        0.0, "control follow: by how much the force may be less than commanded, for the gripper's steps and friction",
        unit="N", ge=0.0,
    )  # fmt: skip
    risk: float = parameter(
        5e-3, "control follow: probability that friction carries less than the grip counts on", gt=0.0, lt=0.5
    )
