"""Input validation: what is wrong with a sample on arrival, and with an input before a cycle uses it.

The clock is an argument: steady time in real time, the joint state's stamp in lockstep. Stamps are compared with stamps
only, arrival times with arrival times only. A single wrong sample of a joint moves no effort by more than the effort
limiter's slope allows in one cycle.
"""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np

from slip_core.arrays import Array
from slip_core.cholesky import all_finite
from slip_core.compiled import part
from slip_core.records import Real, Record, Records, Vec6, Whole, WholeArray
from slip_core.vectors import spatial
from slip_vic_controller.arm.estimator import MOVES, JointRecord
from slip_vic_controller.law.contact import StampedSlip
from slip_vic_controller.safety.conditions import SAMPLE_FAULTS, Reason
from slip_vic_controller.sizes import ROOM, Joints

ACCEPT_AFTER = 5
"""Samples in a row that agree with each other after which a jump is a restart of the source."""
CLOCK_JUMP_NS = 200_000_000
"""Step of a joint state's stamp beyond the time that passed that is a jump."""
JUMP, SLACK = 0.05, 0.5
"""Of joint states: step of a position beyond what twice the velocities explain, and distance beyond a joint's stop, or
between two control periods by its velocity, at which one is rejected [rad]."""


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
    fault: Whole  # Reason of the newest sample, good or not
    fault_ns: Whole  # its arrival
    bad: Whole  # samples in a row that have one
    counts: Annotated[WholeArray, SAMPLE_FAULTS]  # how often each Reason was seen


class SlipQueue(Record):
    """Good slip samples since the last cycle, in order of arrival."""

    count: Whole
    samples: Annotated[Records[StampedSlip], ROOM]


class JointLimits(Record):
    """Limits from which a joint state is absurd, late or frozen."""

    lower: Joints  # rad
    upper: Joints  # rad
    fastest: Real  # rad/s
    age_ns: Whole  # also of a pause of the controller itself that is too long
    frozen_ns: Whole
    still: Real  # rad/s; of joints that are read in steps: slower ones may read the same again and again
    accept_after: Whole  # samples that agree after a jump until it is taken as a restart


class JointInput(Record):
    """The newest joint states, and the history of the input."""

    known: Whole
    arrival_ns: Whole  # of `last`
    last: JointRecord  # the newest good one
    agreeing: Whole  # samples in a row after a jump that follow each other
    candidate_ns: Whole  # arrival of `candidate`
    candidate: JointRecord  # the newest of them
    equal_since_ns: Whole  # arrival since when the values are equal to the last bit
    stands_since_ns: Whole  # stamp since when all positions of `last` are the same
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
def unanswered(fault: int) -> bool:
    """Return whether a joint state with this fault is dropped in real time."""
    return bool(fault == Reason.OUT_OF_ORDER or fault == Reason.CLOCK_JUMP)


@part
def _same(a: Array, b: Array) -> bool:
    """Return whether all bits are equal: 0 and -0 are not, as no frozen sensor changes a sign."""
    for i in range(a.shape[0]):  # noqa: SIM110 - compiled code has no generators
        if a[i] != b[i] or math.copysign(1.0, a[i]) != math.copysign(1.0, b[i]):
            return False
    return True


# -- wrench and slip velocity -------------------------------------------------------------------------


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
    fault, v = Reason.NONE.value, spatial(values)
    if refused:
        fault = Reason.REFUSED.value
    elif stamp_ns == 0 and joint.last.stamp_ns > limits.age_ns:
        fault = Reason.UNSTAMPED.value
    elif state.known != 0 and stamp_ns <= state.stamp_ns:
        fault = Reason.OUT_OF_ORDER.value
    elif joint.known != 0 and stamp_ns > joint.last.stamp_ns + limits.future_ns:
        fault = Reason.FUTURE.value
    elif not valid:
        fault = Reason.INVALID.value
    elif not all_finite(values):
        fault = Reason.NOT_FINITE.value
    elif v.linear.norm() > limits.linear or v.angular.norm() > limits.angular:
        fault = Reason.ABSURD.value
    if fault == Reason.NONE:
        if state.known == 0 or not _same(values, state.values):
            state.equal_since_ns = stamp_ns
        state.seen, state.known, state.stamp_ns, state.arrival_ns = 1, 1, stamp_ns, now_ns
        state.values[:] = values
    else:
        state.counts[fault] += 1
    state.fault, state.fault_ns, state.bad = fault, now_ns, 0 if fault == Reason.NONE else state.bad + 1
    return int(fault)


