"""One run as arrays, read from its bag: what metrics and pictures are made of."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from slip_bags.reader import Bag
from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_core.stamps import stamp_to_ns

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


def read_series(path: Path) -> RunSeries:
    """Read the series of one recorded run.

    Raises:
        InputError: where the bag lacks a topic that a run has.
    """
    with Bag(path) as bag:
        truth = _messages(bag, "slip_truth")
        odometry = _messages(bag, "object_state")
        efforts = [message for message in _messages(bag, "effort_command") if len(message.effort)]
        scalars = _messages(bag, "controller/scalars")
        ee_pose = _messages(bag, "controller/ee_pose")[0].pose
    start_ns = stamp_to_ns(truth[0].header.stamp)
    object_position = np.array([_xyz(m.pose.pose.position) for m in odometry])
    object_rotation = Rotation.from_quat([_xyzw(m.pose.pose.orientation) for m in odometry]).as_matrix()
    object_twist = np.array([[*_xyz(m.twist.twist.linear), *_xyz(m.twist.twist.angular)] for m in odometry])
    # {p} is {ee} at the first tick, fixed in the object from then on.
    R_0 = object_rotation[0]
    o_x_p = R_0.T @ (np.array(_xyz(ee_pose.position)) - object_position[0])
    o_R_p = R_0.T @ Rotation.from_quat(_xyzw(ee_pose.orientation)).as_matrix()
    lever = object_rotation @ o_x_p
    linear = np.einsum("nij,nj->ni", object_rotation, object_twist[:, :3])
    angular = np.einsum("nij,nj->ni", object_rotation, object_twist[:, 3:])
    names = list(scalars[0].name)
    table = np.array([m.position for m in scalars])
    return RunSeries(
        time=_times(truth, start_ns),
        slip_displacement=np.array([m.position for m in truth]),
        slip_velocity=np.array([m.velocity for m in truth]),
        grasp_position=object_position + lever,
        grasp_rotation=object_rotation @ o_R_p,
        grasp_twist=np.hstack([linear + np.cross(angular, lever), angular]),
        effort=np.array([m.effort for m in efforts]),
        law_time=_times(scalars, start_ns),
        law={name: table[:, i] for i, name in enumerate(names)},
    )


def _messages(bag: Bag, topic: str) -> list[Any]:
    full = next((name for name in bag.topics if name.rstrip("/").endswith(f"/{topic.lstrip('/')}")), None)
    found = [message.value for message in bag.messages(full)] if full else []
    if not found:
        raise InputError(f"bag {bag.path}", got=f"no message on {topic}", expected="a recorded run of this suite")
    return found


def _times(messages: list[Any], start_ns: int) -> Array:
    return np.array([(stamp_to_ns(m.header.stamp) - start_ns) * 1e-9 for m in messages])


def _xyz(value: Any) -> tuple[float, float, float]:
    return value.x, value.y, value.z


def _xyzw(value: Any) -> tuple[float, float, float, float]:
    return value.x, value.y, value.z, value.w


def rotation_angle_about(rotations: Array, axis: Array) -> Array:
    """Return the unwrapped angle about `axis` relative to the first rotation; (N, 3, 3), (3,) {w} -> (N,) [rad]."""
    half = Rotation.from_matrix(rotations @ rotations[0].T).as_quat(canonical=True)
    return np.unwrap(2.0 * np.arctan2(half[:, :3] @ axis, half[:, 3]))
