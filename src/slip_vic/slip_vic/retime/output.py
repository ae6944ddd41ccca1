"""What `slip-vic retime` writes: a CSV file, a goal for FollowJointTrajectory, and the certificate."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml
from scipy.spatial.transform import Rotation

from slip_core.arrays import Array
from slip_core.types import AXES
from slip_vic.retime.certificate import Certificate, Motion
from slip_vic_controller.path.joint_path import POSE_COLUMNS

GOAL_PERIOD_S = 0.02
"""Points of the goal for an action server: it interpolates between them."""


def write_csv(path: Path, names: tuple[str, ...], motion: Motion) -> None:
    """Write a row per control period: time [s], coordinates, velocities and accelerations.

    Of the pad: pose, twist and acceleration {w}.
    """
    columns: dict[str, Array] = {"time": motion.times}
    if names == POSE_COLUMNS:
        quaternions = Rotation.from_matrix(np.array([pad.rotation for pad in motion.pads])).as_quat()
        poses = np.hstack((np.array([pad.position for pad in motion.pads]), quaternions))
        columns |= dict(zip(POSE_COLUMNS, poses.T, strict=True))
        twists = np.array([pad.twist for pad in motion.pads])
        accelerations = np.array([pad.acceleration for pad in motion.pads])
        columns |= {f"twist_{axis}": twists[:, k] for k, axis in enumerate(AXES)}
        columns |= {f"acceleration_{axis}": accelerations[:, k] for k, axis in enumerate(AXES)}
    else:
        kinds = {"": motion.position, "_velocity": motion.velocity, "_acceleration": motion.acceleration}
        for suffix, rows in kinds.items():
            columns |= {f"{name}{suffix}": rows[:, k] for k, name in enumerate(names)}
    pd.DataFrame(columns).to_csv(path, index=False, float_format="%.9g")


def trajectory_message(names: tuple[str, ...], motion: Motion, period_s: float) -> dict[str, Any]:
    """Return a trajectory_msgs/JointTrajectory with a point per period, first and last sample included."""
    step = max(1, round(period_s / float(motion.times[1] - motion.times[0])))
    rows = sorted({*range(0, len(motion.times), step), len(motion.times) - 1})
    return {
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
        "joint_names": list(names),
        "points": [
            {
                "positions": motion.position[i].tolist(),
                "velocities": motion.velocity[i].tolist(),
                "accelerations": motion.acceleration[i].tolist(),
                "effort": [],
                "time_from_start": _duration(float(motion.times[i])),
            }
            for i in rows
        ],
    }


def write_goal(path: Path, names: tuple[str, ...], motion: Motion) -> None:
    """Write a goal of control_msgs/action/FollowJointTrajectory as YAML."""
    goal = {"trajectory": trajectory_message(names, motion, GOAL_PERIOD_S)}
    path.write_text(yaml.safe_dump(goal, default_flow_style=None, sort_keys=False), encoding="utf-8")


def certificate_data(
    certificate: Certificate, motion: Motion, given_s: float | None, deviation: float
) -> dict[str, Any]:
    """Return the numbers of a certificate; given_s: None for a path without times."""
    return {
        "holds": certificate.holds,
        "arrival_s": float(motion.times[-1]),
        "duration_given_s": given_s,
        "friction_limit_n": certificate.limit,
        "margin": certificate.margin,
        "peak_share": certificate.peak_share,
        "peak_at_s": float(motion.times[int(certificate.loads.argmax())]),
        "deviation": deviation,
        "samples": len(motion.times),
    }


def _duration(seconds: float) -> dict[str, int]:
    sec, nanosec = divmod(round(1e9 * seconds), 1_000_000_000)
    return {"sec": sec, "nanosec": nanosec}