@part
def queue_slip(queue: SlipQueue, stamp_ns: int, twist: Array) -> None:
    """Keep a good slip sample for the next cycle; where there are too many the oldest goes."""
    if queue.count == ROOM:
        for i in range(ROOM - 1):
            queue.samples[i] = queue.samples[i + 1]
        queue.count -= 1
    queue.samples[queue.count].stamp_ns = stamp_ns
    queue.samples[queue.count].twist[:] = twist
    queue.count += 1


@part
def rebase_vector(limits: VectorLimits, state: VectorInput, joint_stamp_ns: int) -> None:
    """Take the joint state's new clock: a sample ahead of it belongs to the old one."""
    if state.known != 0 and state.stamp_ns > joint_stamp_ns + limits.future_ns:
        state.known, state.fault, state.bad = 0, Reason.NONE.value, 0


@part
def vector_validity(limits: VectorLimits, state: VectorInput, now_ns: int, joint_stamp_ns: int, arm_moves: bool) -> int:
    """Return why the newest good sample does not count in a cycle."""
    if state.known == 0:
        return Reason.SILENT.value
    if state.fault == Reason.INVALID:
        return Reason.INVALID.value
    # One stamp that is ahead is the sample's own fault. Two are two clocks that differ, or joint states that were long
    # on their way: not to wait for the age limit.
    if (state.fault == Reason.FUTURE and state.bad > 1) or state.stamp_ns > joint_stamp_ns + limits.future_ns:
        return Reason.FUTURE.value
    if now_ns - state.arrival_ns > limits.age_ns:
        # Only a sensor that sends nothing is silent: "absurdly large" may mean that the object has been lost.
        recent = state.fault != Reason.NONE and now_ns - state.fault_ns <= limits.age_ns
        return state.fault if recent else Reason.SILENT.value
    if joint_stamp_ns - state.stamp_ns > limits.age_ns:
        return Reason.STALE.value
    if state.stamp_ns - state.equal_since_ns > limits.frozen_ns:
        stays = state.values.any() if limits.zero_is_normal != 0 else arm_moves
        if stays:
            return Reason.FROZEN.value
    return Reason.NONE.value


# -- joint state --------------------------------------------------------------------------------------


@part
def _copy_sample(to: JointRecord, stamp_ns: int, q: Array, qd: Array, effort: Array) -> None:
    n = q.shape[0]
    to.stamp_ns = stamp_ns
    to.position[:n] = q
    to.velocity[:n] = qd
    to.effort[:n] = effort


@part
def classify_joints(
    limits: JointLimits, stamp_ns: int, q: Array, qd: Array, now_ns: int, before: JointRecord, before_ns: int,
    follows: bool,
) -> int:  # fmt: skip
    """Return what is wrong with a joint state in itself, or as one that follows another."""
    if not (all_finite(q) and all_finite(qd)):
        return Reason.NOT_FINITE.value
    passed_ns = stamp_ns - before.stamp_ns
    coast_s, jumps = 2e-9 * min(passed_ns, limits.age_ns), False
    for j in range(q.shape[0]):
        speed = abs(qd[j])
        if not (limits.lower[j] <= q[j] <= limits.upper[j] and speed <= limits.fastest):
            return Reason.ABSURD.value
        explained = JUMP + coast_s * max(speed, abs(before.velocity[j]))
        jumps = jumps or abs(q[j] - before.position[j]) > explained
    if not follows:
        return Reason.NONE.value
    if passed_ns <= -CLOCK_JUMP_NS or passed_ns - (now_ns - before_ns) > CLOCK_JUMP_NS:
        return Reason.CLOCK_JUMP.value
    if passed_ns <= 0:
        return Reason.OUT_OF_ORDER.value
    return Reason.JUMP.value if jumps else Reason.NONE.value


