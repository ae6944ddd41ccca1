"""Data of runs for the page: poses, paths, series and their plots, all on one grid of times."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np

from slip_core.arrays import Array
from slip_core.files.urdf import parse_urdf
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


RESTS: Final = 1e-5
"""What is nearer to where it ends is at rest [m, rad]: less than the page's numbers show."""
AFTER: Final = 0.1
"""Share of the motion for which its end is shown."""


def shown_s(run: RunData) -> float:
    """Return how long a run is shown [s]: until joints and object rest, and a little longer."""
    channels = [arm.channel("joints") for arm in run.arms] + [own for own in (run.object_pose,) if own is not None]
    moving = [own.times[(np.abs(own.rows - own.rows[-1]) > RESTS).any(axis=1)] for own in channels]
    until = (1.0 + AFTER) * max((float(times[-1]) for times in moving if len(times)), default=0.0)
    return min(until, run.duration_s) or run.duration_s


def grid(duration: float) -> Array:
    """Return the times of all runs; (N,) [s]."""
    return np.linspace(0.0, duration, min(MOST_FRAMES, max(1, round(duration / STEP_S))) + 1)


def on_grid(run: RunData, times: Array, end: str = "") -> RunData:
    """Return a run with its rows at these times, NaN for a channel that is drawn and absent.

    end: why it did not end well, which its arms have as their last mode.
    """
    pose = None if run.object_pose is None else Channel(times, newest_on_grid(run.object_pose, times))
    arms = []
    for arm in run.arms:
        columns = {"slip_velocity": 6, "effort": len(arm.joint_names)}
        channels = {name: Channel(times, np.full((len(times), width), np.nan)) for name, width in columns.items()}
        channels |= {name: Channel(times, newest_on_grid(own, times)) for name, own in arm.channels.items()}
        ends = ((min(float(arm.channel("joints").times[-1]), float(times[-1])), end),) if end else ()
        arms.append(replace(arm, channels=channels, modes=(*arm.modes, *ends)))
    return replace(run, arms=tuple(arms), object_pose=pose)


def newest_on_grid(channel: Channel, times: Array) -> Array:
    """Return the newest row at each time, by their own; NaN before the first, and from a step after the last on."""
    own_s = channel.times
    places = np.searchsorted(own_s, times + 1e-9, side="right") - 1
    found = np.array(channel.rows[np.maximum(places, 0)], dtype=np.float64)
    longest = max(float(np.diff(own_s).max(initial=0.0)), float(times[1] - times[0]) if len(times) > 1 else 0.0)
    found[(places < 0) | (times > own_s[-1] + longest + 1e-9)] = np.nan
    return found


def series_of(arm: ArmData) -> dict[str, Array]:
    """Return the series of an arm on the grid by their names; (N,) each."""
    rows = {name: channel.rows for name, channel in arm.channels.items()}
    limits = effort_limits_of(arm.urdf, arm.joint_names)
    values = {
        "slip_speed": 1e3 * np.linalg.norm(rows["slip_velocity"][:, :3], axis=1),
        "effort": np.max(100.0 * np.abs(rows["effort"]) / limits, axis=1),
    }
    if "slip" in rows:
        values["slip_mm"] = 1e3 * np.linalg.norm(rows["slip"][:, :3], axis=1)
        values["slip_deg"] = np.degrees(np.linalg.norm(rows["slip"][:, 3:], axis=1))
    if "law" in rows:
        error, stiffness = arm.law_six("e"), arm.law_six("K")
        shown = [name for name in ("gate", "mode", "grip_command") if name in arm.symbols]
        values |= {name: rows["law"][:, arm.symbols.index(name)] for name in shown}
        values |= {
            "error_mm": 1e3 * np.linalg.norm(error[:, :3], axis=1),
            "error_deg": np.degrees(np.linalg.norm(error[:, 3:], axis=1)),
            "stiffness": stiffness[:, :3].min(axis=1),
            "stiffness_turning": stiffness[:, 3:].min(axis=1),
        }
    if "wrench" in rows:
        values["load"] = load_ratio(arm)
    if "internal" in rows:
        values["internal_n"] = np.linalg.norm(rows["internal"][:, :2], axis=1)
        values["internal_nm"] = np.abs(rows["internal"][:, 5])
    return values


class Plot(NamedTuple):
    """One plot: the series of this name of every arm. `mark` is a level that is drawn; `steps` names whole numbers."""

    name: str
    title: str
    unit: str
    mark: float | None = None
    steps: tuple[str, ...] = ()
    note: str = ""


