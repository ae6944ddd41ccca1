"""The controller between cycles: parameters, Pinocchio's call, samples in and results out; `cycle` does the rest.

A controller has one or more arms, which hold one object; the name of a single arm is "". The node, the in-process loop,
bag replay and the fault campaign all run this same class.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from slip_core.arrays import Array, matrix_from_quat_xyzw, readonly
from slip_core.errors import InputError
from slip_core.params import flatten
from slip_core.records import new, place, record, records
from slip_core.types import (
    COMMANDS,
    CartesianReference,
    DisplacementSample,
    JointCommand,
    JointSample,
    PoseGoal,
    SlipSample,
    WrenchSample,
)
from slip_vic_controller.arm.config import with_measured_noise
from slip_vic_controller.arrival import (
    estimate_joint_state,
    is_silent,
    receive_joint_state,
    receive_slip,
    receive_wrench,
    replace_joint_state,
)
from slip_vic_controller.config import governed_stream, make_config, renew_config, use_noise
from slip_vic_controller.cycle.cycle import cycle, watchdog
from slip_vic_controller.cycle.cycle import describe as describe_cycle
from slip_vic_controller.law.gains import (
    LAW_GAINS,
    RAMP,
    gain_report,
    make_law_gains,
    make_ramp,
    sample_gains,
    steady,
)
from slip_vic_controller.law.symbols import SYMBOLS, published
from slip_vic_controller.observer.config import capacity
from slip_vic_controller.observer.layouts import ROW_SIZE
from slip_vic_controller.params import ControllerParams
from slip_vic_controller.reference.stream import QUEUED
from slip_vic_controller.robot import Robot
from slip_vic_controller.safety.faults import Fault
from slip_vic_controller.safety.modes import Mode, Request
from slip_vic_controller.safety.reasons import ACTIVATION, describe
from slip_vic_controller.safety.validation import JointInput, JointRecord, VectorInput, mean_period_s, unanswered
from slip_vic_controller.sizes import MAX_FRESH
from slip_vic_controller.slip_displacement import SlipFromDisplacement
from slip_vic_controller.state import (
    ARM_SIZE,
    ARM_STATE,
    CONFIG,
    GOVERNED,
    INPUTS,
    OUTPUTS,
    TASK_SIZE,
    TASK_STATE,
    ArmState,
    ControllerConfig,
    Step,
    TaskState,
)

MOST_POSITION, MOST_TWIST, MOST_ACCELERATION = 1e3, 1e2, 1e4
"""[m], [m/s, rad/s], [m/s^2, rad/s^2] Most that a reference may have; numbers that are not finite lead to HOLD."""

RETUNABLE = ("gains.", "object.", "contacts.position", "safety.hold_stiffness")
"""Parameters that ramp while the law runs."""

NO_NUMBERS = readonly(np.zeros(0))

# Looked up in every cycle, by number: to make an enum's member of one, or to hash it, takes longer.
_FAULTS, _MODES = tuple(Fault), tuple(Mode)
_GOOD = tuple(fault in (Fault.NONE, Fault.DENORMAL, Fault.RESTARTED, Fault.NOT_RUN) for fault in Fault)
_UNANSWERED = tuple(unanswered(fault) for fault in Fault)
_ARM, _LEDGER = place(INPUTS, "arm"), place(OUTPUTS, "ledger")
_EFFORT, _COMMAND = place(OUTPUTS, "effort"), place(OUTPUTS, "command")
_ANSWERED, _MODE = place(OUTPUTS, "answered").start, place(OUTPUTS, "mode.mode").start
_OK, _CAUSE = place(OUTPUTS, "ok").start, place(OUTPUTS, "mode.reason").start
_REASON = slice(_CAUSE, _CAUSE + 3)
_GOVERNED, _GOVERNED_NAMES = place(OUTPUTS, "governor"), GOVERNED.names or ()
_GRIP = place(OUTPUTS, "grip").start
_PATH_SCALE = place(OUTPUTS, "path_scale").start
_NOW, _REQUEST, _MISSING = (place(INPUTS, name).start for name in ("now_ns", "request", "missing"))
_PRESENT, _STEP = place(INPUTS, "present").start, place(OUTPUTS, "decision.step").start
_RAMP = place(ARM_STATE, "law.ramp")
_ANSWERS = [place(ARM_STATE, f"joint.answers.{name}").start for name in ("position", "velocity")]
_CYCLES, _LAW_KNOWN = place(ARM_STATE, "cycles").start, place(ARM_STATE, "law.known").start
_TARED, _ROUGHLY = place(ARM_STATE, "tare.done").start, place(ARM_STATE, "tare.rough").start
_WITHOUT = place(ARM_STATE, "joint.without").start
_STATE_MODE = place(ARM_STATE, "mode.mode").start
_CONFIG_SIZE, _INPUTS_SIZE, _OUTPUTS_SIZE = CONFIG.itemsize // 8, INPUTS.itemsize // 8, OUTPUTS.itemsize // 8


class Health(NamedTuple):
    """The fault of each input in one cycle; NONE = good. `slip` and `wrench` are the worst of all contacts."""

    joint: Fault = Fault.NONE
    wrench: Fault = Fault.NONE
    slip: Fault = Fault.NONE
    outside: Fault = Fault.NONE

    @staticmethod
    def from_code(code: int) -> Health:
        """Read the number in the ledger: a replay uses what the run found, whose arrival times no bag has."""
        return Health(*(Fault(code >> shift & 0xFF) for shift in (0, 8, 16, 24)))


class Manifest(NamedTuple):
    """The bridge's list of what belongs to a lockstep cycle: samples published so far, per contact."""

    tick: int
    stamp_ns: int
    wrench_counts: tuple[int, ...]
    slip_counts: tuple[int, ...]

    @staticmethod
    def decode(data: Sequence[int]) -> Manifest:
        """Read [tick, sec, nanosec, wrench count, slip count, ... per contact]; [ns] inside.

        Raises:
            InputError: a list of another length.
        """
        if len(data) < 5 or len(data) % 2 == 0:
            raise InputError("lockstep tick", got=f"{len(data)} numbers", expected="3, and 2 more per contact")
        return Manifest(data[0], data[1] * 1_000_000_000 + data[2], tuple(data[3::2]), tuple(data[4::2]))


