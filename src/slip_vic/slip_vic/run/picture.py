"""One picture of a comparison, in the order of the paper's figures 5 to 11, then stiffness, gate and slip."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

from slip_core.arrays import Array
from slip_vic.run.series import RunSeries, rotation_angle_about

COLOURS = {"classical": "#d55e00", "vic": "#0072b2", "governed": "#009e73"}
"""Told apart by colour-blind people too (Okabe and Ito)."""
OTHERS = ("#cc79a7", "#56b4e9", "#e69f00", "#f0e442")
DESIRED: dict[str, Any] = {"color": "black", "linestyle": ":", "linewidth": 1.4, "label": "desired"}
NAMES = "xyz"


def write_report(path: Path, title: str, runs: Mapping[str, RunSeries]) -> None:
    """Write the picture of one or more runs of a scenario."""
    picture(title, runs).savefig(path, dpi=90)


def picture(title: str, runs: Mapping[str, RunSeries]) -> Figure:
    """Return the picture of one or more runs of a scenario; it needs no display and opens no window."""
    plane, normal = slip_plane(next(iter(runs.values())))
    governed = {name: run for name, run in runs.items() if "load_ratio" in run.law}
    rows = 5 if governed else 4
    figure = Figure(figsize=(16, 4.25 * rows), layout="constrained")
    axes = figure.subplots(rows, 3)
    figure.suptitle(title, fontsize=15)
    for column, axis in enumerate(plane):
        _position(axes[0, column], runs, axis, f"position along {NAMES[axis]} [m]")
        _velocity(axes[1, column], runs, axis, f"velocity along {NAMES[axis]} [m/s]")
    _angle(axes[0, 2], runs, normal)
    _velocity(axes[1, 2], runs, 3 + normal, f"angular velocity about {NAMES[normal]} [rad/s]")
    _path(axes[2, 0], runs, plane)
    _slip(axes[2, 1], runs, slice(0, 3), 1e3, "slip displacement [mm]")
    _slip(axes[2, 2], runs, slice(3, 6), 180.0 / np.pi, "slip displacement [deg]")
    for name, run in runs.items():
        for style, axis in zip(("-", "--"), plane, strict=True):
            axes[3, 0].plot(
                run.law_time, run.law_six("K")[:, axis], style, color=colour_of(name), label=f"{name} {NAMES[axis]}"
            )
        axes[3, 1].plot(run.law_time, run.law_six("K")[:, 3 + normal], color=colour_of(name), label=name)
        axes[3, 2].plot(run.law_time, run.law["gate"], color=colour_of(name), label=name)
    if governed:
        _governor(axes[4], governed)
    axes[3, 0].set_title("stiffness K(v_s) [N/m]")
    axes[3, 1].set_title(f"stiffness about {NAMES[normal]} [N m/rad]")
    axes[3, 2].set_title("gate tanh(alpha |v_s|)")
    for axis in axes.flat:
        axis.grid(alpha=0.3)
        axis.legend(fontsize=8)
        if axis is not axes[2, 0]:
            axis.set_xlabel("time [s]")
    return figure


def _governor(axes: Sequence[Axes], runs: Mapping[str, RunSeries]) -> None:
    """Show what the governor does: loads over friction, friction and grip, speed along the path and guard."""
    parts = (
        ("load over friction", {"load_ratio": "commanded", "friction_share": "measured", "margin": "allowed"}),
        ("friction limit, loads [N]", {"friction_limit": "F^", "load_commanded": "commanded", "grip_force": "grip"}),
        ("path", {"path_rate": "speed along it", "guard": "guard", "friction_events": "friction learnt, times"}),
    )
    for axis, (title, fields) in zip(axes, parts, strict=True):
        for name, run in runs.items():
            for (field, what), style in zip(fields.items(), ("-", "--", ":"), strict=True):
                if field in run.law:
                    axis.plot(run.law_time, run.law[field], style, color=colour_of(name), label=f"{name}, {what}")
        axis.set_title(title)


def colour_of(name: str) -> str:
    """Return the colour of a run by its label: that of its law, where it has one of its own."""
    known = next((COLOURS[word] for word in name.split() if word in COLOURS), None)
    return known or OTHERS[sum(name.encode()) % len(OTHERS)]


def slip_plane(run: RunSeries) -> tuple[tuple[int, int], int]:
    """Return the two world axes in the slip plane, and the one nearest to the pads' normal."""
    normal = int(np.argmax(np.abs(run.grasp_rotation[0][:, 2])))
    first, second = (axis for axis in range(3) if axis != normal)
    return (first, second), normal


