"""What the page shows of recorded runs: poses, paths and series, all on one grid of times."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import yaml
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from slip_bags.reader import Bag
from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_core.files.plain_yaml import read_yaml
from slip_core.files.urdf import parse_urdf
from slip_core.params import flat_names, flatten
from slip_core.types import COMMAND_TOPICS
from slip_vic.page.packing import Packer
from slip_vic.page.urdf import links_of
from slip_vic.run.series import AXES, mode_changes

if TYPE_CHECKING:
    from slip_vic.run import run as run_module

STEP_S: Final = 0.004
MOST_FRAMES: Final = 4000
"""A longer run gets a coarser grid; numbers of the table never come from the grid."""
MODES: Final = ("WAITING_INPUT", "HOLD", "ACTIVE", "DEGRADED", "FAULT")
PAD_RADIUS: Final = 0.011
"""[m]; half the width of the fingers of our gripper."""
PAD_THICKNESS: Final = 0.003
"""[m]"""
SMALLEST_SIDE: Final = 0.004
"""[m]; of a box that is drawn for an object of unknown size."""
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
    """One bag: its arms, the object's pose (N, 7) (position, quaternion xyzw; None where unknown) and size [m]."""

    label: str
    arms: tuple[Arm, ...]
    object_pose: Array | None
    object_size: tuple[float, float, float]
    versions: Mapping[str, str]
    facts: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Topics:
    """The topics of one arm: full names by relative name."""

    name: str
    names: Mapping[str, str]


def duration_s(paths: Sequence[Path]) -> float:
    """Return how long the longest of some runs is, by the stamps of its joint states [s]."""
    longest = 0.0
    for path in paths:
        with Bag(path) as bag:
            for arm in arms_of(bag):
                stamps = bag.series(arm.names["joint_states"]).stamps
                longest = max(longest, float(stamps[-1] - stamps[0]) * 1e-9)
    return longest


def grid(duration: float) -> Array:
    """Return the times of all runs; (N,) [s]."""
    return np.linspace(0.0, duration, min(MOST_FRAMES, max(1, round(duration / STEP_S))) + 1)


def arms_of(bag: Bag) -> list[Topics]:
    """Return the arms of a bag: every namespace in which joint states were recorded.

    Raises:
        InputError: there is none.
    """
    ends = "joint_states"
    prefixes = sorted(
        name.removesuffix(ends) for name, info in bag.topics.items() if name.endswith(f"/{ends}") and info.message_count
    )
    if not prefixes:
        raise InputError(f"bag {bag.path}", got=f"no message on {ends}", expected="a recorded run of this suite")
    found = []
    for prefix in prefixes:
        names = {
            name.removeprefix(prefix): name
            for name, info in bag.topics.items()
            if name.startswith(prefix) and info.message_count
        }
        found.append(Topics(prefix.strip("/"), names))
    return found


def read_run(path: Path, label: str, times: Array, end: str = "") -> Run:
    """Read what the page shows of one bag; `end` says why the run did not end well.

    Raises:
        InputError: no bag, a damaged one, or one without joint states or the arm's description.
    """
    with Bag(path) as bag:
        topics = arms_of(bag)
        start_ns = int(min(bag.series(arm.names["joint_states"]).stamps[0] for arm in topics))
        ends = ("/object_state", "/object/state")
        pose_topic = next((name for name, i in bag.topics.items() if name.endswith(ends) and i.message_count), None)
        parameters = _parameters(bag, "bridge.params.yaml", topics[0].name)
        pose = None
        if pose_topic is not None:
            series = bag.series(pose_topic)
            rows = series.columns("pose.pose.position", "pose.pose.orientation")
            pose = newest_on_grid(rows, (series.stamps - start_ns) * 1e-9, times)
        return Run(
            label=label,
            arms=tuple(_read_arm(bag, arm, start_ns, times, end) for arm in topics),
            object_pose=pose,
            object_size=object_size(parameters),
            versions=_versions(bag),
            facts={
                name: bag.custom_data[name] for name in ("scenario", "seed", "git_revision") if name in bag.custom_data
            },
        )


