"""What happens between cycles: samples are validated and kept for the next cycle, and new gains start to ramp."""

from __future__ import annotations

from slip_core.arrays import Array
from slip_core.compiled import BOOL, IN1, INT, OUT1, VOID, interpreted, kernel
from slip_core.records import dtype_of, record
from slip_vic_controller.arm.estimator import replace_sample, use_estimate
from slip_vic_controller.cycle.deciding import too_heavy
from slip_vic_controller.law.gains import LAW_GAINS, fill_ramp, gains_at
from slip_vic_controller.safety.conditions import SAMPLE_FAULTS, Reason, WhyRecord, put_why
from slip_vic_controller.safety.validation import (
    await_answer,
    queue_slip,
    rebase_vector,
    receive_joints,
    receive_vector,
    take_replaced,
    unanswered,
    usable,
)
from slip_vic_controller.state import ARM_STATE, CONFIG, INPUTS

WHY = dtype_of(WhyRecord)
UNANSWERED = tuple(interpreted(unanswered)(fault) for fault in range(SAMPLE_FAULTS))
"""By fault; looked up in every cycle."""


@kernel(INT, IN1, OUT1, INT, IN1, IN1, IN1, BOOL, INT, BOOL)
def receive_joint_state(
    config: Array, state: Array, stamp_ns: int, q: Array, qd: Array, effort: Array, refused: bool, now_ns: int,
    lockstep: bool,
) -> int:  # fmt: skip
    """Take a joint state in; return its fault.

    In real time one that is out of order, comes twice or has a stamp that jumps is dropped: no cycle answers it.

    Args:
        config, state: CONFIG and ARM_STATE of the arm; the state is changed.
        stamp_ns, q, qd, effort: the sample; (n,) [rad], [rad/s], [N m].
        refused: whether the message itself was not what it should be; then the numbers are not looked at.
        now_ns: arrival.
        lockstep: whether the bridge waits for an answer to everything.
    """
    c, s = record(config, CONFIG), record(state, ARM_STATE)
    one_source, position, velocity = s.outside != Reason.SECOND_PUBLISHER, q.copy(), qd.copy()
    if stamp_ns == 0 and not lockstep:
        s.joint.counts[Reason.UNSTAMPED] += 1
        fault = Reason.UNSTAMPED.value
    else:
        fault = receive_joints(c.joint, s.joint, stamp_ns, position, velocity, effort, refused, now_ns, one_source)
    s.estimate.alone = s.joint.without
    if fault == Reason.RESTARTED:
        for k in range(c.law.contacts):
            rebase_vector(c.wrench, s.wrench_inputs[k], stamp_ns)
            rebase_vector(c.slip, s.slip_inputs[k], stamp_ns)
    if lockstep or not unanswered(fault):
        await_answer(s.joint, stamp_ns, position, velocity, effort, fault)
    return fault


@kernel(INT, IN1, OUT1, INT, INT, IN1, BOOL, INT)
def receive_wrench(
    config: Array, state: Array, contact: int, stamp_ns: int, wrench: Array, refused: bool, now_ns: int
) -> int:
    """Take the wrench (6,) [N, N m] of a contact in; return its fault. Arguments as in `receive_joint_state`."""
    c, s = record(config, CONFIG), record(state, ARM_STATE)
    return receive_vector(c.wrench, s.wrench_inputs[contact], stamp_ns, wrench, True, refused, now_ns, s.joint)


@kernel(INT, IN1, OUT1, INT, INT, IN1, BOOL, BOOL, INT)
def receive_slip(
    config: Array, state: Array, contact: int, stamp_ns: int, twist: Array, valid: bool, refused: bool, now_ns: int
) -> int:
    """Take the slip velocity (6,) [m/s, rad/s] of a contact in; return its fault.

    Args:
        config, state, contact, stamp_ns, twist, refused, now_ns: as in `receive_joint_state`.
        valid: whether the sensor reports that it measures.
    """
    c, s = record(config, CONFIG), record(state, ARM_STATE)
    fault = receive_vector(c.slip, s.slip_inputs[contact], stamp_ns, twist, valid, refused, now_ns, s.joint)
    if contact == 0 and fault == Reason.NONE:
        queue_slip(s.queue, stamp_ns - c.slip_delay_ns, twist)
    return fault


@kernel(BOOL, IN1, OUT1, INT)
def is_silent(config: Array, state: Array, now_ns: int) -> bool:
    """Return whether no good joint state has come for the age limit."""
    c, s = record(config, CONFIG), record(state, ARM_STATE)
    return bool(s.joint.known != 0 and now_ns - s.joint.arrival_ns > c.joint.age_ns)


@kernel(BOOL, IN1, OUT1, OUT1, INT, INT, INT, INT)
def begin_answer(
    config: Array, state: Array, inputs: Array, now_ns: int, request: int, missing: int, fault: int
) -> bool:
    """Begin the INPUTS of an arm, and put the estimate of now in the place of the joint state that waits.

    Where that cannot be used, it is where the model has the arm. One call: each costs as much as what it does.

    Args:
        config, state: CONFIG and ARM_STATE of the arm; the state is changed.
        inputs: INPUTS; changed.
        now_ns: the controller's clock.
        request, missing: as in CycleInputs.
        fault: of the joint state.

    Returns:
        Whether it is known where the arm is: a bad joint state's stamp has to follow the one before, and to be that of
        the arm.
    """
    c, s = record(config, CONFIG), record(state, ARM_STATE)
    i = record(inputs, INPUTS)
    i.present, i.now_ns, i.request, i.missing = 1, now_ns, request, missing
    if usable(fault) or fault == Reason.NOT_RUN:
        for j in range(c.estimator.joints):
            s.joint.answers.velocity[j] -= s.tare.velocity.bias[j]
        use_estimate(c.estimator, s.estimate, s.joint.answers)
        return True
    foreign = fault == Reason.JUMP and s.outside == Reason.SECOND_PUBLISHER
    if s.law.known == 0 or unanswered(fault) or foreign or fault == Reason.UNSTAMPED:
        return False
    if not replace_sample(c.estimator, s.estimate, s.joint.answers):
        return False
    take_replaced(s.joint, s.joint.answers.stamp_ns, s.estimate.q, s.estimate.v, now_ns)
    return True


@kernel(VOID, IN1, IN1, IN1, OUT1)
def overload(config: Array, state: Array, inputs: Array, why: Array) -> None:
    """Write why the arm cannot hold the object of `config` where it is, if it cannot.

    Args:
        config, state, inputs: CONFIG; ARM_STATE; INPUTS with the arm.
        why: result; WHY.
    """
    heavy = too_heavy(record(config, CONFIG), record(state, ARM_STATE), record(inputs, INPUTS).arm)
    put_why(record(why, WHY), heavy)


@kernel(VOID, OUT1, IN1, INT)
def ramp_to(state: Array, target: Array, least_ns: int) -> None:
    """Ramp gains and payload to a target from the next cycle on.

    Args:
        state: ARM_STATE; changed.
        target: LAW_GAINS.
        least_ns: shortest ramp; stability may require a longer one.
    """
    s, wanted = record(state, ARM_STATE), record(target, LAW_GAINS)
    if s.law.known != 0:
        gains_at(s.law.ramp, s.law.stamp_ns, s.tuned.target)
        fill_ramp(s.law.ramp, s.tuned.target, wanted, s.law.stamp_ns, least_ns)
    fill_ramp(s.tuned, s.tuned.start, wanted, 0, least_ns)
