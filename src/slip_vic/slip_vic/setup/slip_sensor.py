"""What the readings of a slip sensor show against the motion of the pad or the wrench: `contact/slip_health`."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from slip_core.arrays import Array
from slip_core.records import new, record
from slip_core.vectors import spatial
from slip_vic.setup.bringup.heard import Track
from slip_vic_controller.contact.estimate import SensorHealth
from slip_vic_controller.contact.friction_estimate import GIVES_M
from slip_vic_controller.contact.slip_health import SLIP_EVIDENCE, add_reading, judge_health, start_health
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.robot import Robot

SLIP_SPEED: Final = 0.01
"""Reading that counts as slip [m/s], and above the sixfold noise."""
ASKEW: Final = math.radians(10.0)
"""Of its axes, where the motion is known."""
MOST_SCALE, MOST_LAG_S = 1.4, 0.02
"""Ratio of readings and motion, up or down: samples of a slow camera miss a sixth. Lag of stamps [s]: with more, a law
without an observer loses the object."""
LAGS_S: Final = 1e-3 * np.arange(-60, 61)
"""Tested lags of the stamps [s]."""


def pad_twists(robot: Robot, q: Array, qd: Array) -> Array:
    """Return the twists of the pad on its own axes; (k, n) [rad], [rad/s] -> (k, 6) [m/s, rad/s]."""
    twists, buffer = np.empty((len(q), 6)), new(ARM)
    arm = record(buffer, ARM)
    for k in range(len(q)):
        robot.terms(q[k], qd[k], buffer)
        twists[k, :3], twists[k, 3:] = arm.twist[:3] @ arm.rotation, arm.twist[3:] @ arm.rotation
    return twists


def compare(times: Array, drags: Array, stamps: Array, readings: Array, least: float, differs: float) -> Any:
    """Return the SLIP_EVIDENCE of a recording, judged.

    Args:
        times, drags: what drags the object, twist or wrench of the pad; (k,) [s], (k, 6) {ee}.
        stamps, readings: of the sensor; (m,) [s], (m, 6) {ee}, turning at the torsional radius [m/s].
        least: reading that counts as slip [m/s].
        differs: as in `judge_health`.
    """
    state, at = record(new(SLIP_EVIDENCE), SLIP_EVIDENCE), np.clip(np.searchsorted(times, stamps), 0, len(times) - 1)
    start_health(state)
    for k in np.flatnonzero(np.isfinite(readings).all(axis=1)):
        slips = bool(np.linalg.norm(readings[k]) > least)
        add_reading(state, round(1e9 * stamps[k]), spatial(readings[k]), spatial(drags[at[k]]), slips)
    judge_health(state, differs, 0.0, 0.0, 0.0)
    return state


def against_motion(
    times: Array, motion: Array, stamps: Array, readings: Array, unit: float, lag_s: float
) -> tuple[SensorHealth, float]:
    """Compare readings with the motion of the pad on a fixed object; return the mistake and its size.

    The lag at which the speed of the pad explains most of theirs is that of the stamps, the ratio of both is the unit.
    The model's slip velocity in a run is no such reference: it is accurate to a third, and its lag follows the
    sensor's.

    Args:
        times, motion: of the pad's twist; (k,) [s], (k, 6) {ee}, turning at the torsional radius [m/s].
        stamps, readings: the same of the sensor; (m,) [s], (m, 6).
        unit: ratio, or its inverse, from which units differ.
        lag_s: by which stamps may be off [s].
    """
    worst, late = 1.0, 0.0
    health = SensorHealth.OK
    for part_of, kind in ((slice(0, 3), SensorHealth.LINEAR_UNIT), (slice(3, 6), SensorHealth.ANGULAR_UNIT)):
        read, moved = (np.linalg.norm(v[:, part_of], axis=1) for v in (readings, motion))
        if np.trapezoid(moved, times) < GIVES_M:
            continue
        shifted = np.array([np.interp(stamps - lag, times, moved) for lag in LAGS_S])
        squares, products = (shifted**2).sum(axis=1), shifted @ read
        best = int(np.argmax(products / np.sqrt(squares)))
        scale = float(products[best] / squares[best])
        if health == SensorHealth.OK and max(scale, 1.0 / max(scale, 1e-9)) > unit:
            health, worst = kind, scale
        elif late == 0.0 and abs(LAGS_S[best]) > lag_s:
            late = float(LAGS_S[best])
    if health != SensorHealth.OK:
        return health, worst
    return (SensorHealth.STAMPS, 1e3 * late) if late else (health, 0.0)


def slide_mistake(
    robot: Robot, joints: Track, slip: Track, scale: Array, least: float
) -> tuple[str, str, float, float]:
    """Return what a sensor shows where the pad has moved over an object that is held fast.

    Args:
        robot: the arm.
        joints, slip: what was heard, in order.
        scale: 1 or 0 of each axis that can slip or not, angular ones times the torsional radius [m]; (6,).
        least: reading that counts as slip [m/s].

    Returns:
        What is wrong and what to do, empty where nothing is; how far the pad has moved, and the sensor reads [m].
    """
    position, velocity = np.hsplit(joints.values, 2)
    if not np.isfinite(velocity).all():  # the arm measures positions alone
        velocity = np.gradient(position, joints.stamp, axis=0)
    motion, good = pad_twists(robot, position, velocity) * scale, np.isfinite(slip.values).all(axis=1)
    stamps, read = slip.stamp[good], slip.values[good] * scale
    found = compare(joints.stamp, motion, stamps, read, least, 1.0 - math.cos(ASKEW))
    health, value = SensorHealth(int(found.found)), float(found.value)
    if health != SensorHealth.HELD:
        wrong, by = against_motion(joints.stamp, motion, stamps, read, MOST_SCALE, MOST_LAG_S)
        health, value = (wrong, by) if wrong != SensorHealth.OK else (health, value)
    moved = float(np.trapezoid(np.linalg.norm(motion[:, :3], axis=1), joints.stamp))
    return health.words.format(value=value, limit=found.limit), health.to_do, moved, float(found.length)
