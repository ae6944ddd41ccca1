"""Input validation: what is wrong with a sample when it arrives, and with an input before a cycle uses it.

The clock is an argument: steady time in real time, the joint state's stamp in lockstep. Stamps are compared with stamps
only, arrival times with arrival times only.
"""

from __future__ import annotations

import math
from typing import Annotated

from slip_core.arrays import Array
from slip_core.cholesky import LARGEST
from slip_core.compiled import part
from slip_core.records import Real, Record, Records, Vec6, Whole, WholeArray, dtype_of
from slip_vic_controller.law.contact import StampedSlip
from slip_vic_controller.safety.conditions import SAMPLE_FAULTS, Reason
from slip_vic_controller.sizes import MAX_FRESH, Joints, WholeJoints

ACCEPT_AFTER = 5
"""Samples in a row that agree with each other after which a jump is a restart of the source."""
FUTURE_S, CLOCK_JUMP_S = 0.05, 0.2
"""By which a stamp may be ahead of the joint state's, and its step beyond the time that passed that is a jump [s]."""
JUMP, SLACK, FASTEST = 0.05, 0.5, 50.0
"""Of joint states: step of a position beyond what twice the velocities explain [rad], distance beyond a joint's stop
[rad] and multiple of its velocity limit at which one is rejected."""
ARM_MOVES = 0.02
"""[rad/s]"""
_LONGEST_COAST_S = 0.1  # for which a velocity explains a change of position
SPIKE, SPIKE_POSITION, ACCELERATES = 0.3, 5e-3, 100.0
"""Change of a joint velocity [rad/s], and way of a joint beyond that of its velocity [rad], in one sample, which
are none; beyond what a joint accelerates [rad/s^2]."""
_TWICE = 2  # stamps in a row that are ahead of the joint state's: one alone is the sample's own fault


class VectorLimits(Record):
    """Limits of a wrench or slip velocity."""

    age_ns: Whole
    frozen_ns: Whole
    future_ns: Whole  # how far a stamp may be ahead of the joint state's
    linear: Real  # N or m/s; magnitude above which a sample is absurd
    angular: Real  # N m or rad/s
    zero_is_normal: Whole  # whether zero may stay permanently, as a slip velocity does


class VectorInput(Record):
    """The newest good sample of a wrench or slip velocity, and the history of the input."""

    seen: Whole  # there was a good one
    known: Whole  # it still decides when the next one is out of order; a restart of the joint state's clock ends that
    stamp_ns: Whole
    arrival_ns: Whole
    values: Vec6  # N, N m or m/s, rad/s
    equal_since_ns: Whole  # stamp since when the values are equal to the last bit
    invalid: Whole  # whether the sensor reports it now
    ahead: Whole  # stamps in a row that are ahead of the joint state's
    refused: Whole  # Reason of the last one that was not finite or absurd
    refused_ns: Whole  # its arrival
    counts: Annotated[WholeArray, SAMPLE_FAULTS]  # how often each Reason was seen


class SlipQueue(Record):
    """Good slip samples since the last cycle, in order of arrival."""

    count: Whole
    samples: Annotated[Records[StampedSlip], MAX_FRESH]


SLIP_QUEUE = dtype_of(SlipQueue)


class JointLimits(Record):
    """Limits of the joint state: what is absurd, late or frozen."""

    lower: Joints  # rad
    upper: Joints  # rad
    fastest: Joints  # rad/s
    jump: Real  # rad; a step that no velocity has to explain
    clock_jump_ns: Whole
    age_ns: Whole
    frozen_ns: Whole
    still: Real  # rad/s; of joints that are read in steps: slower ones may read the same again and again
    accept_after: Whole  # samples that agree after a jump until it is taken as a restart


class JointRecord(Record):
    """A joint state."""

    stamp_ns: Whole
    position: Joints  # rad
    velocity: Joints  # rad/s
    effort: Joints  # N m


JOINT_SAMPLE = dtype_of(JointRecord)


