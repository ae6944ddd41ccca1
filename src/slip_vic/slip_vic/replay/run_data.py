"""A recorded run of the controller, as the samples it used and the efforts it published; no ROS needed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from slip_bags.reader import Bag
from slip_bags.series import Series
from slip_core.arms import by_arm, model_of_arms, prefix_of
from slip_core.arrays import readonly
from slip_core.errors import InputError
from slip_core.params import build, flatten
from slip_core.stamps import NS_PER_S
from slip_core.topics import contact_topic
from slip_core.types import CartesianReference, JointSample, PoseGoal, SlipSample, WrenchSample
from slip_msgs_py.messages.from_msgs import (
    cartesian_reference,
    displacement_sample,
    joint_indices,
    pose_goal,
    slip_flag,
    slip_sample,
)
from slip_vic.run.data import parameters_of
from slip_vic_controller.interfaces import SlipFromDisplacement
from slip_vic_controller.params.node_params import ControllerNodeParams
from slip_vic_controller.safety.modes import Mode

if TYPE_CHECKING:
    from rcl_interfaces.msg import ParameterValue

LEDGER: Final = "controller/ledger"
GIVEN: Final = "controller/reference_used"
PARAMETERS: Final = "controller.params.yaml"
URDF: Final = "arm.urdf"
Sample = TypeVar("Sample")
EVENTS: Final = "/parameter_events"
NODE: Final = "slip_vic_controller"
_KINDS: Final = ("bool", "integer", "double", "string", "byte_array", "bool_array", "integer_array", "double_array",
                 "string_array")  # fmt: skip
"""Of parameter values, by type number from 1 on."""


@dataclass(frozen=True, slots=True)
class LedgerEntry:
    """One cycle: what it used and decided; stamps in nanoseconds, 0 where nothing was used.

    taken: how many references or goals had come.
    """

    cycle: int
    joint_ns: int
    wrench_ns: tuple[int, ...]
    slip_ns: tuple[int, ...]
    now_ns: int
    mode: int
    health: int
    request: int
    taken: int = 0

    @property
    def waits(self) -> bool:
        """Whether the cycle had to wait for an input; its entry names no sample then."""
        named = any(self.wrench_ns) or any(self.slip_ns)
        return self.mode == Mode.WAITING_INPUT or (self.mode == Mode.FAULT and not named)


@dataclass(frozen=True, slots=True)
class RecordedRun:
    """Everything that a replay of one arm needs, and what it must reproduce.

    changes: all parameters as they were from the ledger entry with this index on. joints, wrenches, slips: by stamp
    [ns], the last two per contact. commands: per ledger entry, (n,) or (0,).
    given: references or goals in their order.
    """

    params: ControllerNodeParams
    changes: Mapping[int, ControllerNodeParams]
    urdf: str
    ledger: tuple[LedgerEntry, ...]
    joints: dict[int, JointSample]
    wrenches: tuple[dict[int, WrenchSample], ...]
    slips: tuple[dict[int, SlipSample], ...]
    commands: tuple[NDArray[np.float64], ...]
    given: tuple[CartesianReference | PoseGoal, ...] = ()


def read_run(bag: Bag) -> dict[str, RecordedRun]:
    """Read the run of each arm from a bag, by the arm's name; "" is the name of an only arm.

    Args:
        bag: the recording of one controller.

    Raises:
        InputError: something a replay needs is not in the bag, or messages were lost.
    """
    params = _parameters(bag)
    root = _namespace(bag, f"{prefix_of(next(iter(params)))}{LEDGER}")
    return {name: _read_arm(_Source(bag, root, name, tuple(params)), own) for name, own in params.items()}


class _Source(NamedTuple):
    """Where an arm's run is in a bag.

    root: namespace of the node; name: of the arm; names: of all arms.
    """

    bag: Bag
    root: str
    name: str
    names: tuple[str, ...]

    @property
    def prefix(self) -> str:
        """Prefix of the arm's topics."""
        return self.root + prefix_of(self.name)

    def contacts(self, count: int) -> list[str]:
        """Return the prefix of the topics of each contact: the own one, those of the other arms, further own ones."""
        arms = self.name, *(name for name in self.names if name != self.name)
        places = [self.root + prefix_of(name) for name in arms[:count]]
        return places + [self.prefix + contact_topic("", index) for index in range(len(places), count)]


