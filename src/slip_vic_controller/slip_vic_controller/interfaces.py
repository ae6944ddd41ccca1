"""From what a driver says to what the law reads: the wrench at the pad."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.errors import InputError
from slip_core.records import REAL, WHOLE, layout
from slip_core.vectors import Mat, Spatial, mat, spatial, vec
from slip_vic_controller.params import ControllerParams
from slip_vic_controller.robot import Robot

WRENCH_SENSOR = layout(
    as_is=WHOLE, force=REAL, torque=REAL, position=(REAL, (3,)), rotation=(REAL, (3, 3)), tool_mass=REAL,
    tool_com=(REAL, (3,)), gravity=(REAL, (3,)),
)  # fmt: skip
"""as_is: the samples are the wrench at the pad, to the last bit; force, torque: signed factors; position [m], rotation:
of the sensor's frame in {ee}; tool_mass [kg], tool_com [m] {ee}: what hangs between sensor and pad; gravity {w}."""


@part
def wrench_at_pad(sensor: Any, measured: Array, R_ee: Mat) -> Spatial:
    """Return the wrench of the object on the robot at the pad centre [N, N m] {ee}.

    The tool's weight is that of the arm's attitude now; its inertia is left in.

    Args:
        sensor: WRENCH_SENSOR.
        measured: what the driver gave; (6,).
        R_ee: {ee} to {w}.
    """
    h = spatial(measured)
    if sensor.as_is != 0:
        return h
    R, p = mat(sensor.rotation), vec(sensor.position)
    force, torque = R @ (sensor.force * h.linear), R @ (sensor.torque * h.angular)
    weight = sensor.tool_mass * (R_ee.T() @ vec(sensor.gravity))
    return Spatial(force - weight, torque + p.cross(force) - vec(sensor.tool_com).cross(weight))


def fill_wrench_sensor(sensor: Any, params: ControllerParams, robot: Robot) -> None:
    """Write a WRENCH_SENSOR.

    Raises:
        InputError: the frame's place is given twice, or the frame moves against the pad.
    """
    given = params.wrench
    placed = any((*given.position, *given.rpy))
    position, rotation = np.array(given.position), Rotation.from_euler("xyz", given.rpy).as_matrix()
    in_urdf = robot.placement(given.frame) if given.frame not in ("", params.ee_frame) else None
    if in_urdf is not None:
        if placed:
            raise InputError(
                "parameter wrench.position, wrench.rpy", got=f"{list(given.position)}, {list(given.rpy)}",
                expected=f"zeros: {given.frame} is a link of the URDF, which places it", fix="leave them out",
            )  # fmt: skip
        position, rotation = in_urdf
    sensor.force, sensor.torque = given.sign * given.force_scale, given.sign * given.torque_scale
    sensor.position[:], sensor.rotation[:] = position, rotation
    sensor.tool_mass, sensor.tool_com[:], sensor.gravity[:] = given.tool_mass, given.tool_com, params.gravity
    same = not position.any() and np.array_equal(rotation, np.eye(3))
    sensor.as_is = int(same and sensor.force == sensor.torque == 1.0 and given.tool_mass == 0.0)