class JointInput(Record):
    """The newest joint states, and the history of the input."""

    known: Whole
    arrival_ns: Whole  # of `last`
    last: JointRecord  # the newest good one
    candidate_known: Whole
    candidate_ns: Whole  # arrival of `candidate`
    candidate: JointRecord  # the newest after a jump
    agreeing: Whole  # candidates in a row that follow each other
    equal_since_ns: Whole  # arrival since when the values are equal to the last bit
    stands_since_ns: Whole  # stamp since when all positions of `last` are the same
    spikes: WholeJoints  # whether the velocity of `last` is not as measured
    position_spikes: WholeJoints  # whether its position is not
    without: Whole  # whether joint states have come without velocities from the first one on
    moves: Whole  # whether a joint moves
    pending: Whole  # whether a cycle has to answer `answers`
    pending_fault: Whole  # its Reason
    answers: JointRecord  # the one that the next cycle answers
    counts: Annotated[WholeArray, SAMPLE_FAULTS]  # how often each Reason was seen


@part
def usable(fault: int) -> bool:
    """Return whether a sample with this fault is used."""
    return bool(fault == Reason.NONE or fault == Reason.RESTARTED)


@part
def fine(fault: int) -> bool:
    """Return whether an input with this fault counts as good."""
    return bool(fault == Reason.NONE)


@part
def unanswered(fault: int) -> bool:
    """Return whether a joint state with this fault is dropped in real time."""
    return bool(fault == Reason.OUT_OF_ORDER or fault == Reason.DUPLICATE or fault == Reason.CLOCK_JUMP)


@part
def all_finite(values: Array) -> bool:
    """Return whether all numbers (k,) are finite and not beyond LARGEST."""
    for x in values:  # noqa: SIM110 - compiled code has no generators
        if not abs(x) <= LARGEST:
            return False
    return True


@part
def _finite(values: Array) -> bool:
    for x in values:  # noqa: SIM110 - compiled code has no generators
        if not math.isfinite(x):
            return False
    return True


@part
def _same(a: Array, b: Array) -> bool:
    """Return whether all bits are equal: 0 and -0 are not, as no frozen sensor changes a sign."""
    for i in range(a.shape[0]):  # noqa: SIM110 - compiled code has no generators
        if a[i] != b[i] or math.copysign(1.0, a[i]) != math.copysign(1.0, b[i]):
            return False
    return True


# -- wrench and slip velocity -------------------------------------------------------------------------


@part
def classify_vector(
    limits: VectorLimits, state: VectorInput, stamp_ns: int, values: Array, valid: bool, joint: JointInput,
) -> int:  # fmt: skip
    """Return the fault of a wrench or slip velocity (6,)."""
    if state.known != 0 and stamp_ns <= state.stamp_ns:
        return Reason.DUPLICATE.value if stamp_ns == state.stamp_ns else Reason.OUT_OF_ORDER.value
    if joint.known != 0 and stamp_ns > joint.last.stamp_ns + limits.future_ns:
        return Reason.FUTURE.value
    if not valid:
        return Reason.INVALID.value
    if not _finite(values):
        return Reason.NOT_FINITE.value
    linear = math.sqrt(values[0] * values[0] + values[1] * values[1] + values[2] * values[2])
    angular = math.sqrt(values[3] * values[3] + values[4] * values[4] + values[5] * values[5])
    if linear > limits.linear or angular > limits.angular:
        return Reason.ABSURD.value
    return Reason.NONE.value


@part
def receive_vector(
    limits: VectorLimits, state: VectorInput, stamp_ns: int, values: Array, valid: bool, refused: bool, now_ns: int,
    joint: JointInput,
) -> int:  # fmt: skip
    """Take a sample in; return its fault.

    Args:
        limits: of this input.
        state: of this input; changed.
        stamp_ns, values: the sample; (6,).
        valid: whether the sensor reports it.
        refused: whether the message itself was not what it should be.
        now_ns: arrival.
        joint: state of the joint state's input.
    """
    fault = Reason.REFUSED.value if refused else classify_vector(limits, state, stamp_ns, values, valid, joint)
    state.ahead = state.ahead + 1 if fault == Reason.FUTURE else 0
    if fine(fault):
        if state.known == 0 or not _same(values, state.values):
            state.equal_since_ns = stamp_ns
        state.seen, state.known, state.stamp_ns, state.arrival_ns = 1, 1, stamp_ns, now_ns
        state.values[:] = values
    elif fault == Reason.NOT_FINITE or fault == Reason.ABSURD:
        state.refused, state.refused_ns = fault, now_ns
    if fault == Reason.NONE:
        state.invalid = 0
    else:
        if fault == Reason.INVALID:
            state.invalid = 1
        state.counts[fault] += 1
    return int(fault)


