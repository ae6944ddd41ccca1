"""What `slip-vic retime` writes of a motion: a CSV file, and a goal for FollowJointTrajectory."""

from __future__ import annotations

import numpy as np
import pandas as pd
import yaml
from scipy.spatial.transform import Rotation

from slip_core.arrays import Array
from slip_core.types import AXES
from slip_vic.retime.certificate import Motion
from slip_vic_controller.path.joint_path import POSE_COLUMNS

GOAL_PERIOD_S = 0.02
"""Points of the goal for an action server: it interpolates between them."""


def csv_text(names: tuple[str, ...], motion: Motion) -> str:
    """Return a row per control period: time [s], coordinates, velocities and accelerations.

    Of the pad: pose, twist and acceleration {w}.
    """
    columns: dict[str, Array] = {"time": motion.times}
    if names == POSE_COLUMNS:
        pad = motion.pad
        poses = np.hstack((pad.position, Rotation.from_matrix(pad.rotation).as_quat()))
        columns |= dict(zip(POSE_COLUMNS, poses.T, strict=True))
        columns |= {f"twist_{axis}": pad.twist[:, k] for k, axis in enumerate(AXES)}
        columns |= {f"acceleration_{axis}": pad.acceleration[:, k] for k, axis in enumerate(AXES)}
    else:
        kinds = {"": motion.position, "_velocity": motion.velocity, "_acceleration": motion.acceleration}
        for suffix, rows in kinds.items():
            columns |= {f"{name}{suffix}": rows[:, k] for k, name in enumerate(names)}
    return pd.DataFrame(columns).to_csv(index=False, float_format="%.9g")


def goal_text(names: tuple[str, ...], motion: Motion) -> str:
    """Return a goal of control_msgs/action/FollowJointTrajectory as YAML, first and last sample included."""
    step = max(1, round(GOAL_PERIOD_S / float(motion.times[1] - motion.times[0])))
    points = []
    for i in sorted({*range(0, len(motion.times), step), len(motion.times) - 1}):
        sec, nanosec = divmod(round(1e9 * float(motion.times[i])), 1_000_000_000)
        points.append({
            "positions": motion.position[i].tolist(), "velocities": motion.velocity[i].tolist(),
            "accelerations": motion.acceleration[i].tolist(), "effort": [],
            "time_from_start": {"sec": sec, "nanosec": nanosec},
        })  # fmt: skip
    header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    goal = {"trajectory": {"header": header, "joint_names": list(names), "points": points}}
    return yaml.safe_dump(goal, default_flow_style=None, sort_keys=False)
