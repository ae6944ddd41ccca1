"""Paths to retime: of joints or of the pad, from CSV files, as smooth curves between their rests.

The geometry comes from the points alone: each section between two rests is a spline over its chord length. Of the given
times only the duration of a section and the waits between sections count.
"""

from __future__ import annotations

import io
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.interpolate import BSpline, make_interp_spline
from scipy.spatial.transform import Rotation
from scipy.special import betaincinv

from slip_core.arrays import Array, product
from slip_core.errors import InputError
from slip_core.files.resources import bounded_memory, read_text
from slip_core.params import range_of
from slip_core.records import new, record
from slip_core.types import PadMotion
from slip_core.vectors import Vec
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.law.rotation import left_jacobian, left_jacobian_rate
from slip_vic_controller.robot import Robot

POSE_COLUMNS = ("x", "y", "z", "qx", "qy", "qz", "qw")
LEAST_POINTS = 2
"""A start and an end."""
DEGREE = 5
"""Of the splines: velocity and acceleration are given at both ends, and the acceleration has no corners."""
REST_STEP = 1e-6
"""Step between two points below which the path rests [m, rad] (ours: less than any encoder resolves)."""
NEAR, NEAR_RAD = 1e-4, math.radians(0.1)
"""A path that is returned is nearer than that to the straight lines between its points [m, rad]."""
CHECKED_STEP = 9
"""Places at which that is checked in each step: both ends, and the middle, where a bend lies farthest off."""


@dataclass(frozen=True)
class Points:
    """A path as it was given: times (m,) [s] from 0, coordinates (m, n), and their names."""

    times: Array
    values: Array
    names: tuple[str, ...]

    @property
    def of_pad(self) -> bool:
        """Whether these are poses of the pad."""
        return self.names == POSE_COLUMNS


def read_points(path: Path, joint_names: tuple[str, ...]) -> Points:
    """Read a path from a CSV file; without a column `time` [s] its times are empty.

    The other columns are joint positions by joint name [rad], or the pad's pose: x y z [m], qx qy qz qw. Their order
    becomes that of the arm, and of `POSE_COLUMNS`.

    Raises:
        InputError: not such a file, or numbers that make no path.
    """
    with bounded_memory(f"path {path}", "a CSV file with a header and numbers"):
        table = pd.read_csv(io.StringIO(read_text(str(path), f"path {path}")), skipinitialspace=True)
        if not isinstance(table.index, pd.RangeIndex):
            raise ValueError("rows with more values than the header has names")
        if (words := table.select_dtypes(exclude="number")).size:
            raise ValueError(f"words, or numbers beyond any size, in column {words.columns[0]}")
        others = [name for name in table.columns if name != "time"]
        names = next((known for known in (POSE_COLUMNS, joint_names) if set(known) == set(others)), tuple(others))
        values = table[list(names)].to_numpy(dtype=np.float64)
        times = table["time"].to_numpy(dtype=np.float64) if "time" in table.columns else np.empty(0)
    if len(values) < LEAST_POINTS:
        raise InputError(f"path {path}", got=f"{len(values)} points", expected=f"at least {LEAST_POINTS}")
    largest = range_of("m, rad")[1]
    if not (possible := (np.abs(values) <= largest).all(axis=1)).all():
        got = f"row {int(np.argmin(possible)) + 1}: {values[np.argmin(possible)].tolist()}"
        raise InputError(f"path {path}", got=got, expected=f"a number in each column, none beyond {largest:g}")
    if len(times):
        # They do not run backwards, and are not equal at two different poses.
        equal = (np.diff(times) == 0.0) & (chords(Points(times, values, names)) <= REST_STEP)
        if (wrong := ~(np.diff(times) > 0.0) & ~equal).any():
            row = int(np.argmax(wrong)) + 2
            raise InputError(f"path {path}", got=f"time {times[row - 1]} in row {row}", expected="growing times")
        times = times - times[0]
    return Points(times, values, names)


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

    They are over a time of their own in which they start and end at rest. A path that turns back rests there. What
    rests before the start of the path or after its end is left out.

    Args:
        points: as given; a section of a path without times has an own time of 1 s.
        radius: at which a turn of the pad counts [m].

    Raises:
        InputError: a path that does not move.
    """
    steps = chords(points, radius)
    moving, along = steps > REST_STEP, np.diff(points.values[:, : 3 if points.of_pad else None], axis=0)
    goes_on = moving[:-1] & moving[1:] & ((along[:-1] * along[1:]).sum(axis=1) >= 0.0)
    begins = np.flatnonzero(moving & ~np.concatenate(([False], goes_on)))
    ends = np.flatnonzero(moving & ~np.concatenate((goes_on, [False]))) + 1
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


class JointPath:
    """A path of the joints: a quintic spline, at rest and without acceleration at both ends.

    Args:
        points: positions of the joints, which may be in another order than the arm's.
        robot: the arm.

    Raises:
        InputError: joints missing, unknown, or beyond their ends.
    """

    def __init__(self, points: Points, robot: Robot) -> None:
        if set(points.names) != set(robot.joint_names):
            raise InputError(
                "path", got=f"joints {list(points.names)}",
                expected=f"the joints {list(robot.joint_names)}, or the pad's pose {list(POSE_COLUMNS)}",
            )  # fmt: skip
        order = [points.names.index(name) for name in robot.joint_names]
        values = points.values[:, order]
        for name, column, low, high in zip(
            robot.joint_names, values.T, robot.position_lower, robot.position_upper, strict=True
        ):
            if column.min() < low or column.max() > high:
                got = f"{name} from {column.min():.4f} to {column.max():.4f} rad"
                raise InputError("path", got=got, expected=f"{low:.4f} to {high:.4f} rad")
        self.duration = float(points.times[-1])
        self._robot, self._spline = robot, spline(points.times, values)
        self._buffer = new(ARM)
        self._arm = record(self._buffer, ARM)

    def coordinates(self, t: float | Array) -> tuple[Array, Array, Array]:
        """Return position [rad], velocity and acceleration of the joints over the path's own time."""
        return self._spline(t), self._spline(t, 1), self._spline(t, 2)

    def pad(self, t: float) -> PadMotion:
        """Return the motion of the pad: v = J qd, a = J qdd + Jdot qd."""
        q, qd, qdd = self.coordinates(t)
        self._robot.terms(q, qd, self._buffer)
        arm, n = self._arm, len(q)
        return PadMotion(
            arm.position.copy(), arm.rotation.copy(), arm.twist.copy(), product(arm.J[:, :n], qdd) + arm.jdot_qd
        )  # fmt: skip


