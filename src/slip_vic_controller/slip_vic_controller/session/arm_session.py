"""One arm between cycles: samples in, Pinocchio's call, results out."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from slip_core.arrays import Array, readonly
from slip_core.records import new, place, record
from slip_core.types import DisplacementSample, JointSample, SlipSample, WrenchSample
from slip_vic_controller.arm.joint_estimate import JointRecord
from slip_vic_controller.config.controller import renew_config, use_noise
from slip_vic_controller.config.joints import with_measured_noise
from slip_vic_controller.contact.layouts import ROW_SIZE
from slip_vic_controller.cycle.cycle import cycle
from slip_vic_controller.interfaces import SlipFromDisplacement
from slip_vic_controller.law.gains import LAW_GAINS, RAMP, make_ramp, sample_gains
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.safety.conditions import SAMPLE_FAULTS, Missing, Reason, describe
from slip_vic_controller.safety.modes import Mode, Request
from slip_vic_controller.safety.validation import JointInput, VectorInput, unanswered
from slip_vic_controller.session.arrival import (
    begin_answer,
    is_silent,
    receive_joint_state,
    receive_slip,
    receive_wrench,
)
from slip_vic_controller.session.cycle_result import NO_NUMBERS, CycleResult, Health
from slip_vic_controller.sizes import ROOM
from slip_vic_controller.state import (
    ARM_SIZE,
    ARM_STATE,
    CONFIG,
    INPUTS,
    INPUTS_SIZE,
    OUTPUTS_SIZE,
    TASK_SIZE,
    ArmState,
    CycleInputs,
)

if TYPE_CHECKING:  # the session over all arms makes this one, and each calls the other
    from slip_vic_controller.session.session import ControllerSession

# Looked up in every cycle, by number: to make an enum's member of one, or to hash it, takes longer.
_MODES = tuple(Mode)
_UNANSWERED = tuple(unanswered(fault) for fault in range(SAMPLE_FAULTS))
_ARM = place(INPUTS, "arm")
_COMMANDED = [place(ARM_STATE, name) for name in ("mode", "sent.effort", "sent.velocity")]
_RAMP = place(ARM_STATE, "law.ramp")
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
        rows = session.controller.rows
        begin = TASK_SIZE + len(session.controller.arms) * ARM_SIZE + index * rows * ROW_SIZE
        self.history = session.buffer[begin : begin + rows * ROW_SIZE]
        self.state: ArmState = record(self.row, ARM_STATE)
        given = len(session.controller.arms) * INPUTS_SIZE
        self._inputs = slice(index * INPUTS_SIZE, (index + 1) * INPUTS_SIZE)
        self._outputs = slice(given + index * OUTPUTS_SIZE, given + (index + 1) * OUTPUTS_SIZE)
        self.config = session.config_of(index)
        self.routes: tuple[tuple[tuple[ArmSession, int], ...], ...] = ()
        self.waiting: Waiting | None = None
        self.overdue = False  # its own next joint state has come while one waited for another arm
        self._lockstep = self.controller.lockstep
        self._joints = len(self.controller.robot.joint_names)
        self._answers = [self.row[first : first + self._joints] for first in _ANSWERS]
        self._slip_delay_ns = int(record(self.config, CONFIG).slip_delay_ns)
        self._has_wrench = self.controller.params.wrench.source == "sensor"
        self._estimates = bool(record(self.config, CONFIG).estimator.on)
        self._tared = 0
        self._whole = self.row.view(np.int64)
        self._displacements = [SlipFromDisplacement() for _ in range(self.contacts)]
        self._request = int(Request.NONE)  # numbers: members of an enum are slow to pass on
        self._tuned: ControllerParams | None = None
        self._outside_counts: Counter[str] = Counter()

    @property
    def estimated_joints(self) -> tuple[str, ...]:
        """Names of the joints whose state is estimated; none where the samples are used as they are."""
        return self.controller.robot.joint_names if self._estimates else ()

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
        if self._lockstep or not _UNANSWERED[fault]:
            self.overdue = self.waiting is not None
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

    def ramp_to(self, params: ControllerParams, target: Array) -> None:
        """Let gains and payload ramp to those of `params`, whose LAW_GAINS is `target`."""
        law = self.state.law
        moved = np.subtract(params.contacts.position[:3], self.tuned.contacts.position[:3])
        # The object seems to move as its contact is shifted, and the law follows it.
        least_s = max(params.gains.ramp_s, float(np.linalg.norm(moved)) / params.safety.limits.speed_linear)
        if params.object != self.tuned.object:
            self.state.tare.mass_share = 0.0  # what a user gives counts
        self.state.tuned = make_ramp(self.controller.gains, target, 0, least_s).view(RAMP)[0]
        if law.known:
            start = new(LAW_GAINS)
            sample_gains(self.row[_RAMP], int(law.stamp_ns), start)
            law.ramp = make_ramp(start, target, int(law.stamp_ns), least_s).view(RAMP)[0]
        self._tuned = params
        self._session.configure(self.index, lambda config: renew_config(config, params))

    def use_tare(self) -> None:
        """Use the noise that a tare has measured, and what is configured until then."""
        measured = int(self._whole[_ROUGHLY]) + 2 * int(self._whole[_TARED])
        if measured != self._tared:
            self._tared = measured
            params = with_measured_noise(self.tuned, self.state.tare) if measured else self.tuned
            limit = self.controller.robot.effort_limit
            self._session.configure(self.index, lambda config: use_noise(config, params, limit))
            self._estimates = bool(record(self.config, CONFIG).estimator.on)

    # -- cycles ------------------------------------------------------------------------------------

    def complete(self) -> bool:
        """Return whether a cycle can be answered: a joint state, and in lockstep all that belongs to its stamp.

        Lockstep answers every cycle, also one whose other inputs are still missing.
        """
        waiting, session, manifest = self.waiting, self._session, self._session.manifest
        if waiting is None or not self._lockstep:
            return waiting is not None
        return (
            manifest is not None
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
        self.overdue = False
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
        newest = self.newest_joint
        if not self._is_at_work or newest is None:
            return None
        return self.without_joint_state(newest.stamp_ns if self._lockstep else now_ns)[0]

    @property
    def _is_at_work(self) -> bool:
        return self._session.active and self.begun and self.mode != Mode.WAITING_INPUT

    def without_joint_state(self, now_ns: int) -> tuple[CycleResult, bool]:
        """Run a cycle on the last good joint state; return its result, and whether effort or mode have changed."""
        exchange, newest, before = self._session.new_exchange(), self.newest_joint, self._commanded()
        assert newest is not None  # an arm that has begun has sent
        given: CycleInputs = record(exchange[self._inputs], INPUTS)
        given.present, given.now_ns, given.request = 1, now_ns, self.take_request()
        self.state.joint.pending_fault = int(Reason.SILENT)
        answered = cycle(self._session.config, self._session.buffer, exchange)
        exchange.setflags(write=False)
        return self.result(newest, exchange, bool(answered >> self.index & 1)), self._commanded() != before

    def _commanded(self) -> bytes:
        """Return the mode, and what has been commanded last."""
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