def _position(axis: Axes, runs: Mapping[str, RunSeries], index: int, title: str) -> None:
    for name, run in runs.items():
        axis.plot(run.time, run.grasp_position[:, index], color=colour_of(name), label=f"object, {name}")
        axis.plot(
            run.law_time, run.law_six("position")[:, index], "--", color=colour_of(name), label=f"end-effector, {name}"
        )
    run = next(iter(runs.values()))
    axis.plot(run.law_time, run.law_six("desired")[:, index], **DESIRED)
    axis.set_title(title)


def _angle(axis: Axes, runs: Mapping[str, RunSeries], normal: int) -> None:
    unit = np.eye(3)[normal]
    for name, run in runs.items():
        axis.plot(
            run.time, rotation_angle_about(run.grasp_rotation, unit), color=colour_of(name), label=f"object, {name}"
        )
        axis.plot(
            run.law_time, _angle_of(run, "position", unit), "--", color=colour_of(name), label=f"end-effector, {name}"
        )
    run = next(iter(runs.values()))
    axis.plot(run.law_time, _angle_of(run, "desired", unit), **DESIRED)
    axis.set_title(f"angle about {NAMES[normal]} [rad]")


def _angle_of(run: RunSeries, name: str, unit: Array) -> Array:
    vectors = run.law_six(name)[:, 3:]
    known = np.isfinite(vectors).all(axis=1)
    angle = np.full(len(vectors), np.nan)
    if known.any():
        angle[known] = rotation_angle_about(Rotation.from_rotvec(vectors[known]).as_matrix(), unit)
    return angle


def _velocity(axis: Axes, runs: Mapping[str, RunSeries], index: int, title: str) -> None:
    for name, run in runs.items():
        axis.plot(run.time, run.grasp_twist[:, index], color=colour_of(name), label=f"object, {name}")
        axis.plot(
            run.law_time, run.law_six("twist")[:, index], "--", color=colour_of(name), label=f"end-effector, {name}"
        )
    axis.set_title(title)


def _path(axis: Axes, runs: Mapping[str, RunSeries], plane: tuple[int, int]) -> None:
    first, second = plane
    for name, run in runs.items():
        axis.plot(
            run.grasp_position[:, first], run.grasp_position[:, second], color=colour_of(name), label=f"object, {name}"
        )
        position = run.law_six("position")
        axis.plot(position[:, first], position[:, second], "--", color=colour_of(name), label=f"end-effector, {name}")
    desired = next(iter(runs.values())).law_six("desired")
    axis.plot(desired[:, first], desired[:, second], **DESIRED)
    axis.set_title("path in the slip plane [m]")
    axis.set_xlabel(NAMES[first])
    axis.set_ylabel(NAMES[second])
    axis.set_aspect("equal", adjustable="datalim")


def _slip(axis: Axes, runs: Mapping[str, RunSeries], part: slice, scale: float, title: str) -> None:
    for name, run in runs.items():
        values = np.linalg.norm(run.slip_displacement[:, part], axis=1) * scale
        axis.plot(run.time, values, color=colour_of(name), label=f"{name}: {values[-1]:.2f} at the end")
    axis.set_title(title)
