"""What a bag shows of drives and encoders, noise, quantum, friction and offset of each joint, and the slip sensor."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import yaml

from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_core.records import new, record
from slip_vic.run.data import ArmData, read_data
from slip_vic.setup.slip_sensor import SLIP_SPEED, compare
from slip_vic_controller.contact.estimate import SensorHealth
from slip_vic_controller.contact.slip_health import DIFFERS
from slip_vic_controller.law.arm import ARM, Arm
from slip_vic_controller.params.controller_params import GovernorParams
from slip_vic_controller.robot import Robot

LEAST_SAMPLES = 200
LEAST_SPEED = 0.01
"""Speed [rad/s] below which a joint is not moving for certain, and above the sixfold noise."""
WINDOW_S = 0.1
"""Over which velocities are smoothed, and accelerations taken."""
LEAST_SHARE = 0.05
"""Of the samples, which a direction needs."""
STEPS = 0.99
"""Share of position steps that are whole multiples of the smallest: then it is a quantum."""


COLUMNS = {
    "noise_position": "noise q [rad]", "noise_velocity": "noise qd [rad/s]", "quantum": "quantum [rad]",
    "coulomb": "coulomb [N m]", "viscous": "viscous [N m s/rad]", "offset": "offset [N m]",
    "residual": "left over [N m]",
}  # fmt: skip
"""Numbers of a joint. Noise: standard deviations; quantum: 0 where there is none; residual: root mean square of what
friction and offset leave of the effort. Friction and offset are NaN where it does not move both ways, viscous where its
speed hardly varies."""


def read_motion(path: Path) -> ArmData:
    """Read a recorded motion with its efforts.

    Raises:
        InputError: no bag, one without joint states, efforts or a description of the arm, or numbers not finite.
    """
    arm = read_data(path).arms[0]
    if "joint_effort" not in arm.channels:
        raise InputError(f"bag {path}", got="joint states without efforts", expected="one effort per joint")
    states = arm.channel("joints")
    if (count := len(np.unique(states.times))) < LEAST_SAMPLES:
        raise InputError(f"bag {path}", got=f"{count} joint states", expected=f"at least {LEAST_SAMPLES} of them")
    if not (np.isfinite(states.rows).all() and np.isfinite(velocity_of(arm)).all()):
        raise InputError(f"bag {path}", got="joint states that are not finite", expected="numbers")
    return arm


def velocity_of(arm: ArmData) -> Array:
    """Return the joint velocities, differences of the positions if only those are measured; (N, n) [rad/s]."""
    states, v = arm.channel("joints"), arm.channel("joint_velocity").rows
    return np.gradient(states.rows, states.times, axis=0) if v.shape != states.rows.shape or np.isnan(v).all() else v


def slip_mistake(arm: ArmData) -> str:
    """Return what slip velocities show against the wrench, and what to do; empty where they show nothing.

    A pad slips in its plane, along x and y, and turns about z.
    """
    if not {"wrench", "slip_measured"} <= arm.channels.keys():
        return ""
    (times, h), (stamps, twists) = ((own.times, own.rows) for own in map(arm.channel, ("wrench", "slip_measured")))
    scale = np.array([1.0, 1.0, 0.0, 0.0, 0.0, GovernorParams().torsional_radius])
    found = compare(times, -h * (scale > 0.0), stamps, twists * scale, SLIP_SPEED, DIFFERS)
    health = SensorHealth(int(found.found))
    words = health.words.format(value=found.value, limit=found.limit)
    return f"slip_velocity {words}: {health.to_do}" if words else ""


def identify(motion: ArmData, frame: str) -> pd.DataFrame:
    """Return the numbers of each joint by least squares over the motion; a row per joint, COLUMNS.

    effort = M qdd + C qd + g - J^T h + coulomb sign(qd) + viscous qd - offset, with velocities smoothed over 0.1 s.

    frame: link at which the wrench, if there is one, is measured.
    """
    robot = Robot(motion.urdf, frame, motion.joint_names)
    times, q, v = motion.channel("joints").times, motion.channel("joints").rows, velocity_of(motion)
    dt, wrench = float(np.median(np.diff(times))), np.zeros((len(q), 6))
    if felt := motion.channels.get("wrench"):
        wrench = felt.rows[np.maximum(np.searchsorted(felt.times, times, side="right") - 1, 0)]
    smooth, acceleration = _smoothed(v, dt)
    model, load, buffer, n = np.empty_like(q), np.empty_like(q), new(ARM), q.shape[1]
    arm: Arm = record(buffer, ARM)
    for k in range(len(q)):
        robot.terms(q[k], smooth[k], buffer)
        model[k] = arm.M[:n, :n] @ acceleration[k] + arm.bias[:n]
        h = wrench[k]
        load[k] = arm.J[:, :n].T @ np.concatenate((arm.rotation @ h[:3], arm.rotation @ h[3:]))
    rest = motion.channel("joint_effort").rows - model + load
    found = pd.DataFrame(np.nan, index=pd.Index(motion.joint_names, name="joint"), columns=list(COLUMNS))
    # Differences in which the motion itself cancels.
    found["noise_position"] = np.std(np.diff(q, n=3, axis=0), axis=0) / np.sqrt(20.0)
    found["noise_velocity"] = np.std(np.diff(v, n=2, axis=0), axis=0) / np.sqrt(6.0)
    found["quantum"] = [_quantum(column) for column in q.T]
    fewest = np.sqrt(max(1.0, WINDOW_S / dt))
    for name, speed, effort in zip(motion.joint_names, smooth.T, rest.T, strict=True):
        moves = np.abs(speed) > max(LEAST_SPEED, 6.0 * float(found.at[name, "noise_velocity"]) / fewest)
        if min(np.mean(moves & (speed > 0.0)), np.mean(moves & (speed < 0.0))) < LEAST_SHARE:
            continue
        y, x, columns = effort[moves], speed[moves], ["coulomb", "offset"]
        A = np.stack([np.sign(x), -np.ones_like(x), x], axis=1)
        if np.std(np.abs(x)) > 0.1 * np.mean(np.abs(x)):
            columns.append("viscous")
        A = A[:, : len(columns)]
        solved = np.linalg.lstsq(A, y, rcond=None)[0]
        found.loc[name, [*columns, "residual"]] = [*solved, np.sqrt(np.mean((y - A @ solved) ** 2))]
    return found


def preset(numbers: pd.DataFrame, source: str) -> str:
    """Return a drive file for ``--drive`` with these numbers; what was not seen is left out."""
    seen = numbers[["coulomb", "viscous", "offset"]].dropna(axis="columns")
    friction = ["coulomb", "viscous"]
    drive = seen.assign(**{name: seen[name].clip(lower=0.0) for name in friction if name in seen}).round(4)
    noise, quantum = numbers[["noise_position", "noise_velocity"]].max(), float(numbers["quantum"].max())
    if quantum > 0.0:
        noise["noise_position"] = 0.0  # what differences show of it is the quantum's
    joint = {**noise, "quantum_position": quantum}
    content = {
        "description": "An arm as measured.",
        "sources": source,
        "drive": drive.to_dict("list"),
        "joint": {name: float(f"{value:.3g}") for name, value in joint.items()},
    }
    return yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=120)


def _smoothed(velocity: Array, dt: float) -> tuple[Array, Array]:
    """Return smoothed velocities and their derivative; (N, n) [rad/s], [rad/s^2]."""
    from scipy.signal import savgol_filter

    length = max(5, 2 * (round(WINDOW_S / dt) // 2) + 1)
    smooth = savgol_filter(velocity, length, 2, axis=0)
    return smooth, savgol_filter(velocity, length, 2, deriv=1, delta=dt, axis=0)


def _quantum(position: Array) -> float:
    """Return the step of the readings [rad]; 0 where their differences are no multiples of one."""
    steps = np.abs(np.diff(position))
    steps = steps[steps > 1e-9]
    if len(steps) < 10:
        return 0.0
    least = float(steps.min())
    whole = np.abs(steps / least - np.round(steps / least)) < 0.01
    return least if np.mean(whole) >= STEPS and np.mean(steps < 1.5 * least) > 0.01 else 0.0
