"""Paths to retime: of joints or of the pad, from CSV files and bags, as smooth curves over their own time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from slip_bags.reader import Bag
from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_core.vectors import Vec
from slip_msgs_py.messages.from_msgs import joint_trajectory
from slip_vic_controller.law.rotation import left_jacobian, left_jacobian_rate
from slip_vic_controller.path.joint_path import POSE_COLUMNS, JointPath, PadMotion, Points, checked, spline

TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"


def read_points(path: Path, topic: str = "") -> Points:
    """Read a path: a CSV file with a column `time` [s], or a bag with a JointTrajectory.

    The other columns are joint positions by joint name [rad], or the pad's pose: x y z [m], qx qy qz qw.

    Args:
        path: file or bag.
        topic: of the trajectory in a bag; empty where there is only one.

    Raises:
        InputError: not such a file, or times and numbers that make no path.
    """
    return checked(_from_csv(path) if path.suffix == ".csv" else _from_bag(path, topic), str(path))


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
    return Points(*joint_trajectory(message.value))


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
