"""What `slip-vic retime` does: read, time, certify, write."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
import yaml
from scipy.spatial.transform import Rotation

from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_core.params import build, flatten
from slip_core.stamps import NS_PER_S
from slip_core.types import AXES
from slip_vic.options import Choice
from slip_vic.retime.certificate import Motion, arm_shares, certified, load_shares, motion_of
from slip_vic.retime.path import POSE_COLUMNS, JointPath, PadPath, deviation, read_points, sections
from slip_vic.retime.timing import MOST_SAMPLES, Sample
from slip_vic.scenarios.parameter_files import write_files
from slip_vic.scenarios.scenario import Scenario, load
from slip_vic_controller.config.controller import ArmController
from slip_vic_controller.params.controller_params import ControllerParams

GOAL_PERIOD_S: Final = 0.02
"""Points of the goal for an action server: it interpolates between them."""


def run_retime(source: Path, choice: Choice, out: Path) -> Iterator[str]:
    """Retime a path and write the results below `out`; yield the report, line by line.

    A section keeps its own timing, slowed down where friction requires it. If the fastest motion arrives earlier, but
    not before the section's own duration, it is used instead.

    Args:
        source: CSV file.
        choice: the scenario whose arm, object, grip and friction count.
        out: folder.

    Raises:
        InputError: no path, one that friction cannot carry; a folder that cannot be written.
    """
    loaded = load(**choice)
    given = read_points(source, loaded.controller.joint_names)
    timed = len(given.times) > 0
    fastest, as_given = governed(loaded, "time_optimal"), governed(loaded, "slow_down") if timed else None
    params, samples, away = fastest.params, list[Sample](), np.zeros(2)
    if timed and given.times[-1] > MOST_SAMPLES * params.control_period_s:
        raise InputError(
            f"path {source}", got=f"{given.times[-1]:g} s", fix="times are in seconds; or part it where it rests",
            expected=f"at most {MOST_SAMPLES * params.control_period_s:g} s",
        )  # fmt: skip
    for part, wait_s in sections(given, params.governor.torsional_radius):
        path = PadPath(part) if given.of_pad else JointPath(part, fastest.robot)
        away = np.maximum(away, deviation(part, path))
        left = MOST_SAMPLES - len(samples)
        found = certified(path, fastest, left)
        if as_given is not None:
            early = (len(found) - 1) * params.control_period_s < path.duration
            try:
                found = certified(path, as_given, left if early else len(found))
            except InputError:
                if early:
                    raise
        samples += found[len(samples) > 0 :]  # a section begins where the previous one ended
        samples += [Sample(path, samples[-1].time, 0.0, 0.0)] * round(wait_s / params.control_period_s)
    motion = motion_of(samples, params.control_period_s)
    loads, margin = load_shares(params, motion), params.governor.margin
    peak, at_s = float(loads.max()), float(motion.times[loads.argmax()])
    data: dict[str, Any] = {
        "holds": peak <= margin,
        "arrival_s": float(motion.times[-1]),
        "duration_given_s": float(given.times[-1]) if timed else None,
        "friction_limit_n": params.governor.friction_limit,
        "margin": margin,
        "peak_share": peak,
        "peak_at_s": at_s,
        "deviation": float(away[0] if given.of_pad else away[1]),
        "deviation_rad": float(away[1]),
        "samples": len(samples),
    }
    shares: dict[str, Array] = {}
    files = {"trajectory.csv": csv_text(given.names, motion)}
    if not given.of_pad:
        files["follow_joint_trajectory.yaml"] = goal_text(given.names, motion)
        shares = arm_shares(fastest, motion)
        data |= {f"peak_{what}_share": float(share.max()) for what, share in shares.items()}
    write_files(out, files | {"certificate.json": json.dumps(data, indent=2) + "\n"})
    before = f"; the path as given takes {given.times[-1]:.3f} s" if timed else ""
    yield f"arrival {motion.times[-1]:.3f} s{before}"
    millimetres = f"{1e3 * away[0]:.2g} mm and " if given.of_pad else ""
    yield f"at most {millimetres}{np.degrees(away[1]):.2g} degrees from the straight lines between the points"
    yield f"load at most {100.0 * peak:.2f} % of the friction, at {at_s:.3f} s"
    for what, share in shares.items():
        if share.max() > 1.0:
            name = fastest.robot.joint_names[int(share.argmax())]
            yield f"warning: {name} would need {100.0 * share.max():.0f} % of its {what} limit"
    yield f"written: {out}"


def governed(loaded: Scenario, timing: str) -> ArmController:
    """Return the controller of a scenario with a governor of this kind.

    Raises:
        InputError: more than one arm holds the object.
    """
    if loaded.several:
        raise InputError(
            "scenario", got=f"{loaded.name}, in which several arms hold the object", expected="one arm",
            fix="how arms share a load depends on their controllers; run the scenario governed instead",
        )  # fmt: skip
    changes = {"governor.mode": timing, "governor.friction": "known", "trajectory.kind": "goal"}
    params = build(ControllerParams, flatten(loaded.controller) | changes, "retime")
    return ArmController(params, loaded.urdf, lockstep=True)


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
        sec, nanosec = divmod(round(1e9 * float(motion.times[i])), NS_PER_S)
        points.append({
            "positions": motion.position[i].tolist(), "velocities": motion.velocity[i].tolist(),
            "accelerations": motion.acceleration[i].tolist(), "effort": [],
            "time_from_start": {"sec": sec, "nanosec": nanosec},
        })  # fmt: skip
    header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    goal = {"trajectory": {"header": header, "joint_names": list(names), "points": points}}
    return yaml.safe_dump(goal, default_flow_style=None, sort_keys=False)
