"""What vendors' messages say, in the controller's units; works on any object with their fields, and needs no ROS."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from slip_core.arrays import Array
from slip_core.errors import InputError

SLIPPED, UNKNOWN = 3, 0
"""Of a pillar's `slip_state`; everything else says that it holds."""
MILLI = 1e-3


def papillarray_flags(message: Any) -> dict[str, float]:
    """Return one flag per pillar of a PapillArray's SensorState: 1 slips, 0 holds, NaN not known.

    Not known is every pillar while slip detection is off or its reference load is not set, and one without contact.
    """
    detects = bool(message.is_sd_active and message.is_ref_loaded)
    flags = {}
    for pillar in message.pillars:
        known = detects and pillar.in_contact and pillar.slip_state != UNKNOWN
        flags[f"pillar_{pillar.id}"] = float(pillar.slip_state == SLIPPED) if known else math.nan
    return flags


def papillarray_wrench(message: Any) -> Array:
    """Return the global force and torque of a PapillArray's SensorState; (6,) [N, N m]: it gives N and N mm."""
    force, torque = (message.gfx, message.gfy, message.gfz), (message.gtx, message.gty, message.gtz)
    return np.array([*force, *(MILLI * part for part in torque)], dtype=np.float64)


def xela_forces(message: Any, sensor: int, places: Array) -> Array:
    """Return the force on each taxel of one sensor of a XELA SensStream; (n, 3) [N].

    Their shear at their places is a field for `field_twist.planar_twist`, as are the displacements of a gel's markers.

    Args:
        message: SensStream.
        sensor: its `sensor_pos`.
        places: of the taxels, in the driver's order, as seen from the sensor's centre; (n, 3) [m].

    Raises:
        InputError: no such sensor in the message, no forces (its model is not calibrated), or not one per place.
    """
    found = [one for one in message.sensors if one.sensor_pos == sensor]
    if not found:
        known = [one.sensor_pos for one in message.sensors]
        raise InputError("XELA: sensor", got=f"{sensor}", expected=f"one of {known}")
    forces = np.array([[force.x, force.y, force.z] for force in found[0].forces], dtype=np.float64).reshape(-1, 3)
    if not len(forces):
        raise InputError(
            f"XELA: sensor {sensor}", got="no forces", expected="a calibrated model", fix="ask the vendor for its file"
        )
    if len(forces) != len(places):
        raise InputError("XELA: taxels", got=f"{len(forces)} forces", expected=f"{len(places)}, one per place")
    return forces


def xela_wrench(message: Any, sensor: int, places: Array) -> Array:
    """Return the wrench on one sensor of a XELA SensStream: the sum over its taxels; (6,) [N, N m].

    Arguments and errors are those of `xela_forces`.
    """
    forces = xela_forces(message, sensor, places)
    return np.concatenate((forces.sum(axis=0), np.cross(places, forces).sum(axis=0)))


def taxel_places(rows: int, columns: int, pitch_m: float) -> Array:
    """Return the places of a flat grid of taxels, row by row, about its centre; (rows * columns, 3) [m]."""
    y, x = np.mgrid[0:rows, 0:columns].astype(np.float64)
    x, y = (x - x.mean()) * pitch_m, (y - y.mean()) * pitch_m
    return np.stack([x.ravel(), y.ravel(), np.zeros(rows * columns)], axis=1)
