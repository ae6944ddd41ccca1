"""A run as data: channels with their own times, by name; a bag and a run in this process give the same form.

joints (n) [rad, m], joint_velocity (n), joint_effort (n) [N m]: as measured; effort (n) [N m]: as commanded; slip (6)
[m, rad] {p}, slip_velocity (6) pad axes: the truth, on a real arm slip_measured; slip_measured (6): of the sensor;
wrench (6) of the object on the pad {ee}; internal (6) pad axes: the wrench with which several arms work against each
other; law: the symbols of the controller. A run has the channels that were measured.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from slip_bags.reader import Bag
from slip_bags.series import Series
from slip_core.arrays import Array
from slip_core.errors import InputError, UnknownName
from slip_core.files.plain_yaml import read_yaml
from slip_core.files.resources import bounded_memory
from slip_core.params import flat_names
from slip_core.topics import TOPICS
from slip_core.types import AXES, INTERFACES

OF_TOPICS: Final[Mapping[str, tuple[str, ...]]] = {
    "joints": ("joint_states", "position"),
    "joint_velocity": ("joint_states", "velocity"),
    "joint_effort": ("joint_states", "effort"),
    "slip": ("slip_truth", "position"),
    "slip_velocity": ("slip_truth", "velocity"),
    "slip_measured": ("slip_velocity", "twist.linear", "twist.angular"),
    "wrench": ("wrench", "wrench.force", "wrench.torque"),
    "internal": ("internal_wrench", "wrench.force", "wrench.torque"),
    "law": ("controller/scalars", "position"),
}
"""Channel: topic, and its field or the fields of which it has the components."""
COMMAND_TOPICS: Final = tuple(f"{interface}_command" for interface in INTERFACES)


@dataclass(frozen=True, slots=True)
class Channel:
    """Rows (N, k) with their times (N,) [s]; 0 is the first joint state of the run."""

    times: Array
    rows: Array


@dataclass(frozen=True, slots=True)
class ArmData:
    """One arm of a run.

    name: namespace, "" where there is none. parameters: of its controller, by dotted name. symbols: names of the
    columns of `law`. modes: (since when [s], mode and reason).
    """

    name: str
    urdf: str
    joint_names: tuple[str, ...]
    parameters: Mapping[str, Any]
    channels: Mapping[str, Channel]
    symbols: tuple[str, ...] = ()
    modes: tuple[tuple[float, str], ...] = ()

    def channel(self, name: str) -> Channel:
        """Return a channel.

        Raises:
            InputError: the run has none of this name.
        """
        if name not in self.channels:
            raise InputError("recorded run", got=f"no {name}", expected="a run of this suite")
        return self.channels[name]

    def law_six(self, name: str) -> Array:
        """Return six symbols of the law as columns; (M, 6).

        Raises:
            InputError: the run has no symbols, or those of another version.
        """
        rows, names = self.channel("law").rows, [f"{name}_{axis}" for axis in AXES]
        if not set(names) <= set(self.symbols):
            raise UnknownName("symbol", name, self.symbols, where="recorded run")
        return rows[:, [self.symbols.index(one) for one in names]]


@dataclass(frozen=True, slots=True)
class RunData:
    """A run: its arms, and the pose of the object (7): position [m], quaternion xyzw {w}, None where unknown.

    bridge: parameters of the simulation by dotted name. facts: what was run, versions too.
    """

    arms: tuple[ArmData, ...]
    object_pose: Channel | None
    bridge: Mapping[str, Any]
    facts: Mapping[str, str]

    def arm(self, name: str) -> ArmData:
        """Return an arm of a scenario by its name, in whatever namespace; "" is the name of an only arm.

        Raises:
            UnknownName: the run has no such arm.
        """
        for arm in self.arms:
            if not name or arm.name.rpartition("/")[2] == name:
                return replace(arm, name=name)
        raise UnknownName("arm", name, [arm.name for arm in self.arms])

    @property
    def duration_s(self) -> float:
        """Time of the last joint state [s]."""
        return max(float(arm.channel("joints").times[-1]) for arm in self.arms)


def own_topic(bag: Bag, topic: str) -> str:
    """Return a topic of the suite that is to be read, with the message type that it has here.

    Raises:
        InputError: the bag has none of this name, or one of another type.
    """
    got, types = bag.topic(topic).type_name, {row.name: row.type for row in TOPICS.values()}
    types["parameter_events"] = "rcl_interfaces/msg/ParameterEvent"
    expected = types.get(max((name for name in types if topic.endswith(f"/{name}")), key=len, default=""), got)
    if got != expected:
        fix = "record it under another name, or leave it out"
        raise InputError(f"topic {topic} of {bag.path}", got=got, expected=expected, fix=fix)
    return topic


def read_data(path: Path) -> RunData:
    """Read a recorded run.

    Raises:
        InputError: no bag, a damaged one, or one without joint states or the arm's description.
    """
    bag = Bag(path)
    with bounded_memory(f"bag {path}"):
        arms = _topics(bag)
        start_ns = min(int(bag.series(own_topic(bag, topics["joint_states"])).stamps[0]) for topics in arms.values())
        ends = ("/object_state", "/object/state")
        topic = next((name for name, info in bag.topics.items() if name.endswith(ends) and info.message_count), None)
        fields = "pose.pose.position", "pose.pose.orientation"
        return RunData(
            tuple(_read_arm(bag, name, topics, start_ns) for name, topics in arms.items()),
            None if topic is None else _channel(bag.series(own_topic(bag, topic)), start_ns, *fields),
            _parameters(bag, "bridge.params.yaml", next(iter(arms))),
            {name: text for name, text in bag.custom_data.items() if name in ("scenario", "seed")} | software_of(bag),
        )


def _topics(bag: Bag) -> dict[str, dict[str, str]]:
    """Return the arms of a bag, every namespace with joint states: full names of its topics by relative name."""
    full = [name for name, info in bag.topics.items() if info.message_count]
    prefixes = sorted(name.removesuffix("joint_states") for name in full if name.endswith("/joint_states"))
    if not prefixes:
        raise InputError(f"bag {bag.path}", got="no message on joint_states", expected="a recorded run of this suite")
    return {
        prefix.strip("/"): {name.removeprefix(prefix): name for name in full if name.startswith(prefix)}
        for prefix in prefixes
    }


def _read_arm(bag: Bag, name: str, topics: Mapping[str, str], start_ns: int) -> ArmData:
    wanted = {topic for topic, *_ in OF_TOPICS.values()} | set(COMMAND_TOPICS)
    series = {topic: bag.series(own_topic(bag, topics[topic])) for topic in wanted & topics.keys()}
    channels = {
        channel: _channel(series[topic], start_ns, *fields)
        for channel, (topic, *fields) in OF_TOPICS.items()
        if topic in series
    }
    if "slip_measured" in channels:
        channels.setdefault("slip_velocity", channels["slip_measured"])
    if channels["joint_effort"].rows.shape != channels["joints"].rows.shape:
        del channels["joint_effort"]
    for commands in [series[topic] for topic in COMMAND_TOPICS if topic in series][:1]:
        given = np.array([len(row) == channels["joints"].rows.shape[1] for row in commands["effort"]])
        if given.any():
            rows = np.array(commands["effort"][given].tolist(), dtype=np.float64)
            channels["effort"] = Channel(np.array((commands.stamps[given] - start_ns) * 1e-9, dtype=np.float64), rows)
    states, scalars = series["joint_states"], series.get("controller/scalars")
    symbols = () if scalars is None else tuple(map(str, scalars["name"][0]))
    efforts = [symbols.index(name) for name in symbols if name.startswith("effort_")]
    if "effort" not in channels and efforts:  # of drives with loops of their own
        channels["effort"] = Channel(channels["law"].times, channels["law"].rows[:, efforts])
    return ArmData(
        name,
        urdf_of(bag, name),
        tuple(map(str, states["name"][0])),
        _parameters(bag, "controller.params.yaml", name),
        channels,
        symbols,
        _modes(bag, topics.get("controller/mode"), states, start_ns),
    )


def _channel(series: Series, start_ns: int, *fields: str) -> Channel:
    rows = series[fields[0]] if fields[0] in series else series.columns(*fields)
    if rows.ndim != 2 or (fields == ("position",) and not 0 < rows.shape[1] == len(series["name"][0])):
        got, fix = f"{fields[0]} of varying length, or without names", "record one publisher of it"
        raise InputError(f"topic {series.topic}", got=got, expected="a number for each name in each message", fix=fix)
    return Channel(np.array((series.stamps - start_ns) * 1e-9, dtype=np.float64), rows)


def _modes(bag: Bag, topic: str | None, states: Series, start_ns: int) -> tuple[tuple[float, str], ...]:
    """Return the texts of a mode's topic, each since when [s]: the stamp of the joint state received last before it."""
    found = []
    for message in bag.messages(own_topic(bag, topic)) if topic else ():
        place = max(0, int(np.searchsorted(states.log_time_ns, message.log_time_ns, side="right")) - 1)
        found.append((1e-9 * float(states.stamps[place] - start_ns), str(message.value.data)))
    return tuple(found)


