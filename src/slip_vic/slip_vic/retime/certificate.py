"""What a retimed motion requires of the contact and of the arm, at every sample: computed again from the motion itself.

Newton and Euler for the object, with nothing of the governor's formulas: the certificate can contradict the timing.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from slip_core.arrays import Array, inertia_from_six, matrix_from_quat_xyzw
from slip_core.errors import InputError
from slip_core.records import new, record
from slip_core.types import PadMotion
from slip_sim_bridge.params import BridgeParams
from slip_vic.retime.path import GivenPath
from slip_vic.retime.timing import MOST_SAMPLES, Sample, retimed
from slip_vic_controller.config.controller import ArmController
from slip_vic_controller.governor.layouts import GOVERNOR_CONFIG, GovernorConfig
from slip_vic_controller.law.arm import ARM, Arm
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.state import CONFIG

TRIES: Final = 4
SAFER: Final = 0.9999
"""Times that the margin is made smaller until the certificate holds, and by how much more than needed."""


class Motion(NamedTuple):
    """A motion in time: coordinates with velocity and acceleration, each (m, n), and the pad with m of each part."""

    times: Array
    position: Array
    velocity: Array
    acceleration: Array
    pad: PadMotion


def motion_of(samples: Sequence[Sample], period_s: float) -> Motion:
    """Return the motion through samples, one each period: x' = x'(t) rate, x'' = x''(t) rate^2 + x'(t) rate_rate."""
    x, v, a = (np.array(part) for part in zip(*(one.path.coordinates(one.time) for one in samples), strict=True))
    pad = PadMotion(*(np.array(part) for part in zip(*(one.path.pad(one.time) for one in samples), strict=True)))
    rate, change = np.array([(one.rate, one.rate_rate) for one in samples]).T[:, :, None]
    moves = pad._replace(twist=rate * pad.twist, acceleration=rate**2 * pad.acceleration + change * pad.twist)
    return Motion(period_s * np.arange(len(x), dtype=np.float64), x, rate * v, rate**2 * a + change * v, moves)


def pad_wrench(params: ControllerParams | BridgeParams, pad: PadMotion) -> Array:
    """Return the wrench that the pad must put on the object, at the pad centre; (..., 6) [N, N m] {w}.

    pad: motion of the pad, one or many.

    Implements: ours: Newton's and Euler's equations of a body that moves with the pad.
    """
    R, w, alpha = pad.rotation, pad.twist[..., 3:], pad.acceleration[..., 3:]
    R_o = R @ matrix_from_quat_xyzw(params.contacts.orientation_xyzw[:4]).T
    J = R_o @ inertia_from_six(params.object.inertia, "parameter object.inertia") @ np.swapaxes(R_o, -1, -2)
    lever = R_o @ np.array(params.contacts.position[:3])
    of_centre = pad.acceleration[..., :3] - np.cross(alpha, lever) - np.cross(w, np.cross(w, lever))
    force = params.object.mass * (of_centre - np.array(params.gravity))
    torque = _times(J, alpha) + np.cross(w, _times(J, w)) - np.cross(lever, force)
    return np.concatenate((force, torque), axis=-1)


def _times(matrices: Array, vectors: Array) -> Array:
    """Return the products of matrices (..., n, m) and vectors (..., m)."""
    return (matrices @ vectors[..., None])[..., 0]


def load_shares(params: ControllerParams, motion: Motion) -> Array:
    """Return the load of every sample as a share of the friction; (m,).

    The load is |S^-1 Sigma h| of the wrench that the pad must put on the object.
    """
    wrench, back = pad_wrench(params, motion.pad), np.swapaxes(motion.pad.rotation, -1, -2)
    on_pad = np.hstack((_times(back, wrench[:, :3]), _times(back, wrench[:, 3:]) / params.governor.torsional_radius))
    slips = np.array(params.contacts.slip_axes[:6], dtype=float)
    shares: Array = np.linalg.norm(slips * on_pad, axis=1) / params.governor.friction_limit
    return shares


def certified(path: GivenPath, controller: ArmController, most_samples: int = MOST_SAMPLES) -> list[Sample]:
    """Return the new timing of a path, in which no sample needs more than the margin of the friction.

    The timing is planned on a grid. What the motion needs between its points is taken out of the margin of the next
    try.

    Args:
        path: at rest at both ends.
        controller: governed, with one contact.
        most_samples: the most that the motion may have.

    Raises:
        InputError: friction cannot carry the weight, the path bends between the points of the grid, or it takes longer.
    """
    config, params, margin = new(GOVERNOR_CONFIG), controller.params, controller.params.governor.margin
    config.view(GOVERNOR_CONFIG)[0] = record(controller.config, CONFIG).governor
    planned: GovernorConfig = record(config, GOVERNOR_CONFIG)
    planned.duration = path.duration
    for _ in range(TRIES):
        samples = retimed(path, config, params, most_samples)
        shares = load_shares(params, motion_of(samples, params.control_period_s))
        if shares.max() <= margin:
            return samples
        planned.margin *= SAFER * margin / shares.max()
    at = params.control_period_s * int(shares.argmax())
    raise InputError(
        "path",
        got=f"a load of {100.0 * shares.max():.0f} % of the friction at {at:.3f} s, whatever its timing",
        expected=f"at most {100.0 * margin:.0f} %",
        fix="smooth the path: it bends between its points",
    )


def arm_shares(controller: ArmController, motion: Motion) -> dict[str, Array]:
    """Return the largest shares of the limits of velocity and effort that a motion of the joints takes; (n,) each.

    tau = B qdd + C qd + g - J^T h_ee, with the wrench h_ee of the object on the robot.

    Implements: Eq. (1), (10).
    """
    robot, buffer, n, efforts = controller.robot, new(ARM), motion.position.shape[1], []
    arm: Arm = record(buffer, ARM)
    wrenches = pad_wrench(controller.params, motion.pad)
    for q, qd, qdd, wrench in zip(motion.position, motion.velocity, motion.acceleration, wrenches, strict=True):
        robot.terms(q, qd, buffer)
        efforts.append(arm.M[:n, :n] @ qdd + arm.bias[:n] + arm.J[:, :n].T @ wrench)
    most = {"velocity": (motion.velocity, robot.velocity_limit), "effort": (np.array(efforts), robot.effort_limit)}
    return {what: np.abs(rows).max(axis=0) / limit for what, (rows, limit) in most.items()}