class PadPath:
    """A path of the pad: quintic splines of position and of the rotation vector from the first attitude.

    Args:
        points: poses of the pad {w}.

    Raises:
        InputError: quaternions of no length, or turns of half a revolution and more.
    """

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

    def coordinates(self, t: float | Array) -> tuple[Array, Array, Array]:
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


def spline(times: Array, values: Array) -> BSpline:
    """Return the quintic spline through values (m, n) at times (m,), at rest and without acceleration at both ends.

    Raises:
        InputError: times too close for one.
    """
    rest = [(1, np.zeros(values.shape[1])), (2, np.zeros(values.shape[1]))]
    try:
        found = make_interp_spline(times, values, k=DEGREE, bc_type=(rest, rest))
    except (ValueError, np.linalg.LinAlgError):
        found = None
    if found is None or not np.isfinite(found.c).all():
        got = f"points as close as {np.diff(times).min():.3g} s"
        raise InputError("path: times", got=got, expected="points that a smooth curve passes through")
    return found


def deviation(points: Points, path: GivenPath) -> tuple[float, float]:
    """Return the largest distances of a path from the straight lines between its points: position [m], angle [rad].

    A path of joints has angles alone.

    Raises:
        InputError: 0.1 mm and more, or 0.1 degrees.
    """
    between = points.times[:-1, None] + np.diff(points.times)[:, None] * np.linspace(0.0, 1.0, CHECKED_STEP)
    starts, rows = path.coordinates(points.times)[0], path.coordinates(between.ravel())[0]
    rows, found = rows.reshape(*between.shape, -1), []
    for part in (slice(0, 3 * points.of_pad), slice(3 * points.of_pad, None)):
        first, along = starts[:-1, None, part], np.diff(starts[:, part], axis=0)[:, None]
        squares = np.maximum((along**2).sum(axis=-1), np.finfo(float).tiny)
        share = np.clip(((rows[..., part] - first) * along).sum(axis=-1) / squares, 0.0, 1.0)
        found.append(np.linalg.norm(first + share[..., None] * along - rows[..., part], axis=-1).max(axis=1))
    away, turned = found
    worst = int(np.maximum(away / NEAR, turned / NEAR_RAD).argmax())
    if away[worst] >= NEAR or turned[worst] >= NEAR_RAD:
        place = ", ".join(f"{name} {value:.3f}" for name, value in zip(points.names, points.values[worst], strict=True))
        raise InputError(
            "path", expected=f"less than {1e3 * NEAR:g} mm and {np.degrees(NEAR_RAD):g} degrees",
            got=f"a smooth curve {1e3 * away[worst]:.2g} mm, {np.degrees(turned[worst]):.2g} degrees "
            f"from the straight line after {place}",
            fix="more points where it bends, or the pose of a corner twice: there it rests",
        )  # fmt: skip
    return float(away.max()), float(turned.max())
