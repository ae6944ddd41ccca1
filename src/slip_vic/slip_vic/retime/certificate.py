"""What a retimed motion requires of the contact and of the arm, at every sample: computed again from the motion itself.

Newton and Euler for the object, with nothing of the governor's formulas: the certificate can contradict the timing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_core.records import new, record
from slip_vic.retime.path import GivenPath
from slip_vic.retime.timing import Timing, held_object, retimed
from slip_vic_controller.arm.robot import Robot
from slip_vic_controller.governor.layouts import GOVERNOR_CONFIG, GovernorConfig
from slip_vic_controller.law.arm import ARM, Arm
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.path.joint_path import PadMotion
from slip_vic_controller.path.retiming import HELD_OBJECT, HeldObject

TRIES: Final = 4
SAFER: Final = 0.9999
"""Times that the margin is made smaller until the certificate holds, and by how much more than needed."""


@dataclass(frozen=True)
class Motion:
    """A motion in time: coordinates with velocity and acceleration, each (m, n), and the pad with m of each part."""

    times: Array
    position: Array
    velocity: Array
    acceleration: Array
    pad: PadMotion


@dataclass(frozen=True)
class Certificate:
    """The load of a motion [N] at every sample, as a share of the configured friction.

    loads (m,) [N]; limit: mu N [N]; margin: share that the timing may use.
    """

    loads: Array
    limit: float
    margin: float

    @property
    def peak_share(self) -> float:
        """Largest load over the friction limit."""
        return float(self.loads.max() / self.limit)

    @property
    def holds(self) -> bool:
        """Whether no sample needs more than the margin, but for rounding."""
        return self.peak_share <= self.margin


def motion_of(path: GivenPath, timing: Timing) -> Motion:
    """Return the path in its new timing: x' = x'(t) rate, x'' = x''(t) rate^2 + x'(t) rate_rate."""
    x, v, a = (np.array(part) for part in zip(*map(path.coordinates, timing.path_times), strict=True))
    pad = PadMotion(*(np.array(part) for part in zip(*map(path.pad, timing.path_times), strict=True)))
    rate, change = timing.rates[:, None], timing.rate_rates[:, None]
    moves = pad._replace(twist=rate * pad.twist, acceleration=rate**2 * pad.acceleration + change * pad.twist)
    return Motion(timing.times, x, rate * v, rate**2 * a + change * v, moves)


def joined(motions: Sequence[Motion], waits: Sequence[float], period_s: float) -> Motion:
    """Return motions one after the other, each at rest for its wait [s] at its end; a row per control period."""
    rows: list[list[Array]] = []
    for motion, wait in zip(motions, waits, strict=True):
        begin = 1 if rows else 0  # the first row is the last one of the motion before
        pad = motion.pad
        parts = (motion.position, pad.position, pad.rotation, motion.velocity, motion.acceleration, *pad[2:])
        rests = [np.repeat(part[-1:] * (k < 3), round(wait / period_s), axis=0) for k, part in enumerate(parts)]
        rows.append([np.concatenate((part[begin:], rest)) for part, rest in zip(parts, rests, strict=True)])
    x, p, R, v, a, twist, acceleration = (np.concatenate(part) for part in zip(*rows, strict=True))
    return Motion(period_s * np.arange(len(x), dtype=np.float64), x, v, a, PadMotion(p, R, twist, acceleration))


def pad_wrench(mass: float, inertia: Array, r: Array, gravity: Array, pad: PadMotion) -> Array:
    """Return the wrench that the pad must put on the object, at the pad centre; (..., 6) [N, N m] {w}.

    Args:
        mass: [kg].
        inertia: about the centre of mass (3, 3) [kg m^2], on pad axes.
        r: pad centre as seen from the centre of mass (3,) [m], on pad axes.
        gravity: (3,) [m/s^2] {w}.
        pad: motion of the pad, one or many.

    Implements: ours: Newton's and Euler's equations of a body that moves with the pad.
    """
    R, w, alpha = pad.rotation, pad.twist[..., 3:], pad.acceleration[..., 3:]
    lever, J = R @ r, R @ inertia @ np.swapaxes(R, -1, -2)
    of_centre = pad.acceleration[..., :3] - np.cross(alpha, lever) - np.cross(w, np.cross(w, lever))
    force = mass * (of_centre - gravity)
    torque = _times(J, alpha) + np.cross(w, _times(J, w)) - np.cross(lever, force)
    return np.concatenate((force, torque), axis=-1)