def urdf_of(bag: Bag, arm: str = "") -> str:
    """Return the URDF of an arm of a bag, by its namespace; where that has none, the one at the root.

    Raises:
        InputError: the bag has none.
    """
    root, own = "/robot_description", f"/{arm}/robot_description".replace("//", "/")
    for topic in (*(name for name in bag.topics if name.endswith(own)), root):
        if topic in bag.topics and bag.topics[topic].message_count:
            return str(next(bag.messages(own_topic(bag, topic))).value.data)
    return attached(bag, f"{arm}.urdf" if f"{arm}.urdf" in bag.attachments else "arm.urdf")


def attached(bag: Bag, name: str) -> str:
    """Return an attached text.

    Raises:
        InputError: the bag has none of this name, or it is binary.
    """
    try:
        return bag.attachments[name].decode("utf-8")
    except (KeyError, UnicodeError):
        got, expected = f"no attachment {name}, or a binary one", "a bag of `slip-vic run --record`"
        raise InputError(f"bag {bag.path}", got=got, expected=expected) from None


def software_of(bag: Bag) -> dict[str, str]:
    """Return the commit and the versions that a bag was recorded with, by name."""
    commit = {name: text for name, text in bag.custom_data.items() if name == "git_revision"}
    versions = sorted(read_yaml(bag.custom_data.get("versions", "{}")).items())
    return commit | {name: str(value) for name, value in versions}


def parameters_of(text: str) -> dict[str, Any]:
    """Return the parameters in a ROS parameter file, by dotted name."""
    return {k: v for node in read_yaml(text).values() for k, v in flat_names(node["ros__parameters"]).items()}


def _parameters(bag: Bag, name: str, arm: str) -> dict[str, Any]:
    if name not in bag.attachments:
        return {}
    values = parameters_of(attached(bag, name))
    own = {k.removeprefix(f"{arm}."): v for k, v in values.items() if arm and k.startswith(f"{arm}.")}
    return own or values
