"""A path of the joints over its own time, as planners give it, and the motion of the pad along it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_core.matrices import product
from slip_core.records import new, record
from slip_core.types import CartesianReference
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.robot import Robot

POSE_COLUMNS = ("x", "y", "z", "qx", "qy", "qz", "qw")
LEAST_POINTS = 2
DEGREE = 5
START_M, START_RAD = 0.01, 0.05
"""Largest distance from the pad at which a trajectory may begin: without a governor the reference jumps there."""
CHECKED = 1000
"""Number of places of a trajectory at which joint speeds are checked."""


class PadMotion(NamedTuple):
    """The pad at one time {w}: position (3,) [m], rotation (3, 3), twist (6,) and acceleration (6,), linear first."""

    position: Array
    rotation: Array
    twist: Array
    acceleration: Array


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


def checked(points: Points, what: str) -> Points:
    """Return points whose times begin at 0.

    Raises:
        InputError: too few, not finite, or times that do not grow.
    """
    times, values = points.times, points.values
    if len(times) < LEAST_POINTS:
        raise InputError(f"path {what}", got=f"{len(times)} points", expected=f"at least {LEAST_POINTS}")
    if values.ndim != 2 or values.shape != (len(times), len(points.names)):
        raise InputError(f"path {what}", got=f"shape {values.shape}", expected=f"{len(points.names)} numbers a point")
    if not (np.isfinite(times).all() and np.isfinite(values).all()):
        row = int(np.argmin(np.isfinite(values).all(axis=1) & np.isfinite(times)))
        raise InputError(f"path {what}", got=f"row {row + 1} with numbers that are missing", expected="finite numbers")
    if not (np.diff(times) > 0.0).all():
        row = int(np.argmin(np.diff(times) > 0.0)) + 2
        raise InputError(f"path {what}", got=f"time {times[row - 1]} in row {row}", expected="growing times")
    return Points(times - times[0], values, points.names)


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
        self.names, self.duration = robot.joint_names, float(points.times[-1])
        self._robot, self._spline = robot, spline(points.times, values)
        self._buffer = new(ARM)
        self._arm = record(self._buffer, ARM)

    def coordinates(self, t: float) -> tuple[Array, Array, Array]:
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

    def check_motion(self, q: Array, velocity_limit: Array) -> None:
        """Refuse a path that an arm at joint positions q (n,) cannot follow now; velocity_limit (n,) [rad/s].

        Raises:
            InputError: it begins elsewhere, or a joint is too fast.
        """
        pad = self.pad(0.0)
        away, _ = self._robot.way_to(q, pad.position, pad.rotation)
        if np.linalg.norm(away[:3]) > START_M or np.linalg.norm(away[3:]) > START_RAD:
            raise InputError(
                "joint_trajectory: first point",
                got=f"{1e3 * np.linalg.norm(away[:3]):.1f} mm and {np.linalg.norm(away[3:]):.3f} rad from the pad",
                expected=f"{1e3 * START_M:g} mm and {START_RAD:g} rad at most", fix="plan from where the arm is",
            )  # fmt: skip
        speeds = np.abs(self._spline(np.linspace(0.0, self.duration, CHECKED), 1)).max(axis=0)
        worst = int((speeds / velocity_limit).argmax())
        if speeds[worst] > velocity_limit[worst]:
            raise InputError(
                f"joint_trajectory: {self.names[worst]}", got=f"{speeds[worst]:.3f} rad/s",
                expected=f"{velocity_limit[worst]:.3f} at most", fix="allow more time",
            )  # fmt: skip


class JointFeed:
    """References along a joint path, one by one.

    Governed, there is one each `period_s` of the path's time as long as less than `ahead_s` of the path waits: how fast
    it is run through is the governor's. Otherwise there is one per cycle, where the path is at that time.

    Args:
        path: the path.
        begin_ns: stamp of the cycle in which it was taken.
        period_s: between references, 0 where nothing governs them [s].
        ahead_s: most that may wait [s].
    """

    def __init__(self, path: JointPath, begin_ns: int, period_s: float = 0.0, ahead_s: float = 0.0) -> None:
        self.path, self._begin_ns, self._period_s, self._ahead_s = path, begin_ns, period_s, ahead_s
        self._time = -period_s

    @property
    def ended(self) -> bool:
        """Whether the end of the path has been given."""
        return self._time >= self.path.duration

    def next(self, now_ns: int, waits_s: float) -> CartesianReference | None:
        """Return the reference of a cycle, None where there is none.

        now_ns: stamp of the cycle; waits_s: how much of the path waits [s].
        """
        if self.ended or (self._period_s and waits_s >= self._ahead_s):
            return None
        time = self._time + self._period_s if self._period_s else (now_ns - self._begin_ns) * 1e-9
        self._time = min(time, self.path.duration)
        return CartesianReference(*self.path.pad(self._time), self._begin_ns + round(1e9 * self._time))


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