class ArmController:
    """The configuration of one arm: parameters, arm, and the CONFIG of the cycle.

    Args:
        params: checked parameters.
        urdf_text: the arm; gives kinematics, dynamics and limits.
        lockstep: whether to wait for exactly the samples the bridge lists, and to take its stamps as the clock.
        arms: how many hold the object.

    Raises:
        InputError: the parameters and the URDF do not fit.
    """

    def __init__(self, params: ControllerParams, urdf_text: str, *, lockstep: bool, arms: int = 1) -> None:
        self.params, self.lockstep = params, lockstep
        armature = params.drive.of_joints("armature", len(params.joint_names))
        self.robot = Robot(urdf_text, params.ee_frame, params.joint_names, params.gravity, armature)
        self.report = gain_report(params)
        self.config = make_config(params, self.robot, lockstep=lockstep, arms=arms)
        self.gains = make_law_gains(params, self.report.used)
        self.contacts = params.contacts.count
        self.make_command: Callable[[int, Array], JointCommand] = COMMANDS[params.command.interface]
        self.command_place = slice(_COMMAND.start, _COMMAND.start + len(params.joint_names))
        self.external = params.trajectory.kind in ("topic", "goal")
        self.rows = capacity(params) if params.slip_estimator == "observer" else 0


class Controller:
    """The configuration of all arms that hold an object. Sessions may share it.

    Args:
        params: checked parameters of each arm by its name; the first arm leads along the path.
        urdfs: the arms.
        lockstep: whether to wait for exactly the samples the bridge lists, and to take its stamps as the clock.

    Raises:
        InputError: parameters and URDFs do not fit, or the arms do not fit each other.
    """

    def __init__(self, params: Mapping[str, ControllerParams], urdfs: Mapping[str, str], *, lockstep: bool) -> None:
        check_common(params)
        self.lockstep = lockstep
        self.arms = {
            name: ArmController(of, urdfs[name], lockstep=lockstep, arms=len(params)) for name, of in params.items()
        }
        self.first = next(iter(self.arms.values()))
        self.external = self.first.external
        self.rows = max(arm.rows for arm in self.arms.values())
        self.config = np.concatenate([arm.config for arm in self.arms.values()])
        self.config.setflags(write=False)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the arms."""
        return tuple(self.arms)

    def new_state(self) -> Array:
        """Return the state before the first cycle: TASK_STATE, ARM_STATE of each arm, histories of their observers."""
        n = len(self.arms)
        state = np.zeros(TASK_SIZE + n * (ARM_SIZE + self.rows * ROW_SIZE))
        for k, arm in enumerate(self.arms.values()):
            records(state[TASK_SIZE : TASK_SIZE + n * ARM_SIZE], ARM_STATE)[k].tuned = steady(arm.gains).view(RAMP)[0]
        return state


def check_common(params: Mapping[str, ControllerParams]) -> None:
    """See that arms fit each other: they hold one object, so they follow one path, in one rhythm.

    Raises:
        InputError: they do not.
    """
    (name, first), *others = params.items()
    for other, of in others:
        for what, a, b in zip(COMMON, common_values(first), common_values(of), strict=True):
            if a != b:
                raise InputError(
                    f"parameter {other}.{what}", got=b, expected=f"{a!r}, as for {name}: all arms hold one object"
                )


COMMON = ("mode", "control_period_s", "trajectory.kind", "governor.mode")
"""Parameters that are equal for all arms that hold one object."""


def common_values(params: ControllerParams) -> tuple[object, ...]:
    """Return the values of the parameters in COMMON."""
    return params.mode, params.control_period_s, params.trajectory.kind, params.governor.mode


class CycleResult:
    """One answered cycle; an empty command means "no command": an input has never been seen.

    joint: the joint state; numbers: what is commanded, as `command.interface` has it, (n,) [N m], [rad/s] or [rad];
    mode; inputs, outputs: records of the arm.
    """

    __slots__ = ("_controller", "inputs", "joint", "mode", "numbers", "outputs")

    def __init__(self, controller: ArmController, joint: JointSample, inputs: Array, outputs: Array) -> None:
        self._controller, self.joint, self.inputs, self.outputs = controller, joint, inputs, outputs
        outputs.setflags(write=False)
        whole = outputs.view(np.int64)
        self.mode = _MODES[whole[_MODE]]
        self.numbers = outputs[controller.command_place] if whole[_ANSWERED] else NO_NUMBERS

    @property
    def command(self) -> JointCommand:
        """The command that answers the joint state."""
        return self._controller.make_command(self.joint.stamp_ns, self.numbers)

    @property
    def effort(self) -> Array:
        """Effort of the law or of what stands in for it; (n,) [N m], empty where there is no command.

        Drives that take velocities or positions are commanded the motion that it gives the arm.
        """
        return self.outputs[_EFFORT][: len(self.numbers)]

    @property
    def ledger(self) -> tuple[int, ...]:
        """What it used: the cycle, and the stamps (sec, nanosec) of joint state, wrench and slip of each contact."""
        return tuple(self._numbers(0, 3 + 4 * self._controller.contacts))

    @property
    def decision(self) -> tuple[int, ...]:
        """On what it decided, behind the ledger; where references or goals come by topic, also how many were taken."""
        begin = 3 + 4 * self._controller.contacts
        return tuple(self._numbers(begin, begin + 5 + self._controller.external))

    def _numbers(self, begin: int, end: int) -> list[int]:
        return self.outputs[_LEDGER][begin:end].view(np.int64).tolist()

    @property
    def cycle(self) -> int:
        """Number of the cycle."""
        return self.ledger[0]

    @property
    def grip(self) -> float:
        """Grip force that is commanded [N]."""
        return float(self.outputs[_GRIP])

    @property
    def path_speed(self) -> float:
        """Speed along the path; 1 = the trajectory as planned."""
        return float(self.outputs[_PATH_SCALE])

    @property
    def ok(self) -> bool:
        """Whether the effort is the law's."""
        return bool(self.outputs.view(np.int64)[_OK])

    @property
    def load_source(self) -> str:
        """What the load is known from: the wrench sensor, or the model alone."""
        return "model" if self._controller.params.wrench.source == "none" else "sensor"

    @property
    def reason_key(self) -> tuple[int, ...]:
        """What is different where the words of the reason are, but for their numbers."""
        return tuple(self.outputs.view(np.int64)[_REASON].tolist())

    @property
    def arm(self) -> Any:
        """The arm's terms by name; zeros where the joint state was not good."""
        return record(self.inputs, INPUTS).arm

    @property
    def record(self) -> Any:
        """The outputs by name."""
        return record(self.outputs, OUTPUTS)

    @property
    def reason(self) -> str:
        """Why the controller is in its mode, in words."""
        return describe(self.record.mode.reason, self._controller.robot.joint_names)

    @property
    def symbol_names(self) -> tuple[str, ...]:
        """Names of `symbols`, the same in every cycle of a controller."""
        names = published(len(self._controller.robot.joint_names))[0]
        return (*names, *_GOVERNED_NAMES) if self._governed else names

    def symbols(self) -> Array:
        """Return the numbers worth plotting, in the order of `symbol_names`; NaN where there is none."""
        symbols = new(SYMBOLS)
        describe_cycle(self._controller.config, self.inputs, self.outputs, symbols)
        numbers = symbols[published(len(self._controller.robot.joint_names))[1]]
        return np.concatenate((numbers, self.outputs[_GOVERNED])) if self._governed else numbers

    def scalars(self) -> dict[str, float]:
        """Return `symbols` by name."""
        return dict(zip(self.symbol_names, self.symbols().tolist(), strict=True))

    @property
    def _governed(self) -> bool:
        params = self._controller.params
        return params.governor.mode != "off" or params.trajectory.kind == "goal"


