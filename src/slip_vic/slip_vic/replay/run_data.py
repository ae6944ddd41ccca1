"""A recorded run of the controller, as the samples it used and the efforts it published; no ROS needed."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from slip_bags.format import BagMessage
from slip_bags.reader import Bag
from slip_core.arms import ParamsOfArms, by_arm, model_of_arms, prefix_of
from slip_core.errors import InputError
from slip_core.params import build, flatten
from slip_core.stamps import NS_PER_S
from slip_core.topics import EVENTS, contact_topic
from slip_core.types import CartesianReference, DisplacementSample, JointSample, PoseGoal, SlipSample, WrenchSample
from slip_msgs_py.messages.from_msgs import (
    cartesian_reference,
    joint_command,
    joint_sample,
    pose_goal,
    slip_displacement,
    slip_flags,
    slip_velocity,
    wrench_sample,
)
from slip_vic.run.data import attached, own_topic, parameters_of
from slip_vic_controller.interfaces import SlipFromDisplacement
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.safety.conditions import Mode, Request
from slip_vic_controller.session.cycle_result import Health

if TYPE_CHECKING:
    from rcl_interfaces.msg import ParameterValue

LEDGER: Final = "controller/ledger"
GIVEN: Final = "controller/reference_used"
PARAMETERS: Final = "controller.params.yaml"
URDF: Final = "arm.urdf"
Sample = TypeVar("Sample", JointSample, WrenchSample, SlipSample, DisplacementSample)
NODE: Final = "slip_vic_controller"


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

    changes: all parameters after each change between the ledger entry with this index and the one before.
    joints, wrenches, slips: by stamp [ns], the last two per contact. commands: per ledger entry, (n,) or (0,).
    given: references or goals in their order. squeezes: per ledger entry [N]; none where the grip is not commanded.
    """

    params: ControllerParams
    changes: Mapping[int, list[ControllerParams]]
    urdf: str
    ledger: tuple[LedgerEntry, ...]
    joints: dict[int, JointSample]
    wrenches: tuple[dict[int, WrenchSample], ...]
    slips: tuple[dict[int, SlipSample], ...]
    commands: tuple[NDArray[np.float64], ...]
    given: tuple[CartesianReference | PoseGoal, ...] = ()
    squeezes: tuple[float, ...] = ()


def read_run(bag: Bag) -> dict[str, RecordedRun]:
    """Read the run of each arm from a bag, by the arm's name; "" is the name of an only arm.

    Args:
        bag: the recording of one controller.

    Raises:
        InputError: something a replay needs is not in the bag, or messages were lost.
    """
    params = _parameters(bag)
    root = _namespace(bag, f"{prefix_of(next(iter(params)))}{LEDGER}")
    return {name: _read_arm(bag, root, name, tuple(params), own) for name, own in params.items()}


def _read_arm(bag: Bag, root: str, name: str, names: tuple[str, ...], params: ControllerParams) -> RecordedRun:
    """Read the run of one arm; root: namespace of the node; names: of all arms."""
    prefix, interface = root + prefix_of(name), params.command.interface
    count, joints = params.contacts.count, params.joint_names
    # Topics of each contact: the own one, those of the other arms, further own ones.
    arms = (name, *(other for other in names if other != name))[:count]
    contacts = [root + prefix_of(arm) for arm in arms]
    contacts += [prefix + contact_topic("", index) for index in range(len(arms), count)]
    ledger = _complete(bag, prefix + LEDGER, partial(_entry, contacts=count))
    times_ns = np.array([entry.publish_time_ns for entry in ledger])
    topic, squeeze = f"{prefix}{interface}_command", f"{prefix}grip_command"
    commands = _complete(bag, topic, partial(joint_command, joints=joints, interface=interface))
    squeezes = _complete(bag, squeeze, attrgetter("data")) if params.grip.control == "follow" else []
    return RecordedRun(
        params=params,
        changes=_changes(bag, f"{root}{NODE}", f"{name}." if name else "", params, times_ns),
        urdf=attached(bag, f"{name}.urdf" if name else URDF),
        ledger=tuple(entry.value for entry in ledger),
        joints=_samples(bag, f"{prefix}joint_states", partial(joint_sample, joints=joints)),
        wrenches=tuple(_wrenches(bag, f"{contact}wrench", params) for contact in contacts),
        slips=tuple(_slips(bag, contact, params) for contact in contacts),
        commands=tuple(command.numbers for command in _of_cycles(commands, times_ns, topic)),
        given=_given(bag, root + GIVEN, params),
        squeezes=_of_cycles(squeezes, times_ns, squeeze) if squeezes else (),
    )


def _given(bag: Bag, topic: str, params: ControllerParams) -> tuple[CartesianReference | PoseGoal, ...]:
    """Return what came by topic; a bag without that topic has none."""
    if topic not in bag.topics:
        return ()
    messages = (message.value for message in bag.messages(own_topic(bag, topic)))
    if params.trajectory.kind == "topic":
        return tuple(map(cartesian_reference, messages))
    return tuple(pose_goal(message, params.trajectory.duration_s) for message in messages)


def _namespace(bag: Bag, ledger: str) -> str:
    found = [name.removesuffix(ledger) for name in bag.topics if name.endswith(f"/{ledger}")]
    if len(found) != 1:
        got = f"{len(found)} topics {ledger}"
        raise InputError(f"bag {bag.path}", got=got, expected="the recording of one controller")
    return found[0]