@part
def queue_slip(queue: SlipQueue, stamp_ns: int, twist: Array) -> None:
    """Keep a good slip sample for the next cycle; where there are too many the oldest goes."""
    if queue.count == MAX_FRESH:
        for i in range(MAX_FRESH - 1):
            queue.samples[i] = queue.samples[i + 1]
        queue.count -= 1
    queue.samples[queue.count].stamp_ns = stamp_ns
    queue.samples[queue.count].twist[:] = twist
    queue.count += 1


@part
def rebase_vector(limits: VectorLimits, state: VectorInput, joint_stamp_ns: int) -> None:
    """Take the joint state's new clock: a sample ahead of it belongs to the old one."""
    if state.known != 0 and state.stamp_ns > joint_stamp_ns + limits.future_ns:
        state.known, state.arrival_ns, state.equal_since_ns, state.invalid, state.ahead = 0, 0, 0, 0, 0
        state.refused, state.refused_ns = Reason.SILENT.value, 0


@part
def vector_validity(limits: VectorLimits, state: VectorInput, now_ns: int, joint_stamp_ns: int, arm_moves: bool) -> int:
    """Return why the newest good sample does not count in a cycle."""
    if state.known == 0:
        return Reason.NEVER_SEEN.value
    if state.invalid != 0:
        return Reason.INVALID.value
    if state.ahead >= _TWICE or state.stamp_ns > joint_stamp_ns + limits.future_ns:
        # Two clocks that differ, or joint states that were long on their way: not to wait for the age limit.
        return Reason.FUTURE.value
    if now_ns - state.arrival_ns > limits.age_ns:
        # Silent is only who says nothing: "absurdly large" tells a user of an object that has been lost.
        recent = state.refused != 0 and now_ns - state.refused_ns <= limits.age_ns
        return state.refused if recent else Reason.SILENT.value
    if joint_stamp_ns - state.stamp_ns > limits.age_ns:
        return Reason.STALE.value
    if state.stamp_ns - state.equal_since_ns > limits.frozen_ns:
        stays = state.values.any() if limits.zero_is_normal != 0 else arm_moves
        if stays:
            return Reason.FROZEN.value
    return Reason.NONE.value


@part
def stays_away(fault: int) -> bool:
    """Return whether a fault of `vector_validity` is one of arrival: no good sample comes any more."""
    return bool(fault == Reason.SILENT or fault == Reason.NOT_FINITE or fault == Reason.ABSURD)


# -- joint state --------------------------------------------------------------------------------------


@part
def _copy_sample(to: JointRecord, stamp_ns: int, q: Array, qd: Array, effort: Array) -> None:
    n = q.shape[0]
    to.stamp_ns = stamp_ns
    to.position[:n] = q
    to.velocity[:n] = qd
    to.effort[:n] = effort


@part
def _shows(limits: JointLimits, q: Array, qd: Array, before: JointRecord, follows: bool, coast_s: float) -> int:
    """Return what the numbers of a joint state (n,), (n,) show; `before` is looked at where it `follows` one."""
    if not (_finite(q) and _finite(qd)):
        return Reason.NOT_FINITE.value
    found = Reason.NONE.value
    for j in range(q.shape[0]):
        speed = abs(qd[j])
        if not (limits.lower[j] <= q[j] <= limits.upper[j] and speed <= limits.fastest[j]):
            return Reason.ABSURD.value
        if follows and abs(q[j] - before.position[j]) > limits.jump + coast_s * max(speed, abs(before.velocity[j])):
            found = Reason.JUMP.value
    return found


@part
def _fastest(qd: Array) -> float:
    speed = 0.0
    for x in qd:
        speed = max(speed, abs(x))
    return speed


@part
def _repeats(limits: JointLimits, q: Array, qd: Array, before: JointRecord) -> bool:
    """Return whether a joint state says the same as the one before, though its joints are not read in steps."""
    n = q.shape[0]
    sticks = limits.still > 0.0 and _fastest(qd) <= limits.still
    return not sticks and _same(q, before.position[:n]) and _same(qd, before.velocity[:n])


@part
def _clock_fault(limits: JointLimits, passed_ns: int, waited_ns: int) -> int:
    """Return how a stamp does not follow another one, while `waited_ns` passed on the steady clock."""
    if passed_ns <= 0:
        if passed_ns <= -limits.clock_jump_ns:
            return Reason.CLOCK_JUMP.value
        return Reason.OUT_OF_ORDER.value if passed_ns < 0 else Reason.DUPLICATE.value
    return Reason.CLOCK_JUMP.value if passed_ns - waited_ns > limits.clock_jump_ns else Reason.NONE.value