@part
def derive_velocities(limits: JointLimits, state: JointInput, stamp_ns: int, q: Array, qd: Array) -> None:
    """Write the velocities that positions show, since the last ones that were others.

    Where all are the same the last velocities last, because a driver sends again what it has read; of encoders that are
    read in steps they are zero.

    Args:
        limits: of the joint state.
        state: of the joint state's input.
        stamp_ns, q: the sample; (n,) [rad].
        qd: the last ones; changed; (n,) [rad/s].
    """
    if limits.still == 0.0 and _same(q, state.last.position[: q.shape[0]]):
        return
    for j in range(q.shape[0]):
        shown = (q[j] - state.last.position[j]) / (1e-9 * (stamp_ns - state.stands_since_ns))
        qd[j] = min(max(shown, -limits.fastest), limits.fastest)


@part
def receive_joints(
    limits: JointLimits, state: JointInput, stamp_ns: int, q: Array, qd: Array, effort: Array, refused: bool,
    now_ns: int, one_source: bool,
) -> int:  # fmt: skip
    """Take a joint state in; return its fault. RESTARTED is good, and everything before it is discarded.

    Args:
        limits: of the joint state.
        state: of the joint state's input; changed.
        stamp_ns, q, qd, effort: the sample; (n,) [rad], [rad/s], [N m]; velocities that no joint state has had are
            derived.
        refused: whether the message itself was not what it should be.
        now_ns: arrival.
        one_source: whether no other node publishes joint states of this arm.
    """
    if refused:
        state.counts[Reason.REFUSED] += 1
        return Reason.REFUSED.value
    follows, last, n = state.known != 0, state.last, q.shape[0]
    # None is a number: a broadcaster's word for what drives do not measure.
    state.without = 1 if (state.without != 0 or not follows) and np.isnan(qd).all() else 0
    if state.without != 0:
        qd[:] = last.velocity[:n]
    fault = classify_joints(limits, stamp_ns, q, qd, now_ns, last, state.arrival_ns, follows)
    if fault == Reason.JUMP and one_source and now_ns - state.arrival_ns > limits.age_ns:
        # The motion in between was not measured: efforts for the old posture would kick the arm.
        fault = Reason.RESTARTED.value
    if fault == Reason.CLOCK_JUMP or fault == Reason.JUMP:
        again = fault
        if state.agreeing > 0:
            again = classify_joints(limits, stamp_ns, q, qd, now_ns, state.candidate, state.candidate_ns, True)
        if again != Reason.OUT_OF_ORDER:  # twice or late: it neither agrees nor contradicts
            state.agreeing = state.agreeing + 1 if again == Reason.NONE else 1
            state.candidate_ns = now_ns
            _copy_sample(state.candidate, stamp_ns, q, qd, effort)
        if state.agreeing >= limits.accept_after:
            fault = Reason.RESTARTED.value
    if fault != Reason.NONE:
        state.counts[fault] += 1
    if usable(fault):
        continues, speed = follows and fault != Reason.RESTARTED, np.abs(qd).max()
        # Joints that are read in steps read the same again and again.
        steps = limits.still > 0.0 and speed <= limits.still
        if not follows or steps or not (_same(q, last.position[:n]) and _same(qd, last.velocity[:n])):
            state.equal_since_ns = now_ns
        if state.without != 0 and continues:
            derive_velocities(limits, state, stamp_ns, q, qd)
        elif state.without != 0:
            qd[:] = 0.0
        if not continues or not _same(q, last.position[:n]):
            state.stands_since_ns = stamp_ns
        state.moves = 1 if speed > MOVES else 0
        _copy_sample(last, stamp_ns, q, qd, effort)
        state.known, state.arrival_ns, state.agreeing = 1, now_ns, 0
    return fault


@part
def take_replaced(state: JointInput, stamp_ns: int, q: Array, qd: Array, now_ns: int) -> None:
    """Let the joint states continue with one that could not be used: the next one follows where the model has the arm.

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
def frozen(limits: JointLimits, state: JointInput, now_ns: int) -> bool:
    """Return whether the values have been equal to the last bit for longer than measured ones can while moving."""
    return bool(state.known != 0 and now_ns - state.equal_since_ns > limits.frozen_ns)
