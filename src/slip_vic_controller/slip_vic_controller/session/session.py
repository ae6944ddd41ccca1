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

from slip_core.arrays import Array, matrix_from_quat_xyzw, product, readonly
from slip_core.errors import InputError
from slip_core.params import flatten
from slip_core.records import new, place, record
from slip_core.stamps import NS_PER_S, seconds_to_ns
from slip_core.types import CartesianReference, DisplacementSample, JointSample, PoseGoal, SlipSample, WrenchSample
from slip_vic_controller.arm.estimator import JointRecord
from slip_vic_controller.config.controller import Controller, governed_stream, renew_config
from slip_vic_controller.config.noise import use_tare
from slip_vic_controller.cycle.cycle import cycle
from slip_vic_controller.interfaces import SlipFromDisplacement
from slip_vic_controller.law.gains import gain_report
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.safety.conditions import SAMPLE_FAULTS, Missing, Mode, Reason, Request
from slip_vic_controller.safety.validation import JointInput, VectorInput
from slip_vic_controller.session.arrival import (
    UNANSWERED,
    WHY,
    begin_answer,
    is_silent,
    overload,
    ramp_to,
    receive_joint_state,
    receive_slip,
    receive_wrench,
)
from slip_vic_controller.session.cycle_result import NO_NUMBERS, CycleResult, Health
from slip_vic_controller.session.words import describe
from slip_vic_controller.sizes import ROOM
from slip_vic_controller.state import (
    ARM_SIZE,
    ARM_STATE,
    CONFIG,
    CONFIG_SIZE,
    INPUTS,
    INPUTS_SIZE,
    OUTPUTS_SIZE,
    TASK_SIZE,
    TASK_STATE,
    ArmState,
    CycleInputs,
    TaskState,
)

MOST = 1e3
"""Most of anything that a reference may have, in SI units; numbers that are not finite lead to HOLD."""


RETUNABLE = ("gains.", "object.", "contacts.position", "safety.hold_stiffness")
"""Parameters that ramp while the law runs."""


Results = tuple[CycleResult | None, ...]
"""One for each arm; None where it was not answered."""


class Manifest(NamedTuple):
    """The bridge's list of what belongs to a lockstep cycle: samples published so far, per contact."""

    tick: int
    stamp_ns: int
    wrench_counts: tuple[int, ...]
    slip_counts: tuple[int, ...]

    @staticmethod
    def decode(message: Any) -> Manifest:
        """Read [tick, sec, nanosec, wrench count, slip count, ... per contact].

        Raises:
            InputError: a list of another length.
        """
        data = message.data.tolist()
        if len(data) < 5 or len(data) % 2 == 0:
            raise InputError("lockstep tick", got=f"{len(data)} numbers", expected="3, and 2 more per contact")
        return Manifest(data[0], data[1] * NS_PER_S + data[2], tuple(data[3::2]), tuple(data[4::2]))


# Looked up in every cycle, by number: to make an enum's member of one, or to hash it, takes longer.
_MODES = tuple(Mode)
_ARM = place(INPUTS, "arm")
_COMMANDED = [place(ARM_STATE, name) for name in ("mode", "sent.effort", "sent.velocity")]
_ANSWERS = [place(ARM_STATE, f"joint.answers.{name}").start for name in ("position", "velocity")]
_CYCLES, _LAW_KNOWN = place(ARM_STATE, "cycles").start, place(ARM_STATE, "law.known").start
_TARED, _ROUGHLY = place(ARM_STATE, "tare.done").start, place(ARM_STATE, "tare.rough").start
_WITHOUT = place(ARM_STATE, "joint.without").start
_STATE_MODE = place(ARM_STATE, "mode.mode").start
_NO_VECTOR = readonly(np.full(6, np.nan))