Waiting = tuple[JointSample, Fault, int, Health | None]
"""A joint state that waits for its cycle, its fault, bits of what is missing beside inputs that were never seen, and
the health of the inputs in a replay; None = found by input validation."""


def joint_sample(record: JointRecord, joints: int) -> JointSample:
    """Return a copy of the joint state in a record."""
    position, velocity, effort = (of[:joints].copy() for of in (record.position, record.velocity, record.effort))
    return JointSample(int(record.stamp_ns), position, velocity, effort)


class ArmSession:
    """One arm between cycles: its samples, and its row of the state.

    Args:
        session: of all arms.
        name, index: of the arm.
    """

    def __init__(self, session: ControllerSession, name: str, index: int) -> None:
        self.name, self.index, self._session = name, index, session
        self.controller = session.controller.arms[name]
        self.contacts = self.controller.contacts
        self.row = session.buffer[TASK_SIZE + index * ARM_SIZE :][:ARM_SIZE]
        rows = session.controller.rows
        begin = TASK_SIZE + len(session.controller.arms) * ARM_SIZE + index * rows * ROW_SIZE
        self.history = session.buffer[begin : begin + rows * ROW_SIZE]
        self.state: ArmState = record(self.row, ARM_STATE)
        self.inputs_place = slice(index * _INPUTS_SIZE, (index + 1) * _INPUTS_SIZE)
        self.outputs_place = slice(index * _OUTPUTS_SIZE, (index + 1) * _OUTPUTS_SIZE)
        self.config = session.config_of(index)
        self.routes: tuple[tuple[tuple[ArmSession, int], ...], ...] = ()
        self.waiting: Waiting | None = None
        self.overdue = False  # its own next joint state has come while one waited for another arm
        self._lockstep = self.controller.lockstep
        self._joints = len(self.controller.robot.joint_names)
        self._answers = [self.row[first : first + self._joints] for first in _ANSWERS]
        self._slip_delay_ns = int(record(self.config, CONFIG).cycle.slip_delay_ns)
        self._has_wrench = self.controller.params.wrench.source == "sensor"
        self._estimates = bool(record(self.config, CONFIG).estimator.on)
        self._tared = 0
        self._whole = self.row.view(np.int64)
        self._manifest: Manifest | None = None
        self._wrench_counts, self._slip_counts = [0] * self.contacts, [0] * self.contacts
        self._displacements = [SlipFromDisplacement() for _ in range(self.contacts)]
        self._request = self._asked = Request.NONE
        self._tuned: ControllerParams | None = None
        self._outside_counts: Counter[str] = Counter()

    @property
    def estimated_joints(self) -> tuple[str, ...]:
        """Names of the joints whose state is estimated; none where the samples are used as they are."""
        return self.controller.robot.joint_names if self._estimates else ()

    @property
    def task(self) -> TaskState:
        """What is remembered of the object's motion, by name."""
        return self._session.task

    @property
    def active(self) -> bool:
        """Whether efforts are given."""
        return self._session.active

    @property
    def mode(self) -> Mode:
        """The mode of the last cycle."""
        return _MODES[self._whole[_STATE_MODE]]

    @property
    def reason(self) -> str:
        """Why the controller is in its mode, in words."""
        return describe(self.state.mode.reason, self.controller.robot.joint_names)

    @property
    def cycles(self) -> int:
        """How many cycles have been answered."""
        return int(self._whole[_CYCLES])

    @property
    def begun(self) -> bool:
        """Whether the law has begun: a state of it is remembered."""
        return bool(self._whole[_LAW_KNOWN])

    @property
    def gravity(self) -> Array:
        """Gravity torque at the last good joint state that was answered; (n,) [N m]."""
        return readonly(self.state.law.gravity[: self._joints])

    @property
    def tuned(self) -> ControllerParams:
        """The parameters that are in effect, or that gains and payload ramp to."""
        return self._tuned or self.controller.params

    @property
    def newest_joint(self) -> JointSample | None:
        """The last good joint state."""
        joint = self.state.joint
        return joint_sample(joint.last, self._joints) if joint.known else None

    def validated(self, sample: JointSample) -> JointSample:
        """Return a joint state that was added as input validation leaves it: spikes replaced, velocities derived."""
        answers = self.state.joint.answers
        return joint_sample(answers, self._joints) if answers.stamp_ns == sample.stamp_ns else sample

    # -- samples -----------------------------------------------------------------------------------

    def add_joint(self, sample: JointSample, now_ns: int | None = None) -> None:
        """Take a joint state; one that was never answered is skipped, newest wins. `now_ns`: steady time of arrival.

        One that no cycle answers changes nothing for one that waits already, for the partner's.
        """
        n, q, qd, effort = self._joints, sample.position, sample.velocity, sample.effort
        refused = q.shape != (n,) or qd.shape != (n,)
        if refused or effort.shape != (n,):
            effort = np.full(n, np.nan)
        if refused:
            q = qd = effort
        stamp_ns = sample.stamp_ns
        now_ns = stamp_ns if now_ns is None else now_ns
        fault = receive_joint_state(self.config, self.row, stamp_ns, q, qd, effort, refused, now_ns, self._lockstep)
        if self._lockstep or not _UNANSWERED[fault]:
            self.overdue = self.waiting is not None
            if self._whole[_WITHOUT]:  # what a command shows beside its numbers is numbers, too
                sample = self.validated(sample)
            self.waiting = sample, _FAULTS[fault], 0, None

    def add_wrench(self, contact: int, sample: WrenchSample, now_ns: int | None = None) -> None:
        """Take a wrench of one contact; that of the own pad goes to every arm that has a wrench sensor and reads it."""
        stamp_ns, wrench = sample.stamp_ns, sample.wrench
        now_ns = stamp_ns if now_ns is None else now_ns
        refused = wrench.shape != (6,)
        if refused:
            wrench = _NO_VECTOR
        for arm, number in self.routes[contact]:
            arm._wrench_counts[number] += 1
            if arm._has_wrench:
                receive_wrench(arm.config, arm.row, number, stamp_ns, wrench, refused, now_ns)

    def add_slip(self, contact: int, sample: SlipSample, now_ns: int | None = None) -> None:
        """Take a slip velocity of one contact; that of the own pad goes to every arm that reads it."""
        stamp_ns, twist = sample.stamp_ns, sample.twist
        now_ns = stamp_ns if now_ns is None else now_ns
        refused = twist.shape != (6,)
        if refused:
            twist = _NO_VECTOR
        for arm, number in self.routes[contact]:
            arm._slip_counts[number] += 1
            receive_slip(arm.config, arm.row, number, stamp_ns, twist, sample.valid, refused, now_ns)

    def add_displacement(self, contact: int, sample: DisplacementSample, now_ns: int | None = None) -> None:
        """Take where the pad of one contact is on the object; from the second one on it gives slip velocities."""
        slip = self._displacements[contact](sample)
        if slip is None:
            for arm, number in self.routes[contact]:
                arm._slip_counts[number] += 1
        else:
            self.add_slip(contact, slip, sample.stamp_ns if now_ns is None else now_ns)

    def add_manifest(self, manifest: Manifest) -> None:
        """Take the list of what belongs to the current lockstep cycle; contacts in this arm's order."""
        self._manifest = manifest

    def set_own_reference(self, reference: CartesianReference) -> None:
        """Use this reference of this pad alone from the next cycle on, wherever the others are led."""
        self.state.reference_known = 1
        _put(reference, self.state.reference)

    def set_publishers(self, counts: Mapping[str, int], own_topic_publishers: int) -> None:
        """Take how many publishers each input topic has, and how many our command topic has."""
        before, twice = self.state.outside, [name for name, count in counts.items() if count > 1]
        outside = Fault.SECOND_PUBLISHER if twice else Fault.NONE
        if own_topic_publishers > 1:
            outside = Fault.FOREIGN_COMMAND
        self.state.outside = int(outside)
        if outside not in (before, Fault.NONE):
            self._outside_counts[f"{', '.join(twice) or 'effort command'} {outside.name.lower()}"] += 1

    # -- requests and parameters -------------------------------------------------------------------

    def request(self, request: Request) -> None:
        """Request a mode of this arm; the next cycle decides."""
        self._request = request

    def ramp_to(self, params: ControllerParams, target: Array) -> None:
        """Let gains and payload ramp to those of `params`, whose LAW_GAINS is `target`."""
        least_s, law = params.gains.ramp_s, self.state.law
        if params.object != self.tuned.object:
            self.state.tare.mass_share = 0.0  # what a user gives counts
        self.state.tuned = make_ramp(self.controller.gains, target, 0, least_s).view(RAMP)[0]
        if law.known:
            start = new(LAW_GAINS)
            sample_gains(self.row[_RAMP], int(law.stamp_ns), start)
            law.ramp = make_ramp(start, target, int(law.stamp_ns), least_s).view(RAMP)[0]
        self.know(params)

    def know(self, params: ControllerParams) -> None:
        """Take parameters that were set before the state which `restore` was given: their ramp is part of it."""
        self._tuned = params
        self._session.configure(self.index, lambda config: renew_config(config, params))

    def use_tare(self) -> None:
        """Use the noise that a tare has measured, and what is configured until then."""
        measured = int(self._whole[_ROUGHLY]) + 2 * int(self._whole[_TARED])
        if measured != self._tared:
            self._tared = measured
            params = with_measured_noise(self.tuned, self.state.tare) if measured else self.tuned
            limit, weighed = self.controller.robot.effort_limit, bool(self.state.tare.done)
            self._session.configure(self.index, lambda config: use_noise(config, params, limit, weighed=weighed))
            self._estimates = bool(record(self.config, CONFIG).estimator.on)

    # -- cycles ------------------------------------------------------------------------------------

    def complete(self) -> bool:
        """Return whether a cycle can be answered: a joint state, and in lockstep all that belongs to its stamp.

        Lockstep answers every cycle, also one whose other inputs are still missing.
        """
        waiting, manifest = self.waiting, self._manifest
        if waiting is None or not self._lockstep:
            return waiting is not None
        return (
            manifest is not None
            and manifest.stamp_ns == waiting[0].stamp_ns
            and (manifest.wrench_counts == tuple(self._wrench_counts) or not self._has_wrench)
            and manifest.slip_counts == tuple(self._slip_counts)
        )

    def prepare(self, now_ns: int | None, inputs: Array) -> JointSample | None:
        """Fill the INPUTS of this arm for a cycle; return the joint state that it answers, None where none waits.

        Args:
            now_ns: the controller's clock; None takes the stamp of the joint state.
            inputs: INPUTS of all arms.
        """
        if self.waiting is None:
            return None
        joint, fault, missing, health = self.waiting
        self.waiting = self._manifest = None
        self.overdue = False
        if not self._session.active:
            missing |= ACTIVATION
        own = self.fill(joint.stamp_ns if now_ns is None else now_ns, missing, inputs)
        if health is not None:
            given = record(own, INPUTS)
            given.health_given, given.health = 1, tuple(int(part) for part in health)
        known = _GOOD[fault]
        if known:
            estimate_joint_state(self.config, self.row)
        else:
            known = replace_joint_state(self.config, self.row, fault, own.view(np.int64)[_NOW])
        if known:
            q, qd = self._answers
            self.controller.robot.terms(q, qd, own[_ARM])
        return joint

    def result(self, joint: JointSample, inputs: Array, outputs: Array) -> CycleResult:
        """Return the result of a cycle for this arm; INPUTS and OUTPUTS of all arms."""
        return CycleResult(self.controller, joint, inputs[self.inputs_place], outputs[self.outputs_place])

    def fill(self, now_ns: int, missing: int, inputs: Array) -> Array:
        """Fill clock and request of the INPUTS of this arm, in those of all arms, and return them."""
        own = inputs[self.inputs_place]
        whole = own.view(np.int64)
        whole[_PRESENT], whole[_NOW], whole[_REQUEST], whole[_MISSING] = 1, now_ns, self._request, missing
        self._asked, self._request = self._request, Request.NONE
        return own

    def ask_again(self, outputs: Array) -> None:
        """Keep a request for the next cycle where this one has only bridged a bad joint state; OUTPUTS of all arms."""
        if self._asked and outputs[self.outputs_place].view(np.int64)[_STEP] == Step.BRIDGE:
            self._request = self._asked

    def give(
        self,
        joint: JointSample,
        wrenches: Sequence[WrenchSample],
        slips: Sequence[SlipSample | None],
        new_slips: Sequence[SlipSample],
    ) -> None:
        """Put the samples of the next cycle in place as a replay names them, past input validation.

        Args:
            joint: the joint state that it answers; it was added, so that what is kept of joint states goes on.
            wrenches, slips: the newest of each contact; none where the run waited for them.
            new_slips: of the own contact, since the cycle before.
        """
        state, n = self.state, self._joints
        answers = state.joint.answers
        answers.stamp_ns, answers.position[:n], answers.velocity[:n] = joint.stamp_ns, joint.position, joint.velocity
        answers.effort[:n] = joint.effort if joint.effort.shape == (n,) else math.nan
        for of, wrench in zip(state.wrench_inputs, wrenches, strict=False):
            of.seen, of.stamp_ns, of.values[:] = 1, wrench.stamp_ns, wrench.wrench
        for of, slip in zip(state.slip_inputs, slips, strict=False):
            if slip is not None:
                of.seen, of.stamp_ns, of.values[:] = 1, slip.stamp_ns, slip.twist
        state.queue.count = len(new_slips[-MAX_FRESH:])
        for fresh, slip in zip(state.queue.samples, new_slips[-MAX_FRESH:], strict=False):
            fresh.stamp_ns, fresh.twist[:] = slip.stamp_ns - self._slip_delay_ns, slip.twist

    def silent(self, now_ns: int) -> bool:
        """Return whether no good joint state has come for the age limit."""
        return bool(is_silent(self.config, self.row, now_ns))

    def watchdog(self, now_ns: int) -> CycleResult | None:
        """Return a command where joint states have stayed away for too long, None where all is well.

        On the steady clock, so that it bites when every other clock stops. It repeats until the effort has come down to
        gravity compensation; the bridge's command timeout does the rest.
        """
        if not self.active or self._lockstep or not self.begun or self.mode == Mode.WAITING_INPUT:
            return None
        if not self.silent(now_ns):
            return None
        newest = self.newest_joint
        assert newest is not None  # silent is only an arm that has sent
        before = self._session.buffer.copy()
        result, changed = self.without_joint_state(newest, now_ns)
        if not changed:
            self._session.buffer[:] = before
            return None
        return result

    def failed(self, now_ns: int) -> CycleResult | None:
        """Go to FAULT because the node has failed; return a command where the law has begun.

        It comes from the last good joint state alone, so that it needs nothing of what failed. Without one the drive or
        the bridge holds the arm, and the next cycle goes to FAULT.
        """
        self._request = Request.FAILED
        newest = self.newest_joint
        if not self.active or not self.begun or self.mode == Mode.WAITING_INPUT or newest is None:
            return None
        return self.without_joint_state(newest, newest.stamp_ns if self._lockstep else now_ns)[0]

    def without_joint_state(self, newest: JointSample, now_ns: int) -> tuple[CycleResult, bool]:
        """Run one cycle of the watchdog; return its result, and whether effort or mode have changed by it."""
        return self._session.run_watchdog(self, newest, now_ns)

    # -- snapshots ---------------------------------------------------------------------------------

    def snapshot(self) -> Array:
        """Return all with which the next cycle of this arm begins: the task, and its own row and history."""
        task = self._session.buffer[:TASK_SIZE]
        return np.concatenate((task, self.row, used_history(self.state.observer, self.history)))

    def restore(self, state: Array) -> None:
        """Continue from a snapshot of this arm; of several arms each is restored from its own.

        Raises:
            InputError: it is of another size.
        """
        expected = TASK_SIZE + self.row.size + self.history.size
        if state.shape != (expected,):
            raise InputError("controller state", got=f"{state.size} numbers", expected=f"{expected}")
        self._session.buffer[:TASK_SIZE] = state[:TASK_SIZE]
        self.row[:], self.history[:] = state[TASK_SIZE:][:ARM_SIZE], state[TASK_SIZE + ARM_SIZE :]
        self.use_tare()

    # -- statistics --------------------------------------------------------------------------------

    def counts(self) -> dict[str, int]:
        """Return every fault that was seen, as "input fault", with how often."""
        state, found = self.state, {}
        inputs: list[tuple[str, JointInput | VectorInput]] = [("joint state", state.joint)]
        for kind, each in (("wrench", state.wrench_inputs), ("slip", state.slip_inputs)):
            inputs += [(kind if k == 0 else f"{kind} of contact {k}", each[k]) for k in range(self.contacts)]
        for name, of in inputs:
            for fault in Fault:
                if of.counts[fault]:
                    found[f"{name} {fault.name.lower()}"] = int(of.counts[fault])
        return found | dict(self._outside_counts)

    def rates(self) -> dict[str, tuple[float, float]]:
        """Return mean period and jitter [s] of the inputs that have come at least twice."""
        state = self.state
        of = {
            "joint_states": state.joint.rate,
            "wrench": state.wrench_inputs[0].rate,
            "slip_velocity": state.slip_inputs[0].rate,
        }
        rates = {name: (mean_period_s(rate), float(rate.jitter_s)) for name, rate in of.items()}
        return {name: rate for name, rate in rates.items() if not math.isnan(rate[0])}