def _read_arm(source: _Source, params: ControllerNodeParams) -> RecordedRun:
    bag, prefix, interface = source.bag, source.prefix, params.command.interface
    ledger_series = _complete(bag, prefix + LEDGER)
    joints, contacts = params.joint_names, source.contacts(params.contacts.count)
    return RecordedRun(
        params=params,
        changes=_changes(source, params, ledger_series),
        urdf=_attachment(bag, f"{source.name}.urdf" if source.name else URDF),
        ledger=tuple(_entry(row, len(contacts)) for row in ledger_series["data"].tolist()),
        joints=_joints(_complete(bag, f"{prefix}joint_states"), joints),
        wrenches=tuple(_wrenches(bag, f"{contact}wrench", params) for contact in contacts),
        slips=tuple(_slips(bag, contact, params) for contact in contacts),
        commands=_commands(_complete(bag, f"{prefix}{interface}_command"), ledger_series, joints, interface),
        given=_given(bag, source.root + GIVEN, params),
    )


def _given(bag: Bag, topic: str, params: ControllerNodeParams) -> tuple[CartesianReference | PoseGoal, ...]:
    """Return what came by topic; a bag without that topic has none."""
    if topic not in bag.topics:
        return ()
    messages = (message.value for message in bag.messages(topic))
    if params.trajectory.kind == "topic":
        return tuple(map(cartesian_reference, messages))
    return tuple(pose_goal(message, params.trajectory.duration_s) for message in messages)


def _namespace(bag: Bag, ledger: str) -> str:
    found = [name.removesuffix(ledger) for name in bag.topics if name.endswith(f"/{ledger}")]
    if len(found) != 1:
        got = f"{len(found)} topics {ledger}"
        raise InputError(f"bag {bag.path}", got=got, expected="the recording of one controller")
    return found[0]


def _attachment(bag: Bag, name: str) -> str:
    if name not in bag.attachments:
        raise InputError(f"bag {bag.path}", got=f"no attachment {name}", expected="a bag of `slip-vic run --record`")
    return bag.attachments[name].decode("utf-8")


def _parameters(bag: Bag) -> dict[str, ControllerNodeParams]:
    values = parameters_of(PARAMETERS, bag.path, _attachment(bag, PARAMETERS))
    arms = tuple(values.get("arms", ()))
    model = model_of_arms(ControllerNodeParams, arms) if arms else ControllerNodeParams
    return by_arm(build(model, values, f"{PARAMETERS} of {bag.path}"))


def _changes(source: _Source, params: ControllerNodeParams, ledger: Series) -> dict[int, ControllerNodeParams]:
    """Read what was set at run time; node and ledger share a thread and a clock, so their order is exact."""
    if EVENTS not in source.bag.topics:
        return {}
    changes, own = {}, f"{source.name}." if source.name else ""
    for message in source.bag.messages(EVENTS):
        event = message.value
        if event.node != f"{source.root}{NODE}" or not event.changed_parameters:
            continue
        given = {item.name: _parameter_value(item.value) for item in event.changed_parameters}
        changed = {name.removeprefix(own): v for name, v in given.items() if name.startswith(own)}
        names = flatten(params)
        params = build(ControllerNodeParams, names | {k: v for k, v in changed.items() if k in names}, EVENTS)
        changes[int(np.searchsorted(ledger.publish_time_ns, message.publish_time_ns))] = params
    return changes


def _parameter_value(value: ParameterValue) -> object:
    """Return what a rcl_interfaces/ParameterValue holds, by its type number."""
    name = _KINDS[value.type - 1]
    found = getattr(value, f"{name}_value")
    return list(found) if name.endswith("array") else found


