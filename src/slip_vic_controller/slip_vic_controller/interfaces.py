"""From what a driver publishes to what the law reads: the wrench at the pad."""

from __future__ import annotations

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.errors import InputError
from slip_core.records import Mat3, Real, Record, Vec3, dtype_of
from slip_core.vectors import Mat, Spatial, mat, spatial, vec
from slip_vic_controller.arm.robot import Robot, rotation_of_rpy
from slip_vic_controller.params.controller_params import ControllerParams


class WrenchSensor(Record):
    """Where the wrench is measured, and in which units."""

    force: Real  # signed factor
    torque: Real  # signed factor
    position: Vec3  # m {ee}; of the sensor's frame
    rotation: Mat3  # sensor to {ee}
    tool_mass: Real  # kg; what hangs between sensor and pad
    tool_com: Vec3  # m {ee}
    gravity: Vec3  # m/s^2 {w}


WRENCH_SENSOR = dtype_of(WrenchSensor)


@part
def wrench_at_pad(sensor: WrenchSensor, measured: Array, R_ee: Mat) -> Spatial:
    """Return the wrench of the object on the robot at the pad centre [N, N m] {ee}.

    The tool's weight is that of the arm's attitude now; its inertia is left in.

    Args:
        sensor: where it is measured.
        measured: what the driver gave; (6,).
        R_ee: {ee} to {w}.
    """
    h = spatial(measured)
    R, p = mat(sensor.rotation), vec(sensor.position)
    force, torque = R @ (sensor.force * h.linear), R @ (sensor.torque * h.angular)
    weight = sensor.tool_mass * (R_ee.T() @ vec(sensor.gravity))
    return Spatial(force - weight, torque + p.cross(force) - vec(sensor.tool_com).cross(weight))


def fill_wrench_sensor(sensor: WrenchSensor, params: ControllerParams, robot: Robot) -> None:
    """Write where the wrench is measured.

    Raises:
        InputError: the frame's place is unknown or given twice, or the frame moves against the pad.
    """
    given = params.wrench
    sensor.force = sensor.torque = 1.0
    sensor.rotation[:] = np.eye(3)
    if given.source == "none":  # the model's is one at the pad
        return
    placed = any((*given.position, *given.rpy))
    position, rotation = np.array(given.position), rotation_of_rpy(given.rpy)
    in_urdf = robot.placement(given.frame) if given.frame not in ("", params.ee_frame) else None
    if in_urdf is not None:
        if placed:
            raise InputError(
                "parameter wrench.position, wrench.rpy", got=f"{list(given.position)}, {list(given.rpy)}",
                expected=f"zeros: {given.frame} is a link of the URDF, which places it", fix="leave them out",
            )  # fmt: skip
        position, rotation = in_urdf
    elif given.frame not in ("", params.ee_frame) and not placed:
        raise InputError(
            "parameter wrench.frame", got=given.frame, expected=f"a link that is fixed to {params.ee_frame}",
            fix="wrench.position and wrench.rpy place a frame that is no link",
        )  # fmt: skip
    sensor.force, sensor.torque = given.sign * given.force_scale, given.sign * given.torque_scale
    sensor.position[:], sensor.rotation[:] = position, rotation
    sensor.tool_mass, sensor.tool_com[:], sensor.gravity[:] = given.tool_mass, given.tool_com, params.gravity
