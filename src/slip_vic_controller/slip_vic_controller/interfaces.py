"""From what a driver publishes to what the law reads: the wrench at the pad, and slip velocity from displacements."""

from __future__ import annotations

import numpy as np

from slip_core.arrays import Array, matrix_from_quat_xyzw
from slip_core.compiled import IN1, IN2, OUT1, REAL, VOID, kernel, part
from slip_core.errors import InputError
from slip_core.records import Mat3, Real, Record, Vec3, dtype_of
from slip_core.types import DisplacementSample, SlipSample
from slip_core.vectors import Mat, Spatial, mat, put_spatial, spatial, vec
from slip_vic_controller.law.rotation import exponential, logarithm
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.robot import Robot, rotation_of_rpy


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
                expected=f"zeros: {given.frame} is a link of the URDF, which gives its position", fix="leave them out",
            )  # fmt: skip
        position, rotation = in_urdf
    elif given.frame not in ("", params.ee_frame) and not placed:
        raise InputError(
            "parameter wrench.frame", got=given.frame, expected=f"a link that is fixed to {params.ee_frame}",
            fix="for a frame that is no link, set wrench.position and wrench.rpy",
        )  # fmt: skip
    sensor.force, sensor.torque = given.sign * given.force_scale, given.sign * given.torque_scale
    sensor.position[:], sensor.rotation[:] = position, rotation
    sensor.tool_mass, sensor.tool_com[:], sensor.gravity[:] = given.tool_mass, given.tool_com, params.gravity


@kernel(VOID, IN1, IN2, IN1, IN2, REAL, OUT1)
def mean_velocity(s_1: Array, R_1: Array, s_2: Array, R_2: Array, dt: float, twist: Array) -> None:
    """Write the mean slip velocity between two displacements; (3,) [m], (3, 3) on {p} axes; dt [s]; (6,) {ee}.

    On the axes of the pad half way, so of second order in dt.

    Implements: Eq. (12), (13), solved for v_s: s_l_dot = R_s v_sl, R_s_dot = R_s S(v_sa).
    """
    turn = logarithm(mat(R_1).T() @ mat(R_2))
    R_half = mat(R_1) @ exponential(0.5 * turn)
    put_spatial(twist, (1.0 / dt) * Spatial(R_half.T() @ (vec(s_2) - vec(s_1)), turn))


class SlipFromDisplacement:
    """Makes slip velocities of one contact from its displacements; what comes first, or after a gap, makes none.

    A velocity has the stamp half way between the two displacements: it is the mean of that time.
    """

    def __init__(self) -> None:
        self._last: tuple[int, Array, Array] | None = None

    def __call__(self, sample: DisplacementSample) -> SlipSample | None:
        """Return the slip velocity since the displacement before; an invalid one makes an invalid velocity."""
        if not sample.valid:
            self._last = None
            return SlipSample(sample.stamp_ns, np.full(6, np.nan), valid=False)
        place, turned = np.array(sample.pose[:3]), matrix_from_quat_xyzw(sample.pose[3:])
        before, self._last = self._last, (sample.stamp_ns, place, turned)
        if before is None or sample.stamp_ns <= before[0]:
            return None
        twist = np.empty(6)
        mean_velocity(before[1], before[2], place, turned, (sample.stamp_ns - before[0]) * 1e-9, twist)
        return SlipSample((before[0] + sample.stamp_ns) // 2, twist)