def shown(run: run_module.Run, label: str, times: Array) -> Run:
    """Return what the page shows of a run in this process."""
    scenario, arms = run.scenario, []
    pose = None
    for k, series in enumerate(run.track.series()):

        def held(rows: Array, time: Array = series.time) -> Array:
            return newest_on_grid(rows, time, times)

        controller, symbols = scenario.controllers[series.arm], list(series.law)
        desired = series.law_six("desired")[:, :3]
        ends = [(float(series.time[-1]), run.reason)] if run.outcome != "ok" else []
        arms.append(
            arm_of(
                series.arm,
                scenario.placed[series.arm],
                tuple(controller.joint_names),
                flatten(controller),
                joints=held(run.track.joints(k)[:, : len(controller.joint_names)]),
                velocity=held(series.slip_velocity),
                efforts=held(series.effort),
                displacement=held(series.slip_displacement),
                law=(symbols, held(np.stack([series.law[name] for name in symbols], axis=1))),
                wrench=held(series.wrench),
                internal=held(series.internal) if series.internal.size else None,
                planned=desired[np.isfinite(desired).all(axis=1)],
                modes=(*run.modes[series.arm], *ends),
            )
        )
        if pose is None:
            pose = held(np.hstack([series.object_position, Rotation.from_matrix(series.object_rotation).as_quat()]))
    facts = {"scenario": scenario.name, "seed": str(scenario.seed)}
    return Run(label, tuple(arms), pose, object_size(flatten(scenario.first)), {}, facts)


def arm_of(
    name: str,
    urdf: str,
    joint_names: tuple[str, ...],
    parameters: Mapping[str, Any],
    *,
    joints: Array,
    velocity: Array,
    efforts: Array,
    displacement: Array | None = None,
    law: tuple[Sequence[str], Array] | None = None,
    wrench: Array | None = None,
    internal: Array | None = None,
    planned: Array = NO_PATH,
    modes: tuple[tuple[float, str], ...] = (),
) -> Arm:
    """Return an arm with its series, from what is known of it on the grid.

    Args:
        name, urdf, joint_names, joints, efforts, planned, modes: see `Arm`.
        parameters: of the controller.
        velocity, displacement: of the slip; (N, 6) pad axes, (N, 6) {p}.
        law: names of its symbols, and their values (N, k).
        wrench: of the object on the pad (N, 6) {ee}.
        internal: wrench with which several arms work against each other; (N, 6) pad axes.
    """
    values = {"slip_speed": 1e3 * np.linalg.norm(velocity[:, :3], axis=1)}
    if displacement is not None:
        values["slip_mm"] = 1e3 * np.linalg.norm(displacement[:, :3], axis=1)
        values["slip_deg"] = np.degrees(np.linalg.norm(displacement[:, 3:], axis=1))
    if law is not None:
        values |= law_values(*law)
    if wrench is not None:
        values["load"] = load_ratio(wrench, parameters)
    if internal is not None:
        values |= {"internal_n": np.linalg.norm(internal[:, :2], axis=1), "internal_nm": np.abs(internal[:, 5])}
    limits, tip = effort_limits_of(urdf, joint_names), str(parameters.get("ee_frame", "ee"))
    return Arm(name, urdf, tip, joint_names, joints, velocity, planned, values, efforts, limits, modes)