def _parameters(bag: Bag) -> dict[str, ControllerParams]:
    values = parameters_of(attached(bag, PARAMETERS))
    origin = f"{PARAMETERS} of {bag.path}"
    arms = build(ParamsOfArms, {name: value for name, value in values.items() if name == "arms"}, origin).arms
    return by_arm(build(model_of_arms(ControllerParams, arms) if arms else ControllerParams, values, origin))


def _changes(
    bag: Bag, node: str, own: str, params: ControllerParams, ledger: NDArray[np.int64]
) -> dict[int, list[ControllerParams]]:
    """Read what was set at run time; node and ledger share a thread and a clock, so their order is exact.

    ledger: when its entries were published [ns].
    """
    changes: dict[int, list[ControllerParams]] = {}
    for message in bag.messages(own_topic(bag, EVENTS)) if EVENTS in bag.topics else ():
        event = message.value
        if event.node != node or not event.changed_parameters:
            continue
        given = {item.name: _parameter_value(item.value) for item in event.changed_parameters}
        changed = {name.removeprefix(own): v for name, v in given.items() if name.startswith(own)}
        known, before = flatten(params), params
        params = build(ControllerParams, known | {k: v for k, v in changed.items() if k in known}, EVENTS)
        if params != before:  # otherwise no ramp starts
            changes.setdefault(int(np.searchsorted(ledger, message.publish_time_ns)), []).append(params)
    return changes


def _parameter_value(value: ParameterValue) -> object:
    """Return what a rcl_interfaces/ParameterValue holds: behind its type, fields are in the order of type numbers."""
    name = value.__slots__[value.type]
    return list(getattr(value, name)) if name.endswith("array_value") else getattr(value, name)


def _complete(bag: Bag, topic: str, read: Callable[[Any], object]) -> list[BagMessage]:
    """Return the messages of a topic with what `read` makes of each; a topic with lost messages is refused."""
    what = f"topic {topic} of {bag.path}"
    found = (one._replace(value=read(one.value)) for one in bag.messages(own_topic(bag, topic)))
    messages = sorted(found, key=attrgetter("log_time_ns"))
    if not messages:
        raise InputError(what, got="no messages", expected="the whole run")
    numbers = np.array([one.sequence for one in messages])
    wrong = np.flatnonzero(np.diff(numbers) != 1)
    if numbers[0] != 0 and len(wrong):
        lost = int(np.ptp(numbers)) + 1 - len(np.unique(numbers))
        before, behind = numbers[wrong[0]], numbers[wrong[0] + 1]
        got = f"{lost} messages lost; the first that does not follow is number {behind} behind number {before}"
        raise InputError(what, got=got, expected="every message, in its publisher's order")
    return messages


def _entry(message: Any, contacts: int) -> LedgerEntry:
    row = message.data
    behind = 3 + 4 * contacts  # cycle and stamp; the stamps of wrench and slip of each contact; what was decided
    if len(row) not in (behind + 5, behind + 6):  # the last one where references or goals come
        got = f"{len(row)} numbers for {contacts} contacts"
        raise InputError("a ledger entry", got=got, expected=f"{behind + 5} or {behind + 6}")
    pairs = zip(row[1 : behind + 2 : 2], row[2 : behind + 2 : 2], strict=True)
    times = [seconds * NS_PER_S + rest for seconds, rest in pairs]
    joint, *used, now = times
    entry = LedgerEntry(row[0], joint, tuple(used[::2]), tuple(used[1::2]), now, *row[behind + 2 :])
    Mode(entry.mode), Request(entry.request), Health.from_code(entry.health)  # refuse codes of another version
    return entry


def _samples(bag: Bag, topic: str, read: Callable[[Any], Sample]) -> dict[int, Sample]:
    """Return the samples of a topic by their stamps, without those that the controller refused."""

    def accepted(message: Any) -> Sample | None:
        with contextlib.suppress(InputError):
            return read(message)
        return None

    samples = (one.value for one in _complete(bag, topic, accepted))
    return {sample.stamp_ns: sample for sample in samples if sample is not None}


def _wrenches(bag: Bag, topic: str, params: ControllerParams) -> dict[int, WrenchSample]:
    if params.wrench.source == "none":
        return {}
    return _samples(bag, topic, lambda message: wrench_sample(message, message.header.frame_id))


def _slips(bag: Bag, prefix: str, params: ControllerParams) -> dict[int, SlipSample]:
    """Return the slip velocities that the controller has, or made of displacements or flags."""
    if params.slip_input == "displacement":
        read = partial(slip_displacement, frame=params.ee_frame)
        found = map(SlipFromDisplacement(), _samples(bag, f"{prefix}slip_displacement", read).values())
        return {slip.stamp_ns: slip for slip in found if slip is not None}
    if params.slip_input == "flag":
        return _samples(bag, f"{prefix}slip_flag", slip_flags)
    return _samples(bag, f"{prefix}slip_velocity", lambda message: slip_velocity(message, message.header.frame_id))


def _of_cycles(commands: Sequence[BagMessage], ledger: NDArray[np.int64], topic: str) -> tuple[Any, ...]:
    """Pair every ledger entry with the command published just before it, by the publisher's own clock."""
    found = np.searchsorted([one.publish_time_ns for one in commands], ledger, side="right") - 1
    if (found < 0).any() or (np.diff(found) < 1).any():
        raise InputError(topic, got="fewer messages than cycles", expected="one per ledger entry")
    return tuple(commands[index].value for index in found)
