"""One run as arrays, read from its bag: what metrics and pictures are made of."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from slip_bags.reader import Bag
from slip_bags.series import Series
from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_core.types import COMMAND_TOPICS

AXES = ("x", "y", "z", "rx", "ry", "rz")


def _nothing() -> Array:
    return np.empty(0)


@dataclass(frozen=True, slots=True)
class RunSeries:
    """Arrays of one run; time starts at 0 with the first joint state.

    time (N,) [s]; slip_displacement (N, 6) [m, rad] {p}; slip_velocity (N, 6) pad axes; effort (N, n) [N m], NaN
    without a command; law_time (M,) [s] and law: the controller's scalars by name, (M,) each; arm: its name; wrench
    (N, 6) of the object on the pad {ee}; object_position (N, 3) [m], object_rotation (N, 3, 3) {w}; internal (N, 6):
    the wrench with which several arms work against each other, on pad axes; empty with one.
    """

    time: Array
    slip_displacement: Array
    slip_velocity: Array
    effort: Array
    law_time: Array
    law: dict[str, Array]
    arm: str = ""
    wrench: Array = field(default_factory=_nothing)
    object_position: Array = field(default_factory=_nothing)
    object_rotation: Array = field(default_factory=_nothing)
    internal: Array = field(default_factory=_nothing)

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
        interfaces = [topic for topic in COMMAND_TOPICS if bag.ending(topic, arm) is not None]
        commands = _series(bag, (*interfaces, COMMAND_TOPICS[0])[0], arm)
        scalars = _series(bag, "controller/scalars", arm)
        bag_wrench, internal = (_maybe(bag, topic, arm) for topic in ("wrench", "internal_wrench"))
    # A recorder on a busy machine may miss a message of one topic: the two go together by their stamps.
    stamps, of_truth, of_object = np.intersect1d(truth.stamps, odometry.stamps, return_indices=True)
    if not stamps.size:
        raise InputError(
            f"bag {path}", got="no slip_truth and object_state of one time", expected="a run of this suite"
        )
    start_ns = stamps[0]
    object_position = odometry.columns("pose.pose.position")[of_object]
    object_rotation = Rotation.from_quat(odometry.columns("pose.pose.orientation")[of_object]).as_matrix()
    names = [str(name) for name in scalars["name"][0]]
    table = scalars["position"]
    return RunSeries(
        time=(stamps - start_ns) * 1e-9,
        slip_displacement=truth["position"][of_truth],
        slip_velocity=truth["velocity"][of_truth],
        effort=np.array([row for row in commands["effort"] if len(row)]),
        law_time=np.array((scalars.stamps - start_ns) * 1e-9),
        law={name: table[:, i] for i, name in enumerate(names)},
        arm=arm,
        wrench=_held_wrench(bag_wrench, stamps),
        internal=_held_wrench(internal, stamps),
        object_position=object_position,
        object_rotation=object_rotation,
    )


def _held_wrench(wrench: Series | None, stamps: NDArray[np.int64]) -> Array:
    """Return the newest wrench at each stamp; (N, 6), empty without any."""
    if wrench is None or not wrench.count:
        return _nothing()
    return wrench.columns("wrench.force", "wrench.torque")[np.maximum(wrench.newest(stamps), 0)]


def _maybe(bag: Bag, topic: str, arm: str = "") -> Series | None:
    full = bag.ending(topic, arm)
    return bag.series(full) if full else None


def _series(bag: Bag, topic: str, arm: str = "") -> Series:
    found = _maybe(bag, topic, arm)
    if found is None or not found.count:
        raise InputError(f"bag {bag.path}", got=f"no message on {topic}", expected="a recorded run of this suite")
    return found


def mode_changes(bag: Bag, topic: str | None, states: Series, start_ns: int) -> tuple[tuple[float, str], ...]:
    """Return the texts of a mode's topic, each since when [s]: the stamp of the joint state received last before it."""
    found = []
    for message in bag.messages(topic) if topic else ():
        place = max(0, int(np.searchsorted(states.log_time_ns, message.log_time_ns, side="right")) - 1)
        found.append((1e-9 * float(states.stamps[place] - start_ns), str(message.value.data)))
    return tuple(found)