def _times(matrices: Array, vectors: Array) -> Array:
    """Return the products of matrices (..., n, m) and vectors (..., m)."""
    return (matrices @ vectors[..., None])[..., 0]


def certify(params: ControllerParams, held: Array, motion: Motion) -> Certificate:
    """Return the load of every sample, |S^-1 Sigma h| of the wrench that the pad must put on the object.

    held: HELD_OBJECT.
    """
    grasped: HeldObject = record(held, HELD_OBJECT)
    wrench = pad_wrench(params.object.mass, grasped.inertia, grasped.r, np.array(params.gravity), motion.pad)
    back = np.swapaxes(motion.pad.rotation, -1, -2)
    on_pad = np.hstack((_times(back, wrench[:, :3]), _times(back, wrench[:, 3:]) / params.governor.torsional_radius))
    slips = np.array(params.contacts.slip_axes[:6], dtype=float)
    loads = np.linalg.norm(slips * on_pad, axis=1)
    return Certificate(loads, params.governor.friction_limit, params.governor.margin)


def certified(path: GivenPath, params: ControllerParams, config: Array) -> tuple[Motion, Certificate]:
    """Return the motion of the path in its new timing, and the certificate, which holds.

    The timing is planned on a grid. What the motion needs between its points is taken out of the margin of the next
    try.

    Args:
        path: at rest at both ends.
        params: of a governed controller with one contact.
        config: GOVERNOR_CONFIG of these parameters.

    Raises:
        InputError: friction cannot carry the weight, or the path bends between the points of the grid.
    """
    held, config = held_object(params), config.copy()
    planned: GovernorConfig = record(config, GOVERNOR_CONFIG)
    for _ in range(TRIES):
        motion = motion_of(path, retimed(path, config, held, params.control_period_s))
        certificate = certify(params, held, motion)
        if certificate.holds:
            return motion, certificate
        planned.margin *= SAFER * certificate.margin / certificate.peak_share
    at = float(motion.times[int(certificate.loads.argmax())])
    raise InputError(
        "path",
        got=f"a load of {100.0 * certificate.peak_share:.0f} % of the friction at {at:.3f} s, whatever its timing",
        expected=f"at most {100.0 * certificate.margin:.0f} %",
        fix="a path without noise: it bends between its points",
    )


def arm_shares(robot: Robot, params: ControllerParams, motion: Motion) -> dict[str, Array]:
    """Return the largest shares of the limits of velocity and effort that a motion of the joints takes; (n,) each.

    tau = B qdd + C qd + g - J^T h_ee, with the wrench h_ee of the object on the robot.

    Implements: Eq. (1), (10).
    """
    buffer, grasped = new(ARM), record(held_object(params), HELD_OBJECT)
    arm: Arm = record(buffer, ARM)
    n, efforts = motion.position.shape[1], []
    wrenches = pad_wrench(params.object.mass, grasped.inertia, grasped.r, np.array(params.gravity), motion.pad)
    for q, qd, qdd, wrench in zip(motion.position, motion.velocity, motion.acceleration, wrenches, strict=True):
        robot.terms(q, qd, buffer)
        efforts.append(arm.M[:n, :n] @ qdd + arm.bias[:n] + arm.J[:, :n].T @ wrench)
    most = {"velocity": (motion.velocity, robot.velocity_limit), "effort": (np.array(efforts), robot.effort_limit)}
    return {what: np.abs(rows).max(axis=0) / limit for what, (rows, limit) in most.items()}