@part
def classify_joints(
    limits: JointLimits, stamp_ns: int, q: Array, qd: Array, now_ns: int, before: JointRecord, before_ns: int,
    follows: bool,
) -> int:  # fmt: skip
    """Return what is wrong with a joint state in itself, or as one that follows another."""
    fault, coast_s = Reason.NONE.value, 0.0
    if follows:
        passed = stamp_ns - before.stamp_ns
        coast_s = 2.0 * min(passed * 1e-9, _LONGEST_COAST_S)
        fault = _clock_fault(limits, passed, now_ns - before_ns)
    shows = _shows(limits, q, qd, before, follows, coast_s)
    return shows if fault == Reason.NONE or (shows != Reason.NONE and shows != Reason.JUMP) else fault


@part
def replace_spikes(state: JointInput, stamp_ns: int, q: Array, qd: Array, follows: bool, blind: bool) -> None:
    """Replace what no effort has made: a position by the way of the last velocity, a velocity by what positions show.

    A velocity only where that is nearer to the last. The next one counts, whatever it is: where the joint was thrown,
    the positions show it at once.

    Args:
        state: of the joint state's input; changed.
        stamp_ns, q, qd: the sample; (n,) [rad], [rad/s], changed.
        follows: whether it follows the one before.
        blind: whether that showed nothing, so that a joint may be anywhere by now.
    """
    passed_s = 1e-9 * (stamp_ns - state.last.stamp_ns)
    # A driver that sends the same again and again shows the way of that time in one step.
    coast_s = min(1e-9 * (stamp_ns - state.stands_since_ns), _LONGEST_COAST_S)
    most = SPIKE_POSITION + ACCELERATES * passed_s * passed_s
    for j in range(q.shape[0]):
        way = abs(q[j] - state.last.position[j]) - coast_s * max(abs(qd[j]), abs(state.last.velocity[j]))
        off = follows and not blind and state.position_spikes[j] == 0 and way > most
        state.position_spikes[j] = 1 if off else 0
        q[j] = state.last.position[j] + passed_s * state.last.velocity[j] if off else q[j]
        change = abs(qd[j] - state.last.velocity[j])
        spike = follows and state.spikes[j] == 0 and change > SPIKE + ACCELERATES * passed_s
        state.spikes[j] = 1 if spike else 0
        if spike:
            shown = (q[j] - state.last.position[j]) / passed_s
            qd[j] = shown if abs(shown - state.last.velocity[j]) < change else qd[j]


@part
def not_sent(values: Array) -> bool:
    """Return whether none of the values (n,) is a number: a broadcaster's word for what drives do not measure."""
    for x in values:  # noqa: SIM110 - compiled code has no generators
        if not math.isnan(x):
            return False
    return True


@part
def derive_velocities(limits: JointLimits, state: JointInput, stamp_ns: int, q: Array, qd: Array) -> None:
    """Write the velocities that positions show, since the last ones that were others.

    Where all are the same the last velocities last, because a driver sends again what it has read; of encoders that are
    read in steps they are zero.

    Args:
        limits: of the joint state.
        state: of the joint state's input.
        stamp_ns, q: the sample; (n,) [rad].
        qd: changed; (n,) [rad/s].
    """
    n = q.shape[0]
    repeats = _same(q, state.last.position[:n])
    passed_s = 1e-9 * (stamp_ns - state.stands_since_ns)
    for j in range(n):
        shown = (q[j] - state.last.position[j]) / passed_s
        shown = min(max(shown, -limits.fastest[j]), limits.fastest[j])
        kept = state.last.velocity[j] if limits.still == 0.0 else 0.0
        qd[j] = kept if repeats else shown