PLOTS: Final = (
    Plot("slip_mm", "slip displacement", "mm", note="how far the pad has moved on the object"),
    Plot("grip_command", "squeeze", "N", note="as commanded, sum over both pads"),
    Plot("slip_deg", "slip angle", "deg", note="how far the object has turned under the pad"),
    Plot("slip_speed", "slip speed", "mm/s"),
    Plot("load", "load ratio", "", mark=1.0, note="measured load over friction limit; at 1 the pad begins to slip"),
    Plot("internal_n", "internal force", "N", note="two arms: what the pads do to each other along the slip plane"),
    Plot("internal_nm", "internal moment", "N m", note="two arms: what the pads do to each other about their normal"),
    Plot("error_mm", "tracking error", "mm"),
    Plot("error_deg", "tracking error, angle", "deg"),
    Plot("stiffness", "stiffness, softest axis", "N/m"),
    Plot("stiffness_turning", "stiffness, softest rotation", "N m/rad"),
    Plot("gate", "gate", "", note="tanh(alpha |v_s|): 0 = sticks, 1 = the pad follows the object"),
    Plot("effort", "effort, most loaded joint", "% of limit"),
    Plot("mode", "mode", "", steps=MODES),
)


def plot_series(runs: Sequence[RunData]) -> list[tuple[Plot, list[tuple[int, int, Array]]]]:
    """Return all plots of some runs on the grid, in the order of the page; of each arm its run's and its own number."""
    arms = [(number, place, series_of(arm)) for number, run in enumerate(runs) for place, arm in enumerate(run.arms)]
    shown = [(plot, [(n, place, own[plot.name]) for n, place, own in arms if plot.name in own]) for plot in PLOTS]
    return [(plot, rows) for plot, rows in shown if rows]


def describe_plots(runs: Sequence[RunData], packer: Packer, *, empty: bool = False) -> list[dict[str, Any]]:
    """Return the plots that have anything to show, or all, as the page's script reads them.

    A plot: name, title, unit, mark, steps, note, and one series per arm with the number of its run and arm.
    """
    return [
        {
            **plot._asdict(),
            "series": [{"run": n, "arm": place, "values": packer.add(values)} for n, place, values in rows],
        }
        for plot, rows in plot_series(runs)
        if empty or any(np.isfinite(values).any() for _, _, values in rows)
    ]


@functools.lru_cache
def effort_limits_of(urdf: str, names: tuple[str, ...]) -> Array:
    """Return the efforts of a URDF's joint limits, infinite where there is none; (n,) [N m]."""
    limits = {joint.get("name"): joint.find("limit") for joint in parse_urdf(urdf).findall("joint")}
    found = (limits.get(name) for name in names)
    return np.array([float(limit.get("effort", 0.0)) or np.inf if limit is not None else np.inf for limit in found])


COLOURS: Final = {"classical": 0, "vic": 1, "governed": 2, "governed_follow": 3}


def colours(labels: Sequence[str]) -> list[int]:
    """Return the number of each run's colour in the style sheet: a law has its own, other runs differ."""
    if len(labels) == 1:
        return [COLOURS.get(labels[0], COLOURS["vic"])]
    return [COLOURS[label] for label in labels] if set(labels) <= set(COLOURS) else [k % 6 for k in range(len(labels))]


def tip_of(arm: ArmData) -> str:
    """Return the link at the pad centre."""
    return str(arm.parameters.get("ee_frame", "ee"))


def object_size(run: RunData) -> list[float]:
    """Return the edges of the box that is drawn for the object [m]."""
    return list(run.bridge.get("display.object_size", BridgeParams().display.object_size))


def describe(label: str, run: RunData, packer: Packer, colour: int = 1) -> tuple[dict[str, Any], list[str]]:
    """Return a run on the grid as the page's script reads it, and what could not be drawn."""
    missing: list[str] = []
    arms = []
    for arm in run.arms:
        links, lacking = links_of(arm.urdf, packer)
        missing += lacking
        desired = arm.law_six("desired")[:, :3] if "law" in arm.channels else np.empty((0, 3))
        arms.append(
            {
                "name": arm.name,
                "links": links,
                "tip": tip_of(arm),
                "joints": list(arm.joint_names),
                "q": packer.add(arm.channel("joints").rows),
                "slip": packer.add(arm.channel("slip_velocity").rows),
                "planned": packer.add(desired[np.isfinite(desired).all(axis=1)]),
                "modes": [list(change) for change in arm.modes],
            }
        )
    thing = None
    if run.object_pose is not None:
        thing = {"size": object_size(run), "pose": packer.add(run.object_pose.rows)}
    return {
        "label": label,
        "colour": colour,
        "arms": arms,
        "object": thing,
        "pad": [PAD_RADIUS, PAD_THICKNESS],
    }, missing
