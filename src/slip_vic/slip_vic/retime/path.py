"""Paths to retime: of joints or of the pad, from CSV files and bags, as smooth curves over their own time."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
import pandas as pd
from scipy.interpolate import BSpline, make_interp_spline
from scipy.spatial.transform import Rotation

from slip_bags.reader import Bag
from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_core.records import new, record
from slip_core.vectors import Vec
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.law.rotation import left_jacobian, left_jacobian_rate
from slip_vic_controller.robot import Robot

POSE_COLUMNS = ("x", "y", "z", "qx", "qy", "qz", "qw")
TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
LEAST_POINTS = 2
DEGREE = 5


class PadMotion(NamedTuple):
    """The pad at one time {w}: position (3,) [m], rotation (3, 3), twist (6,) and acceleration (6,), linear first."""

    position: Array
    rotation: Array
    twist: Array
    acceleration: Array


class GivenPath(Protocol):
    """A curve over its own time [s], at rest at both ends."""

    @property
    def duration(self) -> float:
        """Time from start to end as given [s]."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coordinates."""

    def coordinates(self, t: float) -> tuple[Array, Array, Array]:
        """Return the coordinates and their first and second derivative, each (n,)."""

    def pad(self, t: float) -> PadMotion:
        """Return the motion of the pad."""


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


def read_points(path: Path, topic: str = "") -> Points:
    """Read a path: a CSV file with a column `time` [s], or a bag with a JointTrajectory.

    The other columns are joint positions by joint name [rad], or the pad's pose: x y z [m], qx qy qz qw.

    Args:
        path: file or bag.
        topic: of the trajectory in a bag; empty where there is only one.

    Raises:
        InputError: not such a file, or times and numbers that make no path.
    """
    return _checked(_from_csv(path) if path.suffix == ".csv" else _from_bag(path, topic), str(path))


def _from_csv(path: Path) -> Points:
    if not path.is_file():
        raise InputError(f"path {path}", got="no such file", expected="a CSV file or a bag")
    try:
        table = pd.read_csv(path, skipinitialspace=True)
    except (OSError, ValueError) as error:
        raise InputError(
            f"path {path}", got=type(error).__name__, expected="a CSV file with a header line", fix=str(error)
        ) from None
    if "time" not in table.columns:
        raise InputError(f"path {path}", got=f"columns {list(table.columns)}", expected="a column `time` [s]")
    others = [name for name in table.columns if name != "time"]
    names = POSE_COLUMNS if set(others) == set(POSE_COLUMNS) else tuple(others)
    try:
        numbers = table[["time", *names]].to_numpy(dtype=np.float64)
    except ValueError as error:
        raise InputError(f"path {path}", got=str(error), expected="numbers") from None
    return Points(numbers[:, 0], numbers[:, 1:], names)


def _from_bag(path: Path, topic: str) -> Points:
    with Bag(path) as bag:
        known = [name for name, info in bag.topics.items() if info.type_name == TRAJECTORY]
        if (topic and topic not in known) or (not topic and len(known) != 1):
            raise InputError(
                f"trajectory in {path}", got=topic or f"{len(known)} topics of type {TRAJECTORY}",
                expected=f"one of {known}" if known else f"a topic of type {TRAJECTORY}", fix="--topic NAME",
            )  # fmt: skip
        message = next(iter(bag.messages(topic or known[0])), None)
    if message is None:
        raise InputError(f"trajectory in {path}", got="no message", expected="one")
    points = message.value.points
    times = [point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec for point in points]
    return Points(
        np.array(times), np.array([point.positions for point in points]), tuple(message.value.joint_names)
    )  # fmt: skip


def _checked(points: Points, what: str) -> Points:
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
                "path", got=f"columns {list(points.names)}",
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
        self._robot, self._spline = robot, _spline(points.times, values)
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
            arm.position.copy(), arm.rotation.copy(), arm.twist.copy(), arm.J[:, :n] @ qdd + arm.jdot_qd
        )  # fmt: skip


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
        self._spline = _spline(points.times, np.hstack((points.values[:, :3], phi)))

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


def _spline(times: Array, values: Array) -> BSpline:
    rest = [(1, np.zeros(values.shape[1])), (2, np.zeros(values.shape[1]))]
    return make_interp_spline(times, values, k=DEGREE, bc_type=(rest, rest))
