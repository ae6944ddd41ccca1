"""One run as arrays, read from its bag: what metrics and pictures are made of."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from slip_bags.reader import Bag
from slip_bags.series import Series
from slip_core.arrays import Array
from slip_core.errors import InputError

AXES = ("x", "y", "z", "rx", "ry", "rz")


@dataclass(frozen=True, slots=True)
class RunSeries:
    """Arrays of one run; time starts at 0 with the first joint state.

    time (N,) [s]; slip_displacement (N, 6) [m, rad] {p}; slip_velocity (N, 6) pad axes; grasp_position (N, 3) [m]
    and grasp_rotation (N, 3, 3): the frame {p} that is fixed in the object, {w}; grasp_twist (N, 6) {w};
    effort (N, n) [N m]; law_time (M,) [s] and law: the controller's scalars by name, (M,) each.
    """

    time: Array
    slip_displacement: Array
    slip_velocity: Array
    grasp_position: Array
    grasp_rotation: Array
    grasp_twist: Array
    effort: Array
    law_time: Array
    law: dict[str, Array]

    def law_six(self, name: str) -> Array:
        """Return six scalars of the law as columns; (M, 6)."""
        return np.stack([self.law[f"{name}_{axis}"] for axis in AXES], axis=1)


def read_series(path: Path, arm: str = "") -> RunSeries:
    """Read the series of one recorded run, or of the arm in one namespace of it.

    Raises:
        InputError: where the bag lacks a topic that a run has.
    """
    with Bag(path) as bag:
        truth = _series(bag, "slip_truth", arm)
        odometry = _series(bag, "object_state")
        commands = _series(bag, "effort_command", arm)
        scalars = _series(bag, "controller/scalars", arm)
        ee_pose = _series(bag, "controller/ee_pose", arm)
    # A recorder on a busy machine may miss a message of one topic: the two go together by their stamps.
    stamps, of_truth, of_object = np.intersect1d(_stamps(truth), _stamps(odometry), return_indices=True)
    if not stamps.size:
        raise InputError(
            f"bag {path}", got="no slip_truth and object_state of one time", expected="a run of this suite"
        )
    start_ns = stamps[0]
    object_position = _columns(odometry, "pose.pose.position.", "xyz")[of_object]
    object_rotation = Rotation.from_quat(_columns(odometry, "pose.pose.orientation.", "xyzw")[of_object]).as_matrix()
    twist = [_columns(odometry, f"twist.twist.{part}.", "xyz")[of_object] for part in ("linear", "angular")]
    # {p} is {ee} at the first tick, fixed in the object from then on.
    R_0 = object_rotation[0]
    o_x_p = R_0.T @ (_columns(ee_pose, "pose.position.", "xyz")[0] - object_position[0])
    o_R_p = R_0.T @ Rotation.from_quat(_columns(ee_pose, "pose.orientation.", "xyzw")[0]).as_matrix()
    lever = object_rotation @ o_x_p
    linear, angular = (np.einsum("nij,nj->ni", object_rotation, part) for part in twist)
    names = [str(name) for name in scalars["name"][0]]
    table = scalars["position"]
    return RunSeries(
        time=(stamps - start_ns) * 1e-9,
        slip_displacement=truth["position"][of_truth],
        slip_velocity=truth["velocity"][of_truth],
        grasp_position=object_position + lever,
        grasp_rotation=object_rotation @ o_R_p,
        grasp_twist=np.hstack([linear + np.cross(angular, lever), angular]),
        effort=np.array([row for row in commands["effort"] if len(row)]),
        law_time=_times(scalars, start_ns),
        law={name: table[:, i] for i, name in enumerate(names)},
    )


def _series(bag: Bag, topic: str, arm: str = "") -> Series:
    own = f"/{arm}/{topic}" if arm else f"/{topic}"
    full = next((name for name in bag.topics if name.endswith(own)), None)
    found = bag.series(full) if full else None
    if found is None or not found.count:
        raise InputError(f"bag {bag.path}", got=f"no message on {topic}", expected="a recorded run of this suite")
    return found


def _stamps(series: Series) -> NDArray[np.int64]:
    assert series.stamp_ns is not None, "every topic here has a header"
    return series.stamp_ns


def _times(series: Series, start_ns: int) -> Array:
    return np.array((_stamps(series) - start_ns) * 1e-9)


def _columns(series: Series, prefix: str, parts: str) -> Array:
    return np.stack([series[prefix + part] for part in parts], axis=1)


def rotation_angle_about(rotations: Array, axis: Array) -> Array:
    """Return the unwrapped angle about `axis` relative to the first rotation; (N, 3, 3), (3,) {w} -> (N,) [rad]."""
    half = Rotation.from_matrix(rotations @ rotations[0].T).as_quat(canonical=True)
    return np.unwrap(2.0 * np.arctan2(half[:, :3] @ axis, half[:, 3]))
