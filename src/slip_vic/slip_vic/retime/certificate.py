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
    """A motion in time: coordinates with velocity and acceleration, each (m, n), and the pad at every sample."""

    times: Array
    position: Array
    velocity: Array
    acceleration: Array
    pads: tuple[PadMotion, ...]


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
    rows, pads = [], []
    for at, rate, rate_rate in zip(timing.path_times, timing.rates, timing.rate_rates, strict=True):
        x, v, a = path.coordinates(float(at))
        rows.append((x, rate * v, rate * rate * a + rate_rate * v))
        planned = path.pad(float(at))
        acceleration = rate * rate * planned.acceleration + rate_rate * planned.twist
        pads.append(PadMotion(planned.position, planned.rotation, rate * planned.twist, acceleration))
    x, v, a = (np.array(column) for column in zip(*rows, strict=True))
    return Motion(timing.times, x, v, a, tuple(pads))


def joined(motions: Sequence[Motion], waits: Sequence[float], period_s: float) -> Motion:
    """Return motions one after the other, each at rest for its wait [s] at its end; a row per control period."""
    rows: list[tuple[Array, Array, Array, PadMotion]] = []
    for motion, wait in zip(motions, waits, strict=True):
        begin = 1 if rows else 0  # the first row is the last one of the motion before
        rows += list(zip(motion.position, motion.velocity, motion.acceleration, motion.pads, strict=True))[begin:]
        position, none, pad = motion.position[-1], np.zeros_like(motion.position[-1]), motion.pads[-1]
        rest = pad._replace(twist=np.zeros(6), acceleration=np.zeros(6))
        rows += [(position, none, none, rest)] * round(wait / period_s)
    x, v, a, pads = zip(*rows, strict=True)
    return Motion(period_s * np.arange(len(rows), dtype=np.float64), np.array(x), np.array(v), np.array(a), tuple(pads))


def pad_wrench(mass: float, inertia: Array, r: Array, gravity: Array, pad: PadMotion) -> tuple[Array, Array]:
    """Return force and torque that the pad must put on the object, at the pad centre; (3,) [N], (3,) [N m] {w}.

    Args:
        mass: [kg].
        inertia: about the centre of mass (3, 3) [kg m^2], on pad axes.
        r: pad centre as seen from the centre of mass (3,) [m], on pad axes.
        gravity: (3,) [m/s^2] {w}.
        pad: motion of the pad.

    Implements: ours: Newton's and Euler's equations of a body that moves with the pad.
    """
    R, w, alpha = pad.rotation, pad.twist[3:], pad.acceleration[3:]
    lever, J = R @ r, R @ inertia @ R.T
    of_centre = pad.acceleration[:3] - _cross(alpha, lever) - _cross(w, _cross(w, lever))
    force = mass * (of_centre - gravity)
    return force, J @ alpha + _cross(w, J @ w) - _cross(lever, force)


def _cross(a: Array, b: Array) -> Array:
    """Return a x b of two vectors; numpy's own takes arrays of them, and ten times as long."""
    (x, y, z), (u, v, w) = a.tolist(), b.tolist()
    return np.array((y * w - z * v, z * u - x * w, x * v - y * u))


def pad_load(params: ControllerParams, inertia: Array, r: Array, pad: PadMotion) -> float:
    """Return |S^-1 Sigma h| [N] of the wrench that the pad must put on the object; arguments as in `pad_wrench`."""
    R = pad.rotation
    force, torque = pad_wrench(params.object.mass, inertia, r, np.array(params.gravity), pad)
    slips = np.array(params.contacts.slip_axes[:6], dtype=float)
    loads = slips * np.concatenate((R.T @ force, R.T @ torque / params.governor.torsional_radius))
    return float(np.linalg.norm(loads))


def certify(params: ControllerParams, held: Array, motion: Motion) -> Certificate:
    """Return the load of every sample; held: HELD_OBJECT."""
    grasped: HeldObject = record(held, HELD_OBJECT)
    loads = np.array([pad_load(params, grasped.inertia, grasped.r, pad) for pad in motion.pads])
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


def arm_shares(robot: Robot, held: Array, gravity: Array, motion: Motion) -> tuple[Array, Array]:
    """Return the largest shares of velocity and effort limits that a motion of the joints takes; (n,) each.

    tau = B qdd + C qd + g - J^T h_ee, with the wrench h_ee of the object on the robot.

    Implements: Eq. (1), (10).
    """
    buffer, grasped = new(ARM), record(held, HELD_OBJECT)
    arm: Arm = record(buffer, ARM)
    n, efforts = motion.position.shape[1], []
    for q, qd, qdd, pad in zip(motion.position, motion.velocity, motion.acceleration, motion.pads, strict=True):
        robot.terms(q, qd, buffer)
        force, torque = pad_wrench(grasped.mass, grasped.inertia, grasped.r, gravity, pad)
        J = arm.J[:, :n]
        efforts.append(arm.M[:n, :n] @ qdd + arm.bias[:n] + J.T @ np.concatenate((force, torque)))
    speed = np.abs(motion.velocity).max(axis=0) / robot.velocity_limit
    return speed, np.abs(np.array(efforts)).max(axis=0) / robot.effort_limit