def _read_arm(bag: Bag, arm: Topics, start_ns: int, times: Array, end: str) -> Arm:
    def held(name: str, *fields: str) -> Array | None:
        """Return fields of a topic on the grid: one array, or the components of several; None without the topic."""
        if name not in arm.names:
            return None
        series = bag.series(arm.names[name])
        rows = series[fields[0]] if fields[0] in series else series.columns(*fields)
        return newest_on_grid(rows, (series.stamps - start_ns) * 1e-9, times)

    states = bag.series(arm.names["joint_states"])
    names = tuple(str(name) for name in states["name"][0])
    nothing = np.full((len(times), max(6, len(names))), np.nan)
    joints = newest_on_grid(states["position"], (states.stamps - start_ns) * 1e-9, times)
    velocity = held("slip_truth", "velocity")
    if velocity is None:
        velocity = held("slip_velocity", "twist.linear", "twist.angular")
    law, planned = None, NO_PATH
    if (topic := arm.names.get("controller/scalars")) is not None:
        scalars = bag.series(topic)
        symbols = [str(name) for name in scalars["name"][0]]
        table = held("controller/scalars", "position")
        law = None if table is None else (symbols, table)
        desired = scalars["position"][:, [symbols.index(f"desired_{axis}") for axis in "xyz"]]
        planned = desired[np.isfinite(desired).all(axis=1)]
    command = next((name for name in COMMAND_TOPICS if name in arm.names), "")
    efforts = held(command, "effort") if command and bag.series(arm.names[command])["effort"].ndim == 2 else None
    ends = [(1e-9 * float(states.stamps[-1] - start_ns), end)] if end else []
    return arm_of(
        arm.name,
        _urdf(bag, arm),
        names,
        _parameters(bag, "controller.params.yaml", arm.name),
        joints=joints,
        velocity=nothing[:, :6] if velocity is None else velocity,
        efforts=nothing[:, : len(names)] if efforts is None else efforts,
        displacement=held("slip_truth", "position"),
        law=law,
        wrench=held("wrench", "wrench.force", "wrench.torque"),
        internal=held("internal_wrench", "wrench.force", "wrench.torque"),
        planned=planned,
        modes=(*mode_changes(bag, arm.names.get("controller/mode"), states, start_ns), *ends),
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


def load_ratio(wrench: Array, parameters: Mapping[str, Any]) -> Array:
    """Return how much of the friction the measured load takes; (N, 6) [N, N m] pad axes -> (N,).

    Force and torque over the torsional radius on the axes on which the pad slips, over the friction limit, as the
    controller is configured; NaN where it has none.
    """
    limit, radius = parameters.get("governor.friction_limit", 0.0), parameters.get("governor.torsional_radius", 0.0)
    if not limit or not radius:
        return np.full(len(wrench), np.nan)
    slips = np.array(parameters.get("contacts.slip_axes", [True] * 6)[:6], dtype=float)
    weights = slips * np.array([1.0, 1.0, 1.0, 1.0 / radius, 1.0 / radius, 1.0 / radius])
    return np.linalg.norm(wrench * weights, axis=1) / limit


def object_size(parameters: Mapping[str, Any]) -> tuple[float, float, float]:
    """Return the edges of the box that stands for the object [m].

    The scenario's display size; where a bag has none, the solid box with the object's mass and inertia.
    """
    if "display.object_size" in parameters:
        x, y, z = parameters["display.object_size"]
        return float(x), float(y), float(z)
    mass = float(parameters.get("object.mass", 0.5))
    x2, y2, z2 = (float(value) for value in parameters.get("object.inertia", (2e-3,) * 3)[:3])
    squares = (y2 + z2 - x2, x2 + z2 - y2, x2 + y2 - z2)
    x, y, z = (max(SMALLEST_SIDE, float(np.sqrt(max(0.0, 6.0 * square / mass)))) for square in squares)
    return x, y, z


def _urdf(bag: Bag, arm: Topics) -> str:
    topic = arm.names.get("robot_description") or bag.topics.get("/robot_description")
    if isinstance(topic, str):
        return str(next(iter(bag.messages(topic))).value.data)
    for name in (f"{arm.name}.urdf", "arm.urdf"):
        if name in bag.attachments:
            return bag.attachments[name].decode("utf-8")
    raise InputError(f"bag {bag.path}", got="no robot_description", expected="the arm's URDF, as topic or attachment")


def _versions(bag: Bag) -> dict[str, Any]:
    try:
        return dict(read_yaml(bag.custom_data.get("versions", "{}")))
    except (yaml.YAMLError, TypeError, ValueError) as error:
        raise InputError(f"versions of {bag.path}", got=str(error), expected="names and versions") from None


def _parameters(bag: Bag, name: str, arm: str = "") -> dict[str, Any]:
    for candidate in (f"{arm}.{name}", name):
        if candidate in bag.attachments:
            try:
                tree = read_yaml(bag.attachments[candidate].decode("utf-8"))
                values = {k: v for node in tree.values() for k, v in flat_names(node["ros__parameters"]).items()}
                own = {k.removeprefix(f"{arm}."): v for k, v in values.items() if arm and k.startswith(f"{arm}.")}
                return own or values
            except (yaml.YAMLError, AttributeError, KeyError, TypeError, ValueError) as error:
                got = f"{type(error).__name__} {error}"
                raise InputError(f"{candidate} of {bag.path}", got=got, expected="a ROS parameter file") from None
    return {}


@functools.lru_cache
def effort_limits_of(urdf: str, names: tuple[str, ...]) -> tuple[float, ...]:
    """Return the efforts of a URDF's joint limits, 0 where there is none [N m]."""
    limits = {joint.get("name"): joint.find("limit") for joint in parse_urdf(urdf).findall("joint")}
    found = (limits.get(name) for name in names)
    return tuple(float(limit.get("effort", 0.0)) if limit is not None else 0.0 for limit in found)


def newest_on_grid(values: NDArray[Any], own_s: NDArray[Any], times: Array) -> Array:
    """Return the newest row at each time, by their own; NaN before the first, and from a step after the last on."""
    places = np.searchsorted(own_s, times + 1e-9, side="right") - 1
    found = np.array(values[np.maximum(places, 0)], dtype=np.float64)
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
                "planned": packer.add(thinned(arm.planned)),
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


def thinned(points: Array) -> Array:
    """Return a path with its points at least 2 mm apart, first and last kept; (P, 3) [m] -> (Q, 3)."""
    if len(points) < 2:
        return points
    walked = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    keep = np.unique(np.searchsorted(walked, np.arange(0.0, walked[-1], 2e-3)))
    return points[np.unique(np.append(keep, len(points) - 1))]