Results = tuple[CycleResult | None, ...]
"""One for each arm; None where it was not answered."""


class ControllerSession:
    """Runs the control cycle whenever a set of inputs is complete: a joint state of every arm, and what belongs to it.

    Contact 0 of an arm is its own pad. Further contacts are the pads of the other arms in their order; of a single arm
    they have topics of their own.

    Args:
        controller: parameters and arms.
    """

    def __init__(self, controller: Controller) -> None:
        self.controller = controller
        self.buffer = controller.new_state()
        self.active = True
        self.task: TaskState = record(self.buffer[:TASK_SIZE], TASK_STATE)
        self._lockstep, self._config = controller.lockstep, controller.config
        self._governed_stream = governed_stream(controller.first.params)
        self._ahead: frozenset[int] = frozenset()  # answered for joint states that other arms have yet to bring
        self.arms = tuple(ArmSession(self, name, k) for k, name in enumerate(controller.names))
        self._inputs_size, self._outputs_size = len(self.arms) * _INPUTS_SIZE, len(self.arms) * _OUTPUTS_SIZE
        self._taring = tuple(arm for arm in self.arms if arm.controller.params.tare.duration_s > 0.0)
        for arm in self.arms:
            arm.routes = tuple(tuple(self._routes(arm.index, contact)) for contact in range(arm.contacts))

    def _routes(self, own: int, contact: int) -> Iterator[tuple[ArmSession, int]]:
        """Yield the arms that read a contact of an arm, and its number there."""
        yield self.arms[own], contact
        for arm in self.arms if contact == 0 else ():
            number = own + 1 if own < arm.index else own
            if arm.index != own and number < arm.contacts:
                yield arm, number

    @property
    def reference_from_topic(self) -> bool:
        """Whether the reference comes from outside instead of the built-in trajectory."""
        return self.controller.first.params.trajectory.kind == "topic"

    def config_of(self, index: int) -> Array:
        """Return the CONFIG of an arm."""
        return self._config[index * _CONFIG_SIZE :][:_CONFIG_SIZE]

    def configure(self, index: int, change: Callable[[ControllerConfig], None]) -> None:
        """Change the CONFIG of an arm; sessions that share the controller keep theirs."""
        config = self._config.copy()
        change(records(config, CONFIG)[index])
        if config.tobytes() != self._config.tobytes():
            config.setflags(write=False)
            self._config = config
            for arm in self.arms:
                arm.config = self.config_of(arm.index)

    # -- inputs of the object ----------------------------------------------------------------------

    def add_manifest(self, manifest: Manifest) -> None:
        """Take the list of what belongs to the current lockstep cycle: the pads' samples, in the order of the arms."""
        if len(self.arms) == 1:
            self.arms[0].add_manifest(manifest)
            return
        for arm in self.arms:
            order = [arm.index, *(k for k in range(len(manifest.wrench_counts)) if k != arm.index)][: arm.contacts]
            wrenches, slips = (
                tuple(counts[k] for k in order if k < len(counts))
                for counts in (manifest.wrench_counts, manifest.slip_counts)
            )
            arm.add_manifest(Manifest(manifest.tick, manifest.stamp_ns, wrenches, slips))

    def set_reference(self, reference: CartesianReference) -> None:
        """Use this reference from the next cycle on; governed, follow it as soon as friction admits.

        Of one arm it is that of the pad; of several that of the object's centre of mass, which every pad keeps to.

        Raises:
            InputError: numbers that no arm can follow, which are errors of a unit or a frame; nothing has changed then.
        """
        for what, values, most in (
            ("position", reference.position, MOST_POSITION), ("twist", reference.twist, MOST_TWIST),
            ("acceleration", reference.acceleration, MOST_ACCELERATION),
        ):  # fmt: skip
            largest = float(np.abs(values).max())
            if math.isfinite(largest) and largest > most:
                raise InputError(f"reference: {what}", got=f"{largest:.3g}", expected=f"at most {most:g}")
        task = self.task
        task.taken += 1
        given = task.reference
        if self._governed_stream:
            stream = task.stream
            if stream.queued == QUEUED:
                for k in range(QUEUED - 1):
                    stream.queue[k] = stream.queue[k + 1]
                stream.queued -= 1
            item = stream.queue[int(stream.queued)]
            item.stamp_ns, given = reference.stamp_ns, item.reference
            stream.queued += 1
        else:
            task.reference_known = 1
        _put(self._of_first_pad(reference), given)

    def set_goal(self, goal: PoseGoal) -> None:
        """Come to rest at this pose; the next cycle begins it, waits until the pad is at rest, or refuses it.

        Of one arm it is the pose of the pad; of several that of the object's centre of mass.
        """
        task = self.task.goal
        r, R = self._grasp(goal.rotation)
        task.received, task.pending = task.received + 1, 1
        task.to_position, task.to_rotation, task.duration = goal.position + r, R, goal.duration_s
        self.task.taken += 1

    def _grasp(self, rotation: Array) -> tuple[Array, Array]:
        """Return lever [m] and attitude of the first pad {w}; rotation: of what references and goals move."""
        if len(self.arms) == 1:
            return np.zeros(3), rotation
        contacts = self.controller.first.params.contacts
        return rotation @ np.array(contacts.position[:3]), rotation @ matrix_from_quat_xyzw(
            contacts.orientation_xyzw[:4]
        )

    def _of_first_pad(self, reference: CartesianReference) -> CartesianReference:
        """Return the reference of the first pad where the object moves by a reference."""
        if len(self.arms) == 1:
            return reference
        (r, R), w, alpha = self._grasp(reference.rotation), reference.twist[3:], reference.acceleration[3:]
        twist = np.concatenate((reference.twist[:3] + np.cross(w, r), w))
        linear = reference.acceleration[:3] + np.cross(alpha, r) + np.cross(w, np.cross(w, r))
        acceleration = np.concatenate((linear, alpha))
        return CartesianReference(reference.position + r, R, twist, acceleration, reference.stamp_ns)

    # -- requests and parameters -------------------------------------------------------------------

    def set_active(self, active: bool) -> None:
        """Start again, or answer without effort until then; a fault stays."""
        self.active = active
        for arm in self.arms:
            arm.state.law.known = 0

    def request(self, request: Request) -> None:
        """Request a mode of all arms; the next cycle decides."""
        for arm in self.arms:
            arm.request(request)

    def retune(self, params: Sequence[ControllerParams]) -> None:
        """Let gains and payload of each arm ramp to those of `params`, and HOLD use them, from the next cycle on.

        Raises:
            InputError: the values are refused as a whole, or something else has changed; nothing has happened then.
        """
        targets = []
        for arm, wanted in zip(self.arms, params, strict=True):
            now = flatten(arm.tuned)
            for name, value in flatten(wanted).items():
                if value != now[name] and not name.startswith(RETUNABLE):
                    raise InputError(
                        f"parameter {name}", got=value, expected=f"{now[name]!r} while the law runs",
                        fix="restart the node",
                    )  # fmt: skip
            targets.append(make_law_gains(wanted, gain_report(wanted).used))
        for arm, wanted, target in zip(self.arms, params, targets, strict=True):
            arm.ramp_to(wanted, target)

    # -- cycles ------------------------------------------------------------------------------------

    def cycle(self, now_ns: int | None = None) -> Results:
        """Answer what has come: all arms, or in real time those whose partners' joint states stay away.

        Arms that are answered without the others hold.

        Args:
            now_ns: steady time; None, and lockstep, take the stamps of the joint states.
        """
        if self._lockstep or now_ns is None:
            for arm in self.arms:
                if not arm.complete():
                    return (None,) * len(self.arms)
            return self.answer(None)
        late = [arm for arm in self.arms if arm.waiting is None]
        if not late:
            self._ahead = frozenset()
            return self.answer(now_ns)
        if len(late) == len(self.arms) == 1:
            return (None,)
        results = tuple([None if arm.waiting is not None else arm.watchdog(now_ns) for arm in self.arms])
        ready = [arm for arm in self.arms if arm.waiting is not None]
        if not ready or not self._may_go_alone(ready, late, now_ns):
            return results
        return tuple(own or result for own, result in zip(self.answer(now_ns), results, strict=True))

    def _may_go_alone(self, ready: Sequence[ArmSession], late: Sequence[ArmSession], now_ns: int) -> bool:
        """Return whether arms are answered whose partners are silent or hold.

        A partner that is not silent is waited for, so that all are answered together: while they follow the law until
        its joint state comes, while it holds until the next one of an arm that waits does.
        """
        if not all(arm.begun for arm in late):
            return False
        awaited = [arm for arm in late if not arm.silent(now_ns) and arm.index not in self._ahead]
        if not awaited:
            self._ahead = frozenset()
            return True
        if any(arm.mode.follows for arm in awaited) or not any(arm.overdue for arm in ready):
            return False
        self._ahead = frozenset(arm.index for arm in ready)
        return True

    def answer(self, now_ns: int | None) -> Results:
        """Run one cycle on the joint states that wait for it; an arm where none waits is not answered.

        now_ns: the controller's clock; None takes the stamps of the joint states.
        """
        inputs, outputs = np.zeros(self._inputs_size), np.zeros(self._outputs_size)
        joints = [arm.prepare(now_ns, inputs) for arm in self.arms]
        cycle(self._config, self.buffer, inputs, outputs)
        for arm in self.arms:
            arm.ask_again(outputs)
        for arm in self._taring:
            arm.use_tare()
        pairs = zip(self.arms, joints, strict=True)
        return tuple([None if joint is None else arm.result(joint, inputs, outputs) for arm, joint in pairs])

    def run_watchdog(self, arm: ArmSession, newest: JointSample, now_ns: int) -> tuple[CycleResult, bool]:
        """Run one cycle of the watchdog for an arm; return its result, and whether effort or mode have changed."""
        inputs, outputs = np.zeros(self._inputs_size), np.zeros(self._outputs_size)
        arm.fill(now_ns, 0, inputs)
        changed = watchdog(self._config, self.buffer, inputs, outputs, arm.index)
        return arm.result(newest, inputs, outputs), bool(changed)

    def watchdog(self, now_ns: int) -> Results:
        """Answer arms whose joint states have stayed away for too long, and those that waited for them."""
        if self._lockstep:
            return (None,) * len(self.arms)
        return self.cycle(now_ns) if len(self.arms) > 1 else (self.arms[0].watchdog(now_ns),)

    def failed(self, now_ns: int) -> Results:
        """Go to FAULT with all arms because the node has failed; return commands where the law has begun."""
        return tuple(arm.failed(now_ns) for arm in self.arms)

    # -- snapshots ---------------------------------------------------------------------------------

    def snapshot(self) -> Array:
        """Return all with which the next cycle begins; its bytes are equal where states evolve identically."""
        begin = TASK_SIZE + len(self.arms) * ARM_SIZE
        histories = [used_history(arm.state.observer, arm.history) for arm in self.arms]
        return np.concatenate((self.buffer[:begin], *histories))

    def restore(self, state: Array) -> None:
        """Continue from a snapshot.

        Raises:
            InputError: it is of another size.
        """
        if state.shape != self.buffer.shape:
            raise InputError("controller state", got=f"{state.size} numbers", expected=f"{self.buffer.size}")
        self.buffer[:] = state
        for arm in self._taring:
            arm.use_tare()


def used_history(observer: Any, history: Array) -> Array:
    """Return the history of an OBSERVER with zeros where it has nothing."""
    rows = history.reshape(-1, ROW_SIZE).copy()
    if len(rows):
        unused = np.ones(len(rows), dtype=bool)
        unused[(observer.first + np.arange(observer.rows)) % len(rows)] = False
        rows[unused] = 0.0
    return rows.reshape(-1)


def _put(reference: CartesianReference, out: Any) -> None:
    """Write a reference to a REFERENCE."""
    out.position, out.rotation = reference.position, reference.rotation
    out.twist, out.acceleration = reference.twist, reference.acceleration


_NO_VECTOR = readonly(np.full(6, np.nan))