@part
def receive_joints(
    limits: JointLimits, state: JointInput, stamp_ns: int, q: Array, qd: Array, effort: Array, refused: bool,
    now_ns: int, one_source: bool, blind: bool,
) -> int:  # fmt: skip
    """Take a joint state in; return its fault. RESTARTED is good, and everything before it is discarded.

    Args:
        limits: of the joint state.
        state: of the joint state's input; changed.
        stamp_ns, q, qd, effort: the sample; (n,) [rad], [rad/s], [N m]; what is a spike is replaced, and velocities
            that no joint state has had are derived.
        refused: whether the message itself was not what it should be.
        now_ns: arrival.
        one_source: whether nobody else publishes joint states of this arm.
        blind: whether the last ones showed nothing, so that the model had the arm.
    """
    if refused:
        state.counts[Reason.REFUSED] += 1
        return Reason.REFUSED.value
    follows = state.known != 0
    state.without = 1 if (state.without != 0 or not follows) and not_sent(qd) else 0
    if state.without != 0:
        qd[:] = state.last.velocity[: qd.shape[0]]
    fault = classify_joints(limits, stamp_ns, q, qd, now_ns, state.last, state.arrival_ns, follows)
    moves, repeats = _fastest(qd) > ARM_MOVES, follows and _repeats(limits, q, qd, state.last)
    if fault == Reason.JUMP and one_source and now_ns - state.arrival_ns > limits.age_ns:
        # Nobody has seen where the arm went in the meantime: efforts for the old posture would kick it.
        fault = Reason.RESTARTED.value
    if fault == Reason.CLOCK_JUMP or fault == Reason.JUMP:
        again = fault
        if state.candidate_known != 0:
            again = classify_joints(limits, stamp_ns, q, qd, now_ns, state.candidate, state.candidate_ns, True)
        if again != Reason.DUPLICATE and again != Reason.OUT_OF_ORDER:  # twice or late: neither agrees
            state.agreeing = state.agreeing + 1 if fine(again) else 1
            state.candidate_known, state.candidate_ns = 1, now_ns
            _copy_sample(state.candidate, stamp_ns, q, qd, effort)
        if state.agreeing >= limits.accept_after:
            fault = Reason.RESTARTED.value
    if fault != Reason.NONE:
        state.counts[fault] += 1
    if usable(fault):
        goes_on = follows and fault != Reason.RESTARTED
        replace_spikes(state, stamp_ns, q, qd, goes_on, blind)
        if state.without != 0 and goes_on:
            derive_velocities(limits, state, stamp_ns, q, qd)
        elif state.without != 0:
            qd[:] = 0.0
        if not repeats:
            state.equal_since_ns = now_ns
        if not goes_on or not _same(q, state.last.position[: q.shape[0]]):
            state.stands_since_ns = stamp_ns
        state.moves = 1 if moves else 0
        _copy_sample(state.last, stamp_ns, q, qd, effort)
        state.known, state.arrival_ns, state.candidate_known, state.agreeing = 1, now_ns, 0, 0
    return fault


@part
def take_replaced(state: JointInput, stamp_ns: int, q: Array, qd: Array, now_ns: int) -> None:
    """Let the joint states go on with one that could not be used: what comes next follows where the model has the arm.

    Args:
        state: of the joint state's input; changed.
        stamp_ns: of the joint state.
        q, qd: where the model has the joints, and how fast [rad], [rad/s].
        now_ns: the controller's clock.
    """
    state.last.stamp_ns, state.stands_since_ns, state.arrival_ns = stamp_ns, stamp_ns, now_ns
    state.last.position[:], state.last.velocity[:] = q, qd


@part
def await_answer(state: JointInput, stamp_ns: int, q: Array, qd: Array, effort: Array, fault: int) -> None:
    """Let the next cycle answer this joint state; one that was not answered yet is skipped, the newest wins."""
    if state.pending != 0 and state.pending_fault == Reason.RESTARTED and usable(fault):
        fault = Reason.RESTARTED.value
    _copy_sample(state.answers, stamp_ns, q, qd, effort)
    state.pending, state.pending_fault = 1, fault


@part
def silent(limits: JointLimits, state: JointInput, now_ns: int) -> bool:
    """Return whether no good joint state has come for the age limit."""
    return bool(state.known != 0 and now_ns - state.arrival_ns > limits.age_ns)


@part
def frozen(limits: JointLimits, state: JointInput, now_ns: int) -> bool:
    """Return whether the values have been equal to the last bit for longer than measured ones can while moving."""
    return bool(state.known != 0 and now_ns - state.equal_since_ns > limits.frozen_ns)


@part
def forget_repeats(wrenches: Records[VectorInput]) -> None:
    """Count from now on for how long values have been equal: a user says that they are right."""
    for k in range(len(wrenches)):
        wrenches[k].equal_since_ns = wrenches[k].stamp_ns
