"""Paths to retime: of joints or of the pad, from CSV files, as smooth curves between their rests.

The geometry comes from the points alone: each section between two rests is a spline over its chord length. Of the given
times only the duration of a section and the waits between sections count.
"""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation
from scipy.special import betaincinv

from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_core.files.resources import read_text
from slip_core.vectors import Vec
from slip_vic_controller.law.rotation import left_jacobian, left_jacobian_rate
from slip_vic_controller.path.joint_path import POSE_COLUMNS, JointPath, PadMotion, Points, checked, spline

REST_STEP = 1e-6
"""Step between two points below which the path rests [m, rad] (ours: less than any encoder resolves)."""


def read_points(path: Path, joint_names: tuple[str, ...]) -> Points:
    """Read a path from a CSV file; without a column `time` [s] its times are empty.

    The other columns are joint positions by joint name [rad], or the pad's pose: x y z [m], qx qy qz qw. Their order
    becomes that of the arm, and of `POSE_COLUMNS`.

    Raises:
        InputError: not such a file, or numbers that make no path.
    """
    try:
        table = pd.read_csv(io.StringIO(read_text(str(path), f"path {path}")), skipinitialspace=True)
        others = [name for name in table.columns if name != "time"]
        names = next((known for known in (POSE_COLUMNS, joint_names) if set(known) == set(others)), tuple(others))
        values = table[list(names)].to_numpy(dtype=np.float64)
        times = table["time"].to_numpy(dtype=np.float64) if "time" in table.columns else np.empty(0)
    except ValueError as error:
        raise InputError(f"path {path}", got=str(error), expected="a CSV file with a header and numbers") from None
    checked(Points(np.arange(len(values), dtype=float), values, names), str(path))
    if len(times):
        _check_times(Points(times, values, names), str(path))
        times = times - times[0]
    return Points(times, values, names)


def _check_times(points: Points, what: str) -> None:
    """Refuse times that run backwards, or that are equal at two different poses."""
    wrong = ~(np.diff(points.times) > 0.0) & ((np.diff(points.times) != 0.0) | (chords(points) > REST_STEP))
    if wrong.any():
        row = int(np.argmax(wrong)) + 2
        raise InputError(f"path {what}", got=f"time {points.times[row - 1]} in row {row}", expected="growing times")


def chords(points: Points, radius: float = 1.0) -> Array:
    """Return the lengths of the steps between points; (m - 1,) [rad], or [m] of the pad.

    radius: at which a turn of the pad counts [m].
    """
    values = points.values
    if not points.of_pad:
        return np.linalg.norm(np.diff(values, axis=0), axis=1)
    first, second = values[:-1, 3:], values[1:, 3:]
    half = np.minimum(np.linalg.norm(second - first, axis=1), np.linalg.norm(second + first, axis=1))
    return np.hypot(np.linalg.norm(np.diff(values[:, :3], axis=0), axis=1), 2.0 * radius * half)


def sections(points: Points, radius: float) -> list[tuple[Points, float]]:
    """Return the stretches of a path between its rests, each with the time for which it rests at its end [s].

    They are over a time of their own in which they start and end at rest. What rests before the start of the path or
    after its end is left out.

    Args:
        points: as given; a section of a path without times has an own time of 1 s.
        radius: at which a turn of the pad counts [m].

    Raises:
        InputError: a path that does not move.
    """
    steps = chords(points, radius)
    moving = np.concatenate(([False], steps > REST_STEP, [False]))
    begins, ends = np.flatnonzero(np.diff(moving.astype(int)) > 0), np.flatnonzero(np.diff(moving.astype(int)) < 0)
    if not len(begins):
        raise InputError("path", got="points that are all the same", expected="a path that moves")
    found = []
    for k, (begin, end) in enumerate(zip(begins, ends, strict=True)):
        at = np.concatenate(([0.0], np.cumsum(steps[begin:end])))
        timed, last = len(points.times) > 0, k == len(begins) - 1
        duration = float(points.times[end] - points.times[begin]) if timed else 1.0
        wait = float(points.times[begins[k + 1]] - points.times[end]) if timed and not last else 0.0
        own = Points(duration * smooth_time(at / at[-1]), points.values[begin : end + 1], points.names)
        found.append((own, wait))
    return found


def smooth_time(share: Array) -> Array:
    """Return at which share of its time a motion of least jerk has gone a share of its length.

    10 x^3 - 15 x^4 + 6 x^5 is the distribution function of Beta(3, 3).

    Implements: ours: a path that rests at both ends, whatever the times of its points.
    """
    return np.array(betaincinv(3.0, 3.0, share))


def deviation(points: Points, motion: Array) -> float:
    """Return the largest distance of a motion (m, n) from the straight lines between its points [rad], or [m]."""
    columns = slice(0, 3) if points.of_pad else slice(None)
    given, rows = points.values[:, columns], motion[:, columns]
    starts, along = given[:-1], np.diff(given, axis=0)
    squares = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
    largest = 0.0
    for row in rows:
        share = np.clip(((row - starts) * along).sum(axis=1) / squares, 0.0, 1.0)
        largest = max(largest, float(np.linalg.norm(starts + share[:, None] * along - row, axis=1).min()))
    return largest


class PadPath:
    """A path of the pad: quintic splines of position and of the rotation vector from the first attitude.

    Args:
        points: poses of the pad {w}.

    Raises:
        InputError: quaternions of no length, or turns of half a revolution and more.
    """

    names = POSE_COLUMNS

    def __init__(self, points: Points) -> None:
        lengths = np.linalg.norm(points.values[:, 3:], axis=1)
        if (lengths < 1e-6).any():
            raise InputError("path", got="a quaternion of length 0", expected="unit quaternions")
        turned = Rotation.from_quat(points.values[:, 3:])
        self._start = turned[0].as_matrix()
        phi = (turned * turned[0].inv()).as_rotvec()
        if (np.linalg.norm(np.diff(phi, axis=0), axis=1) > np.pi).any() or (np.linalg.norm(phi, axis=1) > 3.1).any():
            raise InputError("path", got="a turn of half a revolution", expected="less than 3.1 rad from the start")
        self.duration = float(points.times[-1])
        self._spline = spline(points.times, np.hstack((points.values[:, :3], phi)))

    def coordinates(self, t: float) -> tuple[Array, Array, Array]:
        """Return position and rotation vector [m, rad] {w}, and their derivatives over the path's own time."""
        return self._spline(t), self._spline(t, 1), self._spline(t, 2)

    def pad(self, t: float) -> PadMotion:
        """Return the motion of the pad: omega = J_l phi_dot, alpha = J_l phi_ddot + Jdot_l phi_dot."""
        x, v, a = self.coordinates(t)
        phi, rate = Vec(*x[3:]), Vec(*v[3:])
        alpha = left_jacobian(phi, Vec(*a[3:])) + left_jacobian_rate(phi, rate)
        rotation = Rotation.from_rotvec(x[3:]).as_matrix() @ self._start
        twist = np.concatenate((v[:3], left_jacobian(phi, rate)))
        return PadMotion(x[:3], rotation, twist, np.concatenate((a[:3], alpha)))


GivenPath = JointPath | PadPath
"""A curve over its own time [s], at rest at both ends: of the joints, or of the pad."""
