"""Numbers that sum up a run; the same definitions for demo, bench and study."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from slip_core.arrays import Array
from slip_core.params import build
from slip_vic.run.data import ArmData
from slip_vic.scenarios.reach import pad_path
from slip_vic_controller.params.controller_params import TrajectoryParams

ARRIVED = 1e-3, float(np.radians(0.5))
"""[m], [rad]"""
AT_REST = 1e-3
"""Speed of the reference below which its path is over [m/s, rad/s]."""


def summarise(run: ArmData) -> dict[str, float]:
    """Return slip, tracking and effort of one run.

    slip_*: norm of the displacement of the pad on the object, at the end and at its peak, and peak sliding
    speed. off_path_m, attitude_excursion_rad and tracking_rms_*: the largest and the root mean square pose error e of
    the law. final_error_*: how far the pad ends from its goal. arrival_s: from when on it stays within 1 mm and 0.5
    degrees of its goal; NaN where it does not.
    squeeze_*: as commanded. effort_rate_rms: of the norm of the change of all efforts from tick to tick. What the law
    reports is NaN where it was never active.
    """
    slip, slip_velocity = run.channel("slip").rows, run.channel("slip_velocity").rows
    linear = np.linalg.norm(slip[:, :3], axis=1)
    angular = np.linalg.norm(slip[:, 3:], axis=1)
    error = run.law_six("e")
    evaluated = error[np.isfinite(error).all(axis=1)]
    if not len(evaluated):
        evaluated = np.full((1, 6), np.nan)
    rms = np.sqrt(np.mean(evaluated**2, axis=0))
    squeeze = run.channel("law").rows[:, [name == "grip_command" for name in run.symbols]]
    squeeze = squeeze[np.isfinite(squeeze)]
    if not len(squeeze):  # where nothing is governed it is as configured
        squeeze = np.array([run.parameters.get("grip.nominal_force", math.nan)])
    end = [float(part[-1]) if len(part) else math.nan for part in off_goal(run)[1:]]
    return {
        "slip_linear_m": float(linear[-1]),
        "slip_angular_rad": float(angular[-1]),
        "slip_linear_peak_m": float(linear.max()),
        "slip_speed_peak_m_s": float(np.linalg.norm(slip_velocity[:, :3], axis=1).max()),
        "tracking_rms_m": float(np.linalg.norm(rms[:3])),
        "tracking_rms_rad": float(np.linalg.norm(rms[3:])),
        "final_error_m": end[0],
        "final_error_rad": end[1],
        "arrival_s": arrival_s(run),
        "off_path_m": float(np.linalg.norm(evaluated[:, :3], axis=1).max()),
        "attitude_excursion_rad": float(np.linalg.norm(evaluated[:, 3:], axis=1).max()),
        "squeeze_mean_n": float(squeeze.mean()),
        "squeeze_peak_n": float(squeeze.max()),
        "effort_peak_nm": float(np.nanmax(np.abs(run.channel("effort").rows), initial=0.0)),
        "effort_rate_rms_n_m_s": effort_rate(run),
        "load_peak": float(np.max(load_ratio(run), initial=-math.inf)),
    }


def load_ratio(run: ArmData) -> Array:
    """Return how much of the friction, as the controller is configured, the measured load takes; (N,).

    Force and torque over the torsional radius on the axes on which the pad slips, over the friction limit; NaN where
    there is none.
    """
    given = run.parameters
    limit, radius = given.get("governor.friction_limit"), given.get("governor.torsional_radius")
    wrench = run.channels["wrench"].rows if "wrench" in run.channels else np.full((1, 6), np.nan)
    if not limit or not radius:
        return np.full(len(wrench), np.nan)
    slips = np.array(given["contacts.slip_axes"][:6], dtype=float)
    return np.array(np.linalg.norm(wrench * slips / (1.0, 1.0, 1.0, radius, radius, radius), axis=1) / limit)


def goal_of(run: ArmData) -> tuple[Array, Rotation] | None:
    """Return position [m] and attitude {w} of the goal of the pad; None where the run has none.

    That of a built-in path is its end as planned: a governed path may rest before it, and a run may be over before. A
    path of the object leads the pad where it is configured to grasp it. On a topic it is the last reference, if that
    rests.
    """
    times, _, desired = _at_work(run)
    if not len(times):
        return None
    given = {name: run.parameters.get(f"trajectory.{name}") for name in TrajectoryParams.model_fields}
    path = build(TrajectoryParams, {name: value for name, value in given.items() if value is not None}, "trajectory")
    if given["kind"] in (None, "topic", "goal"):
        speed = np.abs(np.diff(desired[-2:], axis=0)) / np.diff(times[-2:])[:, None]
        return None if (speed > AT_REST).any() else (desired[-1, :3], Rotation.from_rotvec(desired[-1, 3:]))
    way = pad_path(path, 2)[1][-1]
    start, turned = Rotation.from_rotvec(desired[0, 3:]), Rotation.from_rotvec(way[3:])
    goal = desired[0, :3] + way[:3]
    if path.of == "object":
        of_object = start * Rotation.from_quat(run.parameters["contacts.orientation_xyzw"][:4]).inv()
        lever = of_object.apply(run.parameters["contacts.position"][:3])
        goal = goal + turned.apply(lever) - lever
    return goal, turned * start


def off_goal(run: ArmData) -> tuple[Array, Array, Array]:
    """Return how far the pad is from its goal while the law commands it: times [s], distances [m], angles [rad]."""
    goal, (times, position, _) = goal_of(run), _at_work(run)
    if goal is None:
        return times, *np.full((2, len(times)), np.nan)
    turned = goal[1].inv() * Rotation.from_rotvec(position[:, 3:])
    return times, np.linalg.norm(position[:, :3] - goal[0], axis=1), turned.magnitude()


def arrival_s(run: ArmData) -> float:
    """Return from when on the pad stays within ARRIVED of its goal [s]; NaN where it does not get there."""
    times, distances, angles = off_goal(run)
    near = (distances < ARRIVED[0]) & (angles < ARRIVED[1])
    if not near[-1:].any():
        return math.nan
    return float(times[0 if near.all() else int(np.flatnonzero(~near)[-1]) + 1])


def _at_work(run: ArmData) -> tuple[Array, Array, Array]:
    """Return times (N,) [s], pose of the pad and of its reference (N, 6) wherever the law commanded the arm."""
    position, desired = run.law_six("position"), run.law_six("desired")
    known = np.isfinite(np.hstack((position, desired))).all(axis=1)
    return run.channel("law").times[known], position[known], desired[known]


def effort_rate(run: ArmData) -> float:
    """Return the root mean square of the change of all efforts per time [N m/s]."""
    rows, times = run.channel("effort").rows, run.channel("slip").times
    effort = rows[np.isfinite(rows).all(axis=1)]
    if len(effort) < 2:
        return 0.0
    period = (times[-1] - times[0]) / (len(times) - 1)
    return float(np.sqrt(np.mean((np.diff(effort, axis=0) ** 2).sum(axis=1))) / period)


def summary_table(runs: Mapping[str, Mapping[str, Any]]) -> pd.DataFrame:
    """Return the numbers of some runs by name, each as `summarise` returns it, that all of them have, as texts."""
    rows = {
        label: [f"{scale * run[key]:.{digits}f}" if not math.isnan(run[key]) else "-" for run in runs.values()]
        for key, label, scale, digits in ROWS
        if all(key in run for run in runs.values())
    }
    return pd.DataFrame.from_dict(rows, orient="index", columns=list(runs))


_DEG = 180.0 / math.pi
ROWS: tuple[tuple[str, str, float, int], ...] = (
    ("slip_linear_m", "slip at the end [mm]", 1e3, 2),
    ("slip_angular_rad", "slip at the end [deg]", _DEG, 2),
    ("slip_linear_peak_m", "peak slip [mm]", 1e3, 2),
    ("slip_speed_peak_m_s", "peak slip speed [mm/s]", 1e3, 1),
    ("off_path_m", "path error, peak [mm]", 1e3, 2),
    ("attitude_excursion_rad", "path error, peak [deg]", _DEG, 2),
    ("final_error_m", "goal error [mm]", 1e3, 3),
    ("final_error_rad", "goal error [deg]", _DEG, 3),
    ("arrival_s", "arrives after [s]", 1.0, 2),
    ("internal_peak_n", "internal force, peak [N]", 1.0, 2),
    ("squeeze_mean_n", "squeeze, mean [N]", 1.0, 2),
    ("squeeze_peak_n", "squeeze, peak [N]", 1.0, 2),
    ("load_peak", "load / nominal friction, peak", 1.0, 2),
    ("effort_peak_nm", "peak effort [N m]", 1.0, 1),
)
"""Key, label, scale and digits; the internal force is that of several arms."""
