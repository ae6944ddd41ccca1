"""Runs of the data set proactive-slip-control: raw files to motion of the pads, of the object in them, and shear.

A run is a folder of robot_state.csv, marker.csv, slip_label.csv, xela_sensor1.csv and xela_sensor2.csv with the same
rows. The marker lies on top of the object and is level at the start, so that the axes of its first pose are ours: x is
the pads' normal, -y ahead along the path, -z down.
"""

from __future__ import annotations

import csv
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.signal import savgol_filter
from scipy.spatial.transform import Rotation

from examples.tactile_adapters.field_twist import planar_twist
from slip_core.arrays import Array
from slip_core.errors import InputError

RATE_HZ = 60.0
WINDOW, DEGREE = 11, 3  # of the local cubic that gives speed and acceleration: 0.18 s
REST = 40  # samples before anything moves: zero of marker and skin
NORMAL_TURN_DEG = 5.0  # about the axes that the pads hold: beyond it the marker was not seen but guessed
PITCH_M = 4.7e-3  # of the taxels of a uSkin 4x4
SIDE = 4
FEWEST = 20
LONGEST_S, FASTEST_M_S2 = 600.0, 50.0  # beyond it stamps are not seconds, or places not metres


class PadMotion(NamedTuple):
    """Motion of the pads along their path; each (n,)."""

    time: Array  # s
    position: Array  # m
    speed: Array  # m/s
    acceleration: Array  # m/s^2


class ObjectMotion(NamedTuple):
    """Motion of the marker relative to the hand since the start; each (n,), NaN where it was not seen."""

    rotation: Array  # rad, about the pads' normal; positive where the lower end lags behind
    ahead: Array  # m
    down: Array  # m


class Shear(NamedTuple):
    """Load of the skin since the start, mean of both fingers; each (n,) [counts]."""

    ahead: Array
    down: Array
    twist: Array  # of the field's rotation, times the taxels' rms distance from the centre
    normal: Array


def columns(path: Path, needed: tuple[str, ...]) -> dict[str, Array]:
    """Return columns of a CSV file by name; what is not a number is NaN.

    Raises:
        InputError: no such file, or a column is missing.
    """
    if not path.is_file():
        raise InputError(f"run file {path}", got="no such file", expected="a CSV file of the data set")
    try:
        with path.open(newline="", encoding="utf-8", errors="replace") as file:
            lines = [line for line in csv.reader(file) if line]
    except (OSError, csv.Error) as error:
        raise InputError(f"run file {path}", got=f"{error}", expected="a CSV file of the data set") from None
    names = [name.strip() for name in lines[0]] if lines else []
    missing = [name for name in needed if name not in names]
    if missing:
        raise InputError(f"run file {path}", got=f"no column {', '.join(missing)}", expected=", ".join(needed))
    return {name: np.array([_number(row, names.index(name)) for row in lines[1:]]) for name in needed}


def _number(row: list[str], index: int) -> float:
    try:
        return float(row[index])
    except (IndexError, ValueError):
        return np.nan


