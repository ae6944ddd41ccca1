"""The controller between cycles: parameters, Pinocchio's call, samples in and results out; `cycle` does the rest.

The node, the in-process loop, bag replay and the fault campaign all run this same class.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from slip_core.arrays import Array, readonly
from slip_core.errors import InputError
from slip_core.params import flatten
from slip_core.records import new, place, record
from slip_core.types import (
    CartesianReference,
    DisplacementSample,
    EffortCommand,
    JointSample,
    PoseGoal,
    SlipSample,
    WrenchSample,
)
from slip_vic_controller.arrival import is_silent, receive_joint_state, receive_slip, receive_wrench
from slip_vic_controller.config import governed_stream, make_config
from slip_vic_controller.cycle import CONFIG, INPUTS, OUTPUTS, STATE, STATE_SIZE, cycle, watchdog
from slip_vic_controller.cycle import describe as describe_cycle
from slip_vic_controller.governing import GOVERNED
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
from slip_vic_controller.safety.validation import mean_period_s
from slip_vic_controller.sizes import MAX_FRESH
from slip_vic_controller.slip_displacement import SlipFromDisplacement

RETUNABLE = ("gains.", "object.", "contacts.position", "safety.hold_stiffness")
"""Parameters that ramp while the law runs."""

NO_EFFORT = readonly(np.zeros(0))

# Looked up in every cycle, by number: to make an enum's member of one, or to hash it, takes longer.
_FAULTS, _MODES = tuple(Fault), tuple(Mode)
_GOOD = tuple(fault in (Fault.NONE, Fault.DENORMAL, Fault.RESTARTED, Fault.NOT_RUN) for fault in Fault)
_ARM, _EFFORT, _LEDGER = place(INPUTS, "arm"), place(OUTPUTS, "effort"), place(OUTPUTS, "ledger")
_ANSWERED, _MODE = place(OUTPUTS, "answered").start, place(OUTPUTS, "mode.mode").start
_OK, _CAUSE = place(OUTPUTS, "ok").start, place(OUTPUTS, "mode.reason").start
_REASON = slice(_CAUSE, _CAUSE + 3)
_GOVERNED, _GOVERNED_NAMES = place(OUTPUTS, "governor"), GOVERNED.names or ()
_GRIP = place(OUTPUTS, "grip").start
_PATH_SCALE = place(OUTPUTS, "path_scale").start
_NOW, _REQUEST, _MISSING = (place(INPUTS, name).start for name in ("now_ns", "request", "missing"))
_RAMP = place(STATE, "law.ramp")
_CYCLES, _LAW_KNOWN = place(STATE, "cycles").start, place(STATE, "law.known").start
_STATE_MODE, _PENDING = place(STATE, "mode.mode").start, place(STATE, "joint.pending").start


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


class Controller:
    """A controller's configuration: parameters, arm, and the record of the cycle. Sessions may share it.

    Args:
        params: checked parameters.
        urdf_text: the arm; gives kinematics, dynamics and limits.
        lockstep: whether to wait for exactly the samples the bridge lists, and to take its stamps as the clock.

    Raises:
        InputError: the parameters and the URDF do not fit.
    """

    def __init__(self, params: ControllerParams, urdf_text: str, *, lockstep: bool) -> None:
        self.params, self.lockstep = params, lockstep
        self.robot = Robot(urdf_text, params.ee_frame, params.joint_names, params.gravity)
        self.report = gain_report(params)
        self.config = make_config(params, self.robot, lockstep=lockstep)
        self.gains = make_law_gains(params, self.report.used)
        self.contacts = len(params.contacts.position) // 3
        self.external = params.trajectory.kind in ("topic", "goal")
        self.rows = capacity(params) if params.slip_estimator == "observer" else 0

    def new_state(self) -> Array:
        """Return the state before the first cycle."""
        state = np.zeros(STATE_SIZE + self.rows * ROW_SIZE)
        record(state[:STATE_SIZE], STATE).tuned = steady(self.gains).view(RAMP)[0]
        return state


class CycleResult:
    """One answered cycle; an empty effort means "no command": an input has never been seen.

    joint: the joint state; command; mode; inputs, outputs: its records.
    """

    __slots__ = ("_controller", "command", "inputs", "joint", "mode", "outputs")

    def __init__(self, controller: Controller, joint: JointSample, inputs: Array, outputs: Array) -> None:
        self._controller, self.joint, self.inputs, self.outputs = controller, joint, inputs, outputs
        outputs.setflags(write=False)
        whole = outputs.view(np.int64)
        self.mode = _MODES[whole[_MODE]]
        effort = outputs[_EFFORT][: len(controller.robot.joint_names)] if whole[_ANSWERED] else NO_EFFORT
        self.command = EffortCommand(joint.stamp_ns, effort)

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

    def scalars(self) -> dict[str, float]:
        """Return the numbers worth plotting, with the same names in every cycle; NaN where there is none."""
        names, places = published(len(self._controller.robot.joint_names))
        symbols = new(SYMBOLS)
        describe_cycle(self._controller.config, self.inputs, self.outputs, symbols)
        numbers = dict(zip(names, symbols[places].tolist(), strict=True))
        params = self._controller.params
        if params.governor.mode != "off" or params.trajectory.kind == "goal":
            numbers |= zip(_GOVERNED_NAMES, self.outputs[_GOVERNED].tolist(), strict=True)
        return numbers


class ControllerSession:
    """Runs the control cycle whenever a set of inputs is complete.

    Args:
        controller: parameters and arm.
    """

    def __init__(self, controller: Controller) -> None:
        self.controller = controller
        self.contacts = controller.contacts
        self.buffer = controller.new_state()
        self.active = True
        self._lockstep, self._config = controller.lockstep, controller.config
        self._joints = len(controller.robot.joint_names)
        self._governed_stream = governed_stream(controller.params)
        self._slip_delay_ns = int(record(controller.config, CONFIG).cycle.slip_delay_ns)
        self._state = record(self.buffer[:STATE_SIZE], STATE)
        self._whole = self.buffer.view(np.int64)
        self._joint: JointSample | None = None
        self._joint_fault = Fault.NONE
        self._manifest: Manifest | None = None
        self._counts = [0] * (2 * self.contacts)
        self._displacements = [SlipFromDisplacement() for _ in range(self.contacts)]
        self._request = Request.NONE
        self._tuned: ControllerParams | None = None
        self._outside_counts: Counter[str] = Counter()

    @property
    def state(self) -> Any:
        """What the controller remembers, by name."""
        return self._state

    @property
    def reference_from_topic(self) -> bool:
        """Whether the reference comes from outside instead of the built-in trajectory."""
        return self.controller.params.trajectory.kind == "topic"

    @property
    def mode(self) -> Mode:
        """The mode of the last cycle."""
        return _MODES[self._whole[_STATE_MODE]]

    @property
    def reason(self) -> str:
        """Why the controller is in its mode, in words."""
        return describe(self._state.mode.reason, self.controller.robot.joint_names)

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
        return readonly(self._state.law.gravity[: self._joints])

    @property
    def tuned(self) -> ControllerParams:
        """The parameters that are in effect, or that gains and payload ramp to."""
        return self._tuned or self.controller.params

    @property
    def newest_joint(self) -> JointSample | None:
        """The last good joint state."""
        joint, n = self._state.joint, self._joints
        if not joint.known:
            return None
        last = joint.last
        return JointSample(
            int(last.stamp_ns), last.position[:n].copy(), last.velocity[:n].copy(), last.effort[:n].copy()
        )

    # -- samples -----------------------------------------------------------------------------------

    def add_joint(self, sample: JointSample, now_ns: int | None = None) -> None:
        """Take a joint state; one that was never answered is skipped, newest wins. `now_ns`: steady time of arrival."""
        n, q, qd, effort = self._joints, sample.position, sample.velocity, sample.effort
        refused = q.shape != (n,) or qd.shape != (n,)
        if refused or effort.shape != (n,):
            effort = np.full(n, np.nan)
        if refused:
            q = qd = effort
        now_ns = sample.stamp_ns if now_ns is None else now_ns
        fault = receive_joint_state(
            self._config, self.buffer, sample.stamp_ns, q, qd, effort, refused, now_ns, self._lockstep
        )
        if self._whole[_PENDING]:
            self._joint, self._joint_fault = sample, _FAULTS[fault]

    def add_wrench(self, contact: int, sample: WrenchSample, now_ns: int | None = None) -> None:
        """Take a wrench of one contact."""
        self._counts[2 * contact] += 1
        refused = sample.wrench.shape != (6,)
        wrench = _NO_VECTOR if refused else sample.wrench
        now_ns = sample.stamp_ns if now_ns is None else now_ns
        receive_wrench(self._config, self.buffer, contact, sample.stamp_ns, wrench, refused, now_ns)

    def add_slip(self, contact: int, sample: SlipSample, now_ns: int | None = None) -> None:
        """Take a slip velocity of one contact."""
        self._counts[2 * contact + 1] += 1
        refused = sample.twist.shape != (6,)
        twist = _NO_VECTOR if refused else sample.twist
        now_ns = sample.stamp_ns if now_ns is None else now_ns
        receive_slip(self._config, self.buffer, contact, sample.stamp_ns, twist, sample.valid, refused, now_ns)

    def add_displacement(self, contact: int, sample: DisplacementSample, now_ns: int | None = None) -> None:
        """Take where the pad of one contact is on the object; from the second one on it gives slip velocities."""
        slip = self._displacements[contact](sample)
        if slip is None:
            self._counts[2 * contact + 1] += 1
        else:
            self.add_slip(contact, slip, sample.stamp_ns if now_ns is None else now_ns)

    def add_manifest(self, manifest: Manifest) -> None:
        """Take the list of what belongs to the current lockstep cycle."""
        self._manifest = manifest

    def set_reference(self, reference: CartesianReference) -> None:
        """Use this reference from the next cycle on; governed, follow it as soon as friction admits."""
        given = self._state.reference
        self._state.taken += 1
        if self._governed_stream:
            stream = self._state.stream
            if stream.queued == QUEUED:
                for k in range(QUEUED - 1):
                    stream.queue[k] = stream.queue[k + 1]
                stream.queued -= 1
            item = stream.queue[int(stream.queued)]
            item.stamp_ns, given = reference.stamp_ns, item.reference
            stream.queued += 1
        else:
            self._state.reference_known = 1
        given.position, given.rotation = reference.position, reference.rotation
        given.twist, given.acceleration = reference.twist, reference.acceleration

    def set_goal(self, goal: PoseGoal) -> None:
        """Come to rest at this pose; the next cycle begins it, waits until the pad is at rest, or refuses it."""
        state = self._state.goal
        state.received, state.pending = state.received + 1, 1
        state.to_position, state.to_rotation, state.duration = goal.position, goal.rotation, goal.duration_s
        self._state.taken += 1

    def set_publishers(self, counts: Mapping[str, int], own_topic_publishers: int) -> None:
        """Take how many publishers each input topic has, and how many our command topic has."""
        before, twice = self._state.outside, [name for name, count in counts.items() if count > 1]
        outside = Fault.SECOND_PUBLISHER if twice else Fault.NONE
        if own_topic_publishers > 1:
            outside = Fault.FOREIGN_COMMAND
        self._state.outside = int(outside)
        if outside not in (before, Fault.NONE):
            self._outside_counts[f"{', '.join(twice) or 'effort command'} {outside.name.lower()}"] += 1

    # -- requests and parameters -------------------------------------------------------------------

    def set_active(self, active: bool) -> None:
        """Start anew, or answer without effort until then; a fault stays."""
        self.active, self._state.law.known = active, 0

    def request(self, request: Request) -> None:
        """Ask for a mode; the next cycle decides."""
        self._request = request

    def retune(self, params: ControllerParams) -> None:
        """Let gains and payload ramp to those of `params`, and HOLD have its stiffness, from the next cycle on.

        Raises:
            InputError: the values are refused as a whole, or something else has changed; nothing has happened then.
        """
        now, wanted = flatten(self.tuned), flatten(params)
        for name, value in wanted.items():
            if value != now[name] and not name.startswith(RETUNABLE):
                raise InputError(
                    f"parameter {name}", got=value, expected=f"{now[name]!r} while the law runs", fix="restart the node"
                )
        target = make_law_gains(params, gain_report(params).used)
        least_s, law = params.gains.ramp_s, self._state.law
        self._state.tuned = make_ramp(self.controller.gains, target, 0, least_s).view(RAMP)[0]
        if law.known:
            start = new(LAW_GAINS)
            sample_gains(self.buffer[_RAMP], int(law.stamp_ns), start)
            law.ramp = make_ramp(start, target, int(law.stamp_ns), least_s).view(RAMP)[0]
        self.know(params)

    # -- cycles ------------------------------------------------------------------------------------

    def complete(self) -> bool:
        """Return whether a cycle can be answered: a joint state, and in lockstep all that belongs to its stamp.

        Lockstep answers every cycle, also one whose other inputs are still missing.
        """
        if self._joint is None:
            return False
        if not self._lockstep:
            return True
        manifest = self._manifest
        return (
            manifest is not None
            and manifest.stamp_ns == self._joint.stamp_ns
            and manifest.wrench_counts == tuple(self._counts[0::2])
            and manifest.slip_counts == tuple(self._counts[1::2])
        )

    def cycle(self, now_ns: int | None = None) -> CycleResult | None:
        """Answer the collected inputs, or return None where the set is not complete yet.

        Args:
            now_ns: steady time; None, and lockstep, take the joint state's stamp.
        """
        if not self.complete():
            return None
        joint = self._joint
        assert joint is not None
        now = joint.stamp_ns if now_ns is None or self._lockstep else now_ns
        return self.answer(joint, self._joint_fault, now, 0 if self.active else ACTIVATION, None)

    def answer(self, joint: JointSample, fault: Fault, now_ns: int, missing: int, health: Health | None) -> CycleResult:
        """Run one cycle on the joint state that waits for it.

        Args:
            joint, fault: that joint state.
            now_ns: the controller's clock.
            missing: bits of what is missing beside inputs that were never seen.
            health: of the inputs, of a replay; None = found by input validation.
        """
        inputs, outputs = self.prepare(joint, fault, now_ns, missing, health)
        cycle(self._config, self.buffer, inputs, outputs)
        return CycleResult(self.controller, joint, inputs, outputs)

    @property
    def waiting(self) -> tuple[JointSample, Fault] | None:
        """The joint state that waits for its cycle, and its fault."""
        return None if self._joint is None else (self._joint, self._joint_fault)

    def prepare(
        self, joint: JointSample, fault: Fault, now_ns: int, missing: int, health: Health | None
    ) -> tuple[Array, Array]:
        """Return inputs and empty outputs of a cycle; arguments as of `answer`."""
        self._joint = self._manifest = None
        inputs, outputs = self._records(now_ns, missing)
        if health is not None:
            given = record(inputs, INPUTS)
            given.health_given, given.health = 1, tuple(int(part) for part in health)
        if _GOOD[fault]:
            self.controller.robot.terms(joint.position, joint.velocity, inputs[_ARM])
        return inputs, outputs

    def give(
        self,
        joint: JointSample,
        wrenches: Sequence[WrenchSample],
        slips: Sequence[SlipSample | None],
        new_slips: Sequence[SlipSample],
        now_ns: int,
    ) -> None:
        """Put the samples of the next cycle in place as a replay names them, past input validation.

        Args:
            joint: the joint state that it answers.
            wrenches, slips: the newest of each contact; none where the run waited for them.
            new_slips: of the own contact, since the cycle before.
            now_ns: the controller's clock.
        """
        self.add_joint(joint, now_ns)  # what it knows of the joint state (frozen, restarted) goes on
        state, n = self._state, self._joints
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

    def watchdog(self, now_ns: int) -> CycleResult | None:
        """Return a command where joint states have stayed away for too long, None where all is well.

        On the steady clock, so that it bites when every other clock stands still. It repeats until the effort has come
        down to gravity compensation; the bridge's command timeout does the rest.
        """
        if not self.active or self._lockstep or not self.begun or self.mode == Mode.WAITING_INPUT:
            return None
        if not is_silent(self._config, self.buffer, now_ns):
            return None
        newest = self.newest_joint
        assert newest is not None  # silent is only who has spoken
        before = self.buffer.copy()
        result, changed = self.without_joint_state(newest, now_ns)
        if not changed:
            self.buffer[:] = before
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
        inputs, outputs = self._records(now_ns, 0)
        changed = watchdog(self._config, self.buffer, inputs, outputs)
        return CycleResult(self.controller, newest, inputs, outputs), bool(changed)

    def _records(self, now_ns: int, missing: int) -> tuple[Array, Array]:
        inputs, outputs = new(INPUTS), new(OUTPUTS)
        whole = inputs.view(np.int64)
        whole[_NOW], whole[_REQUEST], whole[_MISSING] = now_ns, self._request, missing
        self._request = Request.NONE
        return inputs, outputs

    # -- snapshots ---------------------------------------------------------------------------------

    def snapshot(self) -> Array:
        """Return all with which the next cycle begins; its bytes are equal where the controller goes on equally."""
        state = self.buffer.copy()
        observer = record(state[:STATE_SIZE], STATE).observer
        rows = state[STATE_SIZE:].reshape(-1, ROW_SIZE)
        if len(rows):
            used = (observer.first + np.arange(observer.rows)) % len(rows)
            unused = np.ones(len(rows), dtype=bool)
            unused[used] = False
            rows[unused] = 0.0
        return state

    def restore(self, state: Array) -> None:
        """Go on from a snapshot.

        Raises:
            InputError: it is of another size.
        """
        if state.shape != self.buffer.shape:
            raise InputError("controller state", got=f"{state.size} numbers", expected=f"{self.buffer.size}")
        self.buffer[:] = state

    def know(self, params: ControllerParams) -> None:
        """Take parameters that were set before the state which `restore` was given: their ramp is part of it."""
        self._tuned = params
        if params.safety.hold_stiffness != record(self._config, CONFIG).hold.stiffness:
            self._config = self._config.copy()
            record(self._config, CONFIG).hold.stiffness = params.safety.hold_stiffness
            self._config.setflags(write=False)

    # -- statistics --------------------------------------------------------------------------------

    def counts(self) -> dict[str, int]:
        """Return every fault that was seen, as "input fault", with how often."""
        state, found = self._state, {}
        inputs = [("joint state", state.joint)]
        for kind, each in (("wrench", state.wrench_inputs), ("slip", state.slip_inputs)):
            inputs += [(kind if k == 0 else f"{kind} of contact {k}", each[k]) for k in range(self.contacts)]
        for name, of in inputs:
            for fault in Fault:
                if of.counts[fault]:
                    found[f"{name} {fault.name.lower()}"] = int(of.counts[fault])
        return found | dict(self._outside_counts)

    def rates(self) -> dict[str, tuple[float, float]]:
        """Return mean period and jitter [s] of the inputs that have come at least twice."""
        state = self._state
        inputs = {"joint_states": state.joint, "wrench": state.wrench_inputs[0], "slip_velocity": state.slip_inputs[0]}
        rates = {name: (mean_period_s(of.rate), float(of.rate.jitter_s)) for name, of in inputs.items()}
        return {name: rate for name, rate in rates.items() if not math.isnan(rate[0])}


_NO_VECTOR = readonly(np.full(6, np.nan))