def _complete(bag: Bag, topic: str) -> Series:
    """Return a topic of which no message is missing."""
    series = bag.series(topic)
    if series.count == 0:
        raise InputError(f"topic {topic} of {bag.path}", got="no messages", expected="the whole run")
    numbers = series.sequence
    wrong = np.flatnonzero(np.diff(numbers) != 1)
    if numbers[0] != 0 and len(wrong):
        lost = int(np.ptp(numbers)) + 1 - len(np.unique(numbers))
        before, behind = numbers[wrong[0]], numbers[wrong[0] + 1]
        got = f"{lost} messages lost; the first that does not follow is number {behind} behind number {before}"
        raise InputError(f"topic {topic} of {bag.path}", got=got, expected="every message, in its publisher's order")
    return series


def _entry(row: Sequence[int], contacts: int) -> LedgerEntry:
    behind = 3 + 4 * contacts  # cycle and stamp; the stamps of wrench and slip of each contact; what was decided
    if len(row) not in (behind + 5, behind + 6):  # the last one where references or goals come
        got = f"{len(row)} numbers for {contacts} contacts"
        raise InputError("a ledger entry", got=got, expected=f"{behind + 5} or {behind + 6}")
    pairs = zip(row[1 : behind + 2 : 2], row[2 : behind + 2 : 2], strict=True)
    times = [seconds * NS_PER_S + rest for seconds, rest in pairs]
    joint, *used, now = times
    return LedgerEntry(row[0], joint, tuple(used[::2]), tuple(used[1::2]), now, *row[behind + 2 :])


def _in_order(series: Series, field: str, joints: tuple[str, ...]) -> list[NDArray[np.float64]]:
    """Return one array per message in the controller's joint order; an empty field stays empty."""
    names, rows = series["name"], (np.asarray(row, dtype=np.float64) for row in series[field])
    return [
        readonly(row[joint_indices(joints, tuple(name))] if len(row) else row)
        for name, row in zip(names, rows, strict=True)
    ]


def _joints(series: Series, joints: tuple[str, ...]) -> dict[int, JointSample]:
    columns = (_in_order(series, field, joints) for field in ("position", "velocity", "effort"))
    return {row[0]: JointSample(*row) for row in zip(series.stamps.tolist(), *columns, strict=True)}


def _samples(bag: Bag, topic: str, make: Callable[[int, Any], Sample], *fields: str) -> dict[int, Sample]:
    """Return what is made of a stamp and a row of numbers, by its stamp."""
    series = _complete(bag, topic)
    rows = series[fields[0]] if fields[0] in series else series.columns(*fields)
    found = zip(series.stamps.tolist(), rows, strict=True)
    return {stamp: make(stamp, readonly(np.array(row, dtype=np.float64))) for stamp, row in found}


def _wrenches(bag: Bag, topic: str, params: ControllerNodeParams) -> dict[int, WrenchSample]:
    if params.wrench.source == "none":
        return {}
    return _samples(bag, topic, WrenchSample, "wrench.force", "wrench.torque")


def _slips(bag: Bag, prefix: str, params: ControllerNodeParams) -> dict[int, SlipSample]:
    """Return the slip velocities that the controller has, or made of displacements or flags."""
    if params.slip_input == "displacement":
        fields = "pose.position", "pose.orientation"
        found = map(
            SlipFromDisplacement(), _samples(bag, f"{prefix}slip_displacement", displacement_sample, *fields).values()
        )
        return {slip.stamp_ns: slip for slip in found if slip is not None}
    if params.slip_input == "flag":
        return _samples(bag, f"{prefix}slip_flag", slip_flag, "position")
    return _samples(bag, f"{prefix}slip_velocity", slip_sample, "twist.linear", "twist.angular")


def _commands(
    series: Series, ledger: Series, joints: tuple[str, ...], interface: str
) -> tuple[NDArray[np.float64], ...]:
    """Pair every ledger entry with the command published just before it, by the publisher's own clock."""
    rows = _in_order(series, interface, joints)
    found = np.searchsorted(series.publish_time_ns, ledger.publish_time_ns, side="right") - 1
    if (found < 0).any() or (np.diff(found) < 1).any():
        raise InputError(f"{interface}_command", got="fewer messages than cycles", expected="one per ledger entry")
    return tuple(rows[index] for index in found)
