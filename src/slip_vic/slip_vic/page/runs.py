"""What the page shows of runs: poses, paths and series, all on one grid of times."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from slip_core.arrays import Array
from slip_core.files.urdf import parse_urdf
from slip_core.types import AXES
from slip_sim_bridge.params import BridgeParams
from slip_vic.page.packing import Packer
from slip_vic.page.urdf import links_of
from slip_vic.run.data import ArmData, Channel, RunData
from slip_vic.run.metrics import load_ratio

STEP_S: Final = 0.004
MOST_FRAMES: Final = 4000
"""A longer run gets a coarser grid; numbers of the table never come from the grid."""
MODES: Final = ("WAITING_INPUT", "HOLD", "ACTIVE", "DEGRADED", "FAULT")
PAD_RADIUS: Final = 0.011
"""[m]; half the width of the fingers of our gripper."""
PAD_THICKNESS: Final = 0.003
"""[m]"""
NO_PATH: Final = np.empty((0, 3))


@dataclass(frozen=True, slots=True)
class Arm:
    """One arm of a run; (N, ...) on the grid.

    name: namespace, "" where there is none. joints (N, n) [rad, m]. tip: link at the pad centre. slip_velocity (N, 6)
    pad axes. values: series by name, (N,). planned (P, 3) [m] {w}. modes: (from when on [s], text).
    """

    name: str
    urdf: str
    tip: str
    joint_names: tuple[str, ...]
    joints: Array
    slip_velocity: Array
    planned: Array
    values: Mapping[str, Array]
    efforts: Array
    effort_limits: tuple[float, ...]
    modes: tuple[tuple[float, str], ...]


@dataclass(frozen=True, slots=True)
class Run:
    """One run: its arms, the object's pose (N, 7) (position, quaternion xyzw; None where unknown) and size [m]."""

    label: str
    arms: tuple[Arm, ...]
    object_pose: Array | None
    object_size: tuple[float, ...]


def grid(duration: float) -> Array:
    """Return the times of all runs; (N,) [s]."""
    return np.linspace(0.0, duration, min(MOST_FRAMES, max(1, round(duration / STEP_S))) + 1)


def drawn(data: RunData, label: str, times: Array, end: str = "") -> Run:
    """Return what the page shows of a run; `end` says why it did not end well."""
    pose = None if data.object_pose is None else newest_on_grid(data.object_pose, times)
    arms = tuple(arm_of(arm, times, end) for arm in data.arms)
    size = data.bridge.get("display.object_size", BridgeParams().display.object_size)
    return Run(label, arms, pose, tuple(size))


def arm_of(data: ArmData, times: Array, end: str = "") -> Arm:
    """Return an arm with its series on the grid."""
    held = {name: newest_on_grid(channel, times) for name, channel in data.channels.items()}
    nothing = np.full((len(times), max(6, len(data.joint_names))), np.nan)
    velocity = held.get("slip_velocity", nothing[:, :6])
    values = {"slip_speed": 1e3 * np.linalg.norm(velocity[:, :3], axis=1)}
    planned = NO_PATH
    if "slip" in held:
        values["slip_mm"] = 1e3 * np.linalg.norm(held["slip"][:, :3], axis=1)
        values["slip_deg"] = np.degrees(np.linalg.norm(held["slip"][:, 3:], axis=1))
    if "law" in held:
        values |= law_values(data.symbols, held["law"])
        desired = newest_on_grid(Channel(data.channel("law").times, data.law_six("desired")[:, :3]), times)
        planned = desired[np.isfinite(desired).all(axis=1)]
    if "wrench" in held:
        values["load"] = newest_on_grid(Channel(data.channel("wrench").times, load_ratio(data)), times)
    if "internal" in held:
        internal = held["internal"]
        values |= {"internal_n": np.linalg.norm(internal[:, :2], axis=1), "internal_nm": np.abs(internal[:, 5])}
    ends = [(float(data.channel("joints").times[-1]), end)] if end else []
    return Arm(
        data.name,
        data.urdf,
        str(data.parameters.get("ee_frame", "ee")),
        data.joint_names,
        held["joints"],
        velocity,
        planned,
        values,
        held.get("effort", nothing[:, : len(data.joint_names)]),
        effort_limits_of(data.urdf, data.joint_names),
        (*data.modes, *ends),
    )


def law_values(names: Sequence[str], symbols: Array) -> dict[str, Array]:
    """Return the series of the law's symbols; names of the columns, (N, k)."""

    def six(name: str) -> Array:
        return symbols[:, [names.index(f"{name}_{axis}") for axis in AXES]]

    error, stiffness = six("e"), six("K")
    mode = {"mode": symbols[:, names.index("mode")]} if "mode" in names else {}
    return mode | {
        "error_mm": 1e3 * np.linalg.norm(error[:, :3], axis=1),
        "error_deg": np.degrees(np.linalg.norm(error[:, 3:], axis=1)),
        "stiffness": stiffness[:, :3].min(axis=1),
        "stiffness_turning": stiffness[:, 3:].min(axis=1),
        "gate": symbols[:, names.index("gate")],
    }


@functools.lru_cache
def effort_limits_of(urdf: str, names: tuple[str, ...]) -> tuple[float, ...]:
    """Return the efforts of a URDF's joint limits, 0 where there is none [N m]."""
    limits = {joint.get("name"): joint.find("limit") for joint in parse_urdf(urdf).findall("joint")}
    found = (limits.get(name) for name in names)
    return tuple(float(limit.get("effort", 0.0)) if limit is not None else 0.0 for limit in found)


def newest_on_grid(channel: Channel, times: Array) -> Array:
    """Return the newest row at each time, by their own; NaN before the first, and from a step after the last on."""
    own_s = channel.times
    places = np.searchsorted(own_s, times + 1e-9, side="right") - 1
    found = np.array(channel.rows[np.maximum(places, 0)], dtype=np.float64)
    longest = max(float(np.diff(own_s).max(initial=0.0)), float(times[1] - times[0]) if len(times) > 1 else 0.0)
    found[(places < 0) | (times > own_s[-1] + longest + 1e-9)] = np.nan
    return found


COLOURS: Final = {"classical": 0, "vic": 1, "governed": 2}


def colours(labels: Sequence[str]) -> list[int]:
    """Return the number of each run's colour in the style sheet: a law has its own, other runs differ."""
    if len(labels) == 1:
        return [COLOURS.get(labels[0], COLOURS["vic"])]
    return [COLOURS[label] for label in labels] if set(labels) <= set(COLOURS) else [k % 6 for k in range(len(labels))]


def describe(run: Run, packer: Packer, colour: int = 1) -> tuple[dict[str, Any], list[str]]:
    """Return a run as the page's script reads it, and what could not be drawn."""
    missing: list[str] = []
    arms = []
    for arm in run.arms:
        links, lacking = links_of(arm.urdf, packer)
        missing += lacking
        arms.append(
            {
                "name": arm.name,
                "links": links,
                "tip": arm.tip,
                "joints": list(arm.joint_names),
                "q": packer.add(arm.joints),
                "slip": packer.add(arm.slip_velocity),
                "planned": packer.add(arm.planned),
                "modes": [list(change) for change in arm.modes],
            }
        )
    thing = None
    if run.object_pose is not None:
        thing = {"size": list(run.object_size), "pose": packer.add(run.object_pose)}
    return {
        "label": run.label,
        "colour": colour,
        "arms": arms,
        "object": thing,
        "pad": [PAD_RADIUS, PAD_THICKNESS],
    }, missing