Waiting = tuple[JointSample, int, int, Health | None]
"""A joint state that waits for its cycle, the number of its fault (to pass on an enum's member is slow), bits of what
is missing beside inputs that were never seen, and the health of the inputs in a replay; None = found by input
validation."""


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
        self.state: ArmState = record(self.row, ARM_STATE)
        given = len(session.controller.arms) * INPUTS_SIZE
        self._inputs = slice(index * INPUTS_SIZE, (index + 1) * INPUTS_SIZE)
        self._outputs = slice(given + index * OUTPUTS_SIZE, given + (index + 1) * OUTPUTS_SIZE)
        self.config = session.config_of(index)
        self.routes: tuple[tuple[tuple[ArmSession, int], ...], ...] = ()
        self.waiting: Waiting | None = None
        self._lockstep = self.controller.lockstep
        self._joints = len(self.controller.robot.joint_names)
        self._answers = [self.row[first : first + self._joints] for first in _ANSWERS]
        self._slip_delay_ns = int(record(self.config, CONFIG).slip_delay_ns)
        self._has_wrench = self.controller.params.wrench.source == "sensor"
        self._tared = 0
        self._whole = self.row.view(np.int64)
        self._displacements = [SlipFromDisplacement() for _ in range(self.contacts)]
        self._request = int(Request.NONE)  # numbers: members of an enum are slow to pass on
        self._tuned: ControllerParams | None = None
        self._outside_counts: Counter[str] = Counter()

    @property
    def estimated_joints(self) -> tuple[str, ...]:
        """Names of the joints whose state is estimated; none where the samples are used as they are."""
        return self.controller.robot.joint_names if self.controller.params.estimates_joints else ()

    @property
    def mode(self) -> Mode:
        """The mode of the last cycle."""
        return _MODES[self._whole.item(_STATE_MODE)]

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
        if self._lockstep or not UNANSWERED[fault]:
            if self._whole.item(_WITHOUT):  # who reads the result finds numbers
                sample = self.validated(sample)
            self.waiting = sample, fault, 0, None

    def add_wrench(self, contact: int, sample: WrenchSample, now_ns: int | None = None) -> None:
        """Take a wrench of one contact; that of the own pad goes to every arm that has a wrench sensor and reads it."""
        stamp_ns, wrench = sample.stamp_ns, sample.wrench if sample.wrench.shape == (6,) else _NO_VECTOR
        now_ns = stamp_ns if now_ns is None else now_ns
        self._session.wrench_counts[self.index + contact] += 1
        for arm, number in self.routes[contact]:
            if arm._has_wrench:
                receive_wrench(arm.config, arm.row, number, stamp_ns, wrench, wrench is _NO_VECTOR, now_ns)

    def add_slip(self, contact: int, sample: SlipSample, now_ns: int | None = None) -> None:
        """Take a slip velocity of one contact; that of the own pad goes to every arm that reads it."""
        stamp_ns, twist = sample.stamp_ns, sample.twist if sample.twist.shape == (6,) else _NO_VECTOR
        now_ns = stamp_ns if now_ns is None else now_ns
        self._session.slip_counts[self.index + contact] += 1
        for arm, number in self.routes[contact]:
            receive_slip(arm.config, arm.row, number, stamp_ns, twist, sample.valid, twist is _NO_VECTOR, now_ns)

    def add_displacement(self, contact: int, sample: DisplacementSample, now_ns: int | None = None) -> None:
        """Take where the pad of one contact is on the object; from the second one on it gives slip velocities."""
        slip = self._displacements[contact](sample)
        if slip is None:
            self._session.slip_counts[self.index + contact] += 1
        else:
            self.add_slip(contact, slip, sample.stamp_ns if now_ns is None else now_ns)

    def set_publishers(self, counts: Mapping[str, int], own_topic_publishers: int) -> None:
        """Take how many publishers each input topic has, and how many our command topic has."""
        before, twice = self.state.outside, [name for name, count in counts.items() if count > 1]
        outside = Reason.SECOND_PUBLISHER if twice else Reason.NONE
        if own_topic_publishers > 1:
            outside = Reason.FOREIGN_COMMAND
        self.state.outside = int(outside)
        if outside not in (before, Reason.NONE):
            self._outside_counts[f"{', '.join(twice) or 'effort command'} {outside.name.lower()}"] += 1

    # -- requests and parameters -------------------------------------------------------------------

    def request(self, request: Request) -> None:
        """Request a mode of this arm; the next cycle decides."""
        self._request = int(request)

    def refuse_overload(self, params: ControllerParams) -> None:
        """Raise InputError where the arm cannot hold the object of `params` in its present posture."""
        config, inputs, why, robot = self.config.copy(), np.zeros(INPUTS_SIZE), new(WHY), self.controller.robot
        renew_config(record(config, CONFIG), params)
        q, qd = self._answers
        robot.terms(q, qd, inputs[_ARM])
        overload(config, self.row, inputs, why)
        if self.state.law.known and (text := describe(record(why, WHY), robot.joint_names)):
            raise InputError("parameters object and contacts", got=text, expected="an object that the arm can hold")

    def ramp_to(self, params: ControllerParams, target: Array) -> None:
        """Ramp gains and payload to those of `params`; target: its LAW_GAINS."""
        moved = np.subtract(params.contacts.position, self.tuned.contacts.position)
        # Shifting the contact seems to move the object, and the law follows it.
        least_s = max(params.gains.ramp_s, float(np.linalg.norm(moved)) / params.safety.limits.speed_linear)
        if params.object != self.tuned.object:
            self.state.tare.mass_share = 0.0  # the user's mass replaces that of the tare
        ramp_to(self.row, target, seconds_to_ns(least_s))
        self._tuned = params
        self._session.configure(self.index, lambda config: renew_config(record(config, CONFIG), params))

    def use_tare(self) -> None:
        """Use the configured noise until a tare has measured it."""
        measured = int(self._whole[_ROUGHLY]) + 2 * int(self._whole[_TARED])
        if measured != self._tared:
            self._tared = measured
            self._session.configure(self.index, lambda config: use_tare(config, self.row))

    # -- cycles ------------------------------------------------------------------------------------

    def complete(self) -> bool:
        """Return whether a lockstep cycle can be answered: a joint state, and all that belongs to its stamp.

        Every cycle is answered, also one whose other inputs are still missing.
        """
        waiting, session, manifest = self.waiting, self._session, self._session.manifest
        return (
            waiting is not None
            and manifest is not None
            and manifest.stamp_ns == waiting[0].stamp_ns
            and (manifest.wrench_counts == tuple(session.wrench_counts) or not self._has_wrench)
            and manifest.slip_counts == tuple(session.slip_counts)
        )

    def prepare(self, now_ns: int | None, exchange: Array) -> JointSample | None:
        """Fill the INPUTS of this arm for a cycle; return the joint state that it answers, None where none waits.

        Args:
            now_ns: the controller's clock; None takes the stamp of the joint state.
            exchange: INPUTS and OUTPUTS of all arms.
        """
        if self.waiting is None:
            return None
        joint, fault, missing, health = self.waiting
        self.waiting = self._session.manifest = None
        if not self._session.active:
            missing |= Missing.ACTIVATION
        now_ns = joint.stamp_ns if now_ns is None else now_ns
        own = exchange[self._inputs]
        if health is not None:
            given = record(own, INPUTS)
            given.health_given, given.health = 1, tuple(int(part) for part in health)
        if begin_answer(self.config, self.row, own, now_ns, self.take_request(), missing, fault):
            q, qd = self._answers
            self.controller.robot.terms(q, qd, own[_ARM])
        return joint

    def take_request(self) -> int:
        """Return the mode that is requested, from now on for the cycle that begins."""
        request, self._request = self._request, 0
        return request

    def result(self, joint: JointSample, exchange: Array, commands: bool) -> CycleResult:
        """Return the result of a cycle for this arm, which has advanced its state.

        Args:
            joint: the joint state that it answers.
            exchange: INPUTS and OUTPUTS of all arms, read-only from now on.
            commands: whether there is a command.
        """
        own = exchange[self._outputs]
        numbers = own[self.controller.command_place] if commands else NO_NUMBERS
        return CycleResult(self.controller, joint, self.mode, numbers, exchange[self._inputs], own)

    def give(
        self,
        joint: JointSample,
        wrenches: Sequence[WrenchSample],
        slips: Sequence[SlipSample | None],
        new_slips: Sequence[SlipSample],
    ) -> None:
        """Put the samples of the next cycle in place as a replay names them, past input validation.

        Args:
            joint: the joint state that it answers; it was added, so that the history of joint states continues.
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
        state.queue.count = len(new_slips[-ROOM:])
        for fresh, slip in zip(state.queue.samples, new_slips[-ROOM:], strict=False):
            fresh.stamp_ns, fresh.twist[:] = slip.stamp_ns - self._slip_delay_ns, slip.twist

    def silent(self, now_ns: int) -> bool:
        """Return whether no good joint state has come for the age limit."""
        return bool(is_silent(self.config, self.row, now_ns))

    def watchdog(self, now_ns: int) -> CycleResult | None:
        """Return a command where joint states have stayed away for too long, None where all is well.

        On the steady clock, so that it bites when every other clock stops. It repeats until the effort has come down to
        gravity compensation; the bridge's command timeout does the rest.
        """
        if self._lockstep or not self._is_at_work or not self.silent(now_ns):
            return None
        before = self._session.buffer.copy()
        result, changed = self.without_joint_state(now_ns)
        if not changed:
            self._session.buffer[:] = before
            return None
        return result

    def failed(self, now_ns: int) -> CycleResult | None:
        """Go to FAULT because the node has failed; return a command where the law has begun.

        It comes from the last good joint state alone, so that it needs nothing of what failed. Without one the drive or
        the bridge holds the arm, and the next cycle goes to FAULT.
        """
        self._request = int(Request.FAILED)
        return self.without_joint_state(now_ns)[0] if self._is_at_work else None

    @property
    def _is_at_work(self) -> bool:
        return self._session.active and self.begun and self.mode != Mode.WAITING_INPUT

    def without_joint_state(self, now_ns: int) -> tuple[CycleResult, bool]:
        """Run a cycle on the last good joint state, in lockstep at its stamp.

        Returns its result, and whether effort or mode have changed.
        """
        exchange, newest, before = self._session.new_exchange(), self.newest_joint, self._commanded()
        assert newest is not None  # an arm that has begun has sent
        given: CycleInputs = record(exchange[self._inputs], INPUTS)
        given.present, given.request = 1, self.take_request()
        given.now_ns = newest.stamp_ns if self._lockstep else now_ns
        self.state.joint.pending_fault = int(Reason.SILENT)
        answered = cycle(self._session.config, self._session.buffer, exchange)
        exchange.setflags(write=False)
        return self.result(newest, exchange, bool(answered >> self.index & 1)), self._commanded() != before

    def _commanded(self) -> bytes:
        """Return the mode and the last command."""
        return b"".join(self.row[of].tobytes() for of in _COMMANDED)

    # -- statistics --------------------------------------------------------------------------------

    def counts(self) -> dict[str, int]:
        """Return every fault that was seen, as "input fault", with how often."""
        state, found = self.state, {}
        inputs: list[tuple[str, JointInput | VectorInput]] = [("joint state", state.joint)]
        for kind, each in (("wrench", state.wrench_inputs), ("slip", state.slip_inputs)):
            inputs += [(kind if k == 0 else f"{kind} of contact {k}", each[k]) for k in range(self.contacts)]
        for name, of in inputs:
            for fault in Reason:
                if fault < SAMPLE_FAULTS and of.counts[fault]:
                    found[f"{name} {fault.name.lower()}"] = int(of.counts[fault])
        return found | dict(self._outside_counts)


def joint_sample(record: JointRecord, joints: int) -> JointSample:
    """Return a copy of the joint state in a record."""
    position, velocity, effort = (of[:joints].copy() for of in (record.position, record.velocity, record.effort))
    return JointSample(int(record.stamp_ns), position, velocity, effort)


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
        self._lockstep, self.config = controller.lockstep, controller.config
        self._governed_stream = governed_stream(controller.first.params)
        self.arms = tuple(ArmSession(self, name, k) for k, name in enumerate(controller.arms))
        pads = max(len(self.arms), self.arms[0].contacts)
        self.manifest: Manifest | None = None
        self.wrench_counts, self.slip_counts = [0] * pads, [0] * pads
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

    def config_of(self, index: int) -> Array:
        """Return the CONFIG of an arm."""
        return self.config[index * CONFIG_SIZE :][:CONFIG_SIZE]

    def configure(self, index: int, change: Callable[[Array], None]) -> None:
        """Change the CONFIG of an arm; sessions that share the controller keep theirs."""
        config = self.config.copy()
        change(config[index * CONFIG_SIZE :][:CONFIG_SIZE])
        if config.tobytes() != self.config.tobytes():
            config.setflags(write=False)
            self.config = config
            for arm in self.arms:
                arm.config = self.config_of(arm.index)

    # -- inputs of the object ----------------------------------------------------------------------

    def add_manifest(self, manifest: Manifest) -> None:
        """Take the list of what belongs to the current lockstep cycle: the pads' samples, in the order of the arms."""
        self.manifest = manifest

    def set_reference(self, reference: CartesianReference) -> None:
        """Use this reference from the next cycle on; governed, follow it as soon as friction admits.

        Of one arm it is that of the pad; of several that of the object's centre of mass, which every pad keeps to.

        Raises:
            InputError: numbers that no arm can follow, which are errors of a unit or a frame; nothing has changed then.
        """
        for what in ("position", "twist", "acceleration"):
            largest = float(np.abs(getattr(reference, what)).max())
            if math.isfinite(largest) and largest > MOST:
                raise InputError(f"reference: {what}", got=f"{largest:.3g}", expected=f"at most {MOST:g}")
        task = self.task
        task.taken += 1
        given: Any = task.reference
        if self._governed_stream:
            stream = task.stream
            if stream.queued == ROOM:
                for k in range(ROOM - 1):
                    stream.queue[k] = stream.queue[k + 1]
                stream.queued -= 1
            item = stream.queue[int(stream.queued)]
            item.stamp_ns, given = reference.stamp_ns, item.reference
            stream.queued += 1
        else:
            task.reference_known = 1
        of_pad = self._of_first_pad(reference)
        given.position, given.rotation = of_pad.position, of_pad.rotation
        given.twist, given.acceleration = of_pad.twist, of_pad.acceleration

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
        own = matrix_from_quat_xyzw(contacts.orientation_xyzw[:4])
        return product(rotation, np.array(contacts.position[:3])), product(rotation, own)

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
            targets.append(gain_report(wanted).gains)
            arm.refuse_overload(wanted)
        for arm, wanted, target in zip(self.arms, params, targets, strict=True):
            arm.ramp_to(wanted, target)

    # -- cycles ------------------------------------------------------------------------------------

    def cycle(self, now_ns: int = 0) -> Results:
        """Answer new joint states: of all arms, or in real time of those whose partners are silent; these hold.

        Args:
            now_ns: steady time; lockstep takes the stamps of the joint states.
        """
        if self._lockstep:
            for arm in self.arms:
                if not arm.complete():
                    return (None,) * len(self.arms)
            return self.answer(None)
        late = [arm for arm in self.arms if arm.waiting is None]
        if not late:
            return self.answer(now_ns)
        if len(late) == len(self.arms) == 1:
            return (None,)
        results = tuple([None if arm.waiting is not None else arm.watchdog(now_ns) for arm in self.arms])
        # A partner that is not silent is waited for, so that all are answered together.
        if len(late) == len(self.arms) or not all(arm.begun and arm.silent(now_ns) for arm in late):
            return results
        return tuple(own or result for own, result in zip(self.answer(now_ns), results, strict=True))

    def answer(self, now_ns: int | None) -> Results:
        """Run one cycle on the joint states that wait for it; an arm where none waits is not answered.

        now_ns: the controller's clock; None takes the stamps of the joint states.
        """
        exchange = self.new_exchange()
        joints = [arm.prepare(now_ns, exchange) for arm in self.arms]
        answered = cycle(self.config, self.buffer, exchange)
        for arm in self._taring:
            arm.use_tare()
        exchange.setflags(write=False)
        results: list[CycleResult | None] = []
        for arm, joint in zip(self.arms, joints, strict=True):
            commands = bool(answered >> arm.index & 1)
            results.append(None if joint is None else arm.result(joint, exchange, commands))
        return tuple(results)

    def new_exchange(self) -> Array:
        """Return INPUTS and OUTPUTS of all arms for a cycle, zeros."""
        return np.zeros(len(self.arms) * (INPUTS_SIZE + OUTPUTS_SIZE))

    def watchdog(self, now_ns: int) -> Results:
        """Answer arms whose joint states have stayed away for too long, and those that waited for them."""
        if self._lockstep:
            return (None,) * len(self.arms)
        return self.cycle(now_ns) if len(self.arms) > 1 else (self.arms[0].watchdog(now_ns),)

    def failed(self, now_ns: int) -> Results:
        """Go to FAULT with all arms because the node has failed; return commands where the law has begun."""
        return tuple(arm.failed(now_ns) for arm in self.arms)