def pad_motion(time: Array, places: Array) -> PadMotion:
    """Return the motion along the path from places of the hand.

    Rows that are not finite or not later than all before are left out of the fit; all stamps get an answer.

    Args:
        time: stamps (n,) [s].
        places: (n, 2) or more, the horizontal ones first [m].

    Raises:
        InputError: fewer than FEWEST usable rows, or a motion that no arm makes.
    """
    usable = np.isfinite(time) & np.isfinite(places[:, :2]).all(axis=1)
    latest = np.maximum.accumulate(np.where(usable, time, -np.inf))
    usable &= np.concatenate(([True], time[1:] > latest[:-1]))
    if usable.sum() < FEWEST:
        raise InputError("run", got=f"{usable.sum()} usable rows", expected=f"{FEWEST} or more with time and ee_T")
    t, p = time[usable], places[usable, :2]
    if t[-1] - t[0] > LONGEST_S:
        raise InputError("run", got=f"{t[-1] - t[0]:.4g} s", expected=f"{LONGEST_S:g} s at most; stamps in seconds")
    grid = np.arange(t[0], t[-1] + 0.5 / RATE_HZ, 1.0 / RATE_HZ)
    way = p[-1] - p[0]
    s = np.interp(grid, t, (p - p[0]) @ (way / max(np.linalg.norm(way), 1e-9)))
    window = min(WINDOW, (grid.size - 1) // 2 * 2 + 1)
    given = np.where(np.isfinite(time), time, np.interp(np.arange(time.size), np.flatnonzero(usable), t))
    derivatives = [
        np.interp(given, grid, savgol_filter(s, window, min(DEGREE, window - 1), deriv=order, delta=1.0 / RATE_HZ))
        for order in range(3)
    ]
    largest = np.abs(derivatives[2]).max()
    if not largest < FASTEST_M_S2:
        raise InputError("run", got=f"{largest:.3g} m/s^2", expected=f"below {FASTEST_M_S2:g}; ee_T in metres")
    return PadMotion(given, *derivatives)


def read_pad_motion(run: Path) -> PadMotion:
    """Return the motion of the pads from robot_state.csv, and from nothing else."""
    state = columns(run / "robot_state.csv", ("time", "ee_T_03", "ee_T_13"))
    return pad_motion(state["time"], np.stack([state["ee_T_03"], state["ee_T_13"]], axis=1))


def read_object_motion(run: Path) -> ObjectMotion:
    """Return the motion of the object from marker.csv; from where slip_label.csv says `fail` it counts as not seen."""
    names = tuple(f"marker_position_{a}" for a in "xyz") + tuple(f"marker_quaternion_{a}" for a in "xyzw")
    marker = columns(run / "marker.csv", names)
    failed = columns(run / "slip_label.csv", ("fail",))["fail"]
    table = np.stack([marker[name] for name in names], axis=1)
    seen = np.isfinite(table).all(axis=1) & (np.cumsum(failed > 0.0) == 0)
    seen &= np.linalg.norm(table[:, 3:], axis=1) > 0.5
    turned = Rotation.from_quat(np.where(seen[:, None], table[:, 3:], [0.0, 0.0, 0.0, 1.0]))
    start = turned[np.flatnonzero(seen[:REST])].mean()
    vector = (start.inv() * turned).as_rotvec()
    seen &= np.abs(vector[:, 1:]).max(axis=1) < np.deg2rad(NORMAL_TURN_DEG)
    place = start.inv().apply(table[:, :3] - np.median(table[:REST, :3], axis=0))
    return ObjectMotion(*(np.where(seen, column, np.nan) for column in (vector[:, 0], -place[:, 1], -place[:, 2])))


def taxels() -> Array:
    """Return the places of a finger's taxels, in the order of the file, on the pad's axes; (16, 2) [m]."""
    index = np.arange(SIDE * SIDE)
    return (np.stack([index % SIDE, index // SIDE], axis=1) - (SIDE - 1) / 2) * PITCH_M


def read_fields(run: Path) -> Array:
    """Return the raw fields of both fingers since the start; (2, n, 16, 3) [counts]."""
    names = tuple(f"txl{i}_{a}" for i in range(1, SIDE * SIDE + 1) for a in "xyz")
    fingers = []
    for finger in (1, 2):
        read = columns(run / f"xela_sensor{finger}.csv", names)
        field = np.stack([read[name] for name in names], axis=1).reshape(-1, SIDE * SIDE, 3)
        fingers.append(field - field[:REST].mean(axis=0))
    return np.stack(fingers)


def shear(fields: Array) -> Shear:
    """Return what both fingers say together; the second looks the other way, so its y and its twist are turned round.

    fields: (2, n, 16, 3) [counts].
    """
    places = taxels()
    arm = np.sqrt((places**2).sum(axis=1).mean())
    parts = []
    for finger, mirrored in zip(fields, (-1.0, 1.0), strict=True):
        twists = [planar_twist(places, field[:, :2]) for field in finger]
        linear = np.array([twist.linear for twist in twists])
        angular = np.array([twist.angular for twist in twists])
        parts.append((mirrored * linear[:, 1], linear[:, 0], mirrored * arm * angular, finger[:, :, 2].mean(axis=1)))
    return Shear(*(np.mean(part, axis=0) for part in zip(*parts, strict=True)))
