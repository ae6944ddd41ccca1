"""The control cycle of all arms that hold one object: records in, records out, one compiled function.

    cycle(configs, state, inputs, outputs)

One arm is the ordinary number. The state is the task once (where the object's path is, how fast, goal, stream,
friction), then a row per arm (inputs, mode, law, observer, HOLD, limiter). A cycle decides for every arm, lets the arms
agree, and acts for every arm: the law works for all of them or for none, on one path, at the speed of the slowest, with
the friction of the weakest pad. One arm always agrees with itself.

`state` is advanced in place: copy it to keep it; its bytes are a snapshot, and equal states evolve identically. Nothing
here raises, waits, reads a clock or keeps anything elsewhere. On its way a joint state passes input validation (when it
arrives), arbitration and modes, then the law (or HOLD), limit avoidance and the effort limiter; every command comes out
of `_finish`.
"""

from __future__ import annotations

import math
from enum import IntEnum, unique
from typing import NamedTuple

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import IN1, INT, OUT1, VOID, kernel, part
from slip_core.records import Records, WholeArray, record, records
from slip_core.vectors import IDENTITY, ZERO, Mat, Spatial, Vec, mat, put, put_mat, put_spatial, spatial, vec
from slip_vic_controller.arm.command import (
    Interface,
    advance_motion,
    ignored_joint,
    joint_acceleration,
    return_to,
    start_motion,
    stop_motion,
)
from slip_vic_controller.arm.drive_delay import forget_drive_delay, watch_drive_delay
from slip_vic_controller.arm.estimator import (
    BLIND_S,
    DISTURBED,
    Finding,
    clear_findings,
    find,
    is_blind,
    most_disturbed,
    oppose_disturbance,
    pad_variances,
    publish_joints,
    remember_input,
    stay_blind,
    unseen_ns,
)
from slip_vic_controller.arm.tare import add, add_slip, measure_at_rest, measure_without_rest, start_tare, take_biases
from slip_vic_controller.governing import (
    agree_on_friction,
    begin_governing,
    begin_pad,
    feel_pad,
    follow_goal,
    forget_friction,
    governed_reference,
    guard,
    held,
    load_of_motion,
    put_governed,
    rest_after_hold,
    rest_on_path,
    screen,
    step_on_path,
)
from slip_vic_controller.interfaces import wrench_at_pad
from slip_vic_controller.law.bounds import held_sample_limit, internal_gain_limit
from slip_vic_controller.law.contact import (
    beyond_dead_band,
    contact_arm,
    integrate_slips,
    pad_rotation,
    slip_velocity,
)
from slip_vic_controller.law.gains import gains_at
from slip_vic_controller.law.giving_up import judge_compensation, start_giving_up
from slip_vic_controller.law.impedance import slip_speed
from slip_vic_controller.law.internal import mean_arm
from slip_vic_controller.law.law import evaluate, predict_motion, scale_acceleration
from slip_vic_controller.law.symbols import SYMBOLS, SlipEstimate, no_symbols, symbols
from slip_vic_controller.observer.layouts import ROW_SIZE, Observer
from slip_vic_controller.observer.observer import observe, reset
from slip_vic_controller.reference.goals import rest_at
from slip_vic_controller.reference.grip import start_grip
from slip_vic_controller.reference.path_grid import Governing
from slip_vic_controller.reference.path_scaling import advance, lost_ns, scaled
from slip_vic_controller.reference.paths import (
    Reference,
    carried,
    put_reference,
    read_reference,
    reference_at,
    relative,
)
from slip_vic_controller.safety.arbitration import (
    Level,
    arbitrate,
    clear_since,
    watch_for_blindness,
)
from slip_vic_controller.safety.drop_detection import forget, observe_motion
from slip_vic_controller.safety.effort_limiter import (
    go_on,
    limit_effort,
    needs_restart,
    start_limiter,
)
from slip_vic_controller.safety.faults import Fault, Input
from slip_vic_controller.safety.following import watch_following
from slip_vic_controller.safety.hold import (
    begin_posture,
    carry_load,
    hold_effort,
    keep_posture,
    object_load,
    plausible_arm,
    update_load_error,
)
from slip_vic_controller.safety.latency import (
    forget_latency,
    measure_latency,
    measure_slip_latency,
    whole_cycles,
)
from slip_vic_controller.safety.limit_avoidance import avoid_limits
from slip_vic_controller.safety.modes import (
    NOTHING,
    Mode,
    Request,
    TransitionReasons,
    begin_modes,
    follows,
    holds_for,
    next_mode,
    since_when,
)
from slip_vic_controller.safety.reasons import (
    FIRST_WRENCH,
    GOOD_JOINT_STATE,
    Cause,
    Reason,
    because,
    disturbed,
    of_fault,
    put_reason,
    read_reason,
)
from slip_vic_controller.safety.validation import (
    all_finite,
    fine,
    forget_repeats,
    frozen,
    stays_away,
    usable,
    vector_validity,
)
from slip_vic_controller.sizes import MAX_CONTACTS, MAX_JOINTS, NEVER
from slip_vic_controller.state import (
    ARM_SIZE,
    ARM_STATE,
    CONFIG,
    INPUTS,
    OUTPUTS,
    TASK_SIZE,
    TASK_STATE,
    ArmState,
    ControllerConfig,
    CycleInputs,
    CycleOutputs,
    LawState,
    TaskState,
)

LOSS = 0.5
"""Share of the weight by which a wrench differs from the model's where the object is not held as it was."""
LONGEST_PAUSE = 5
"""Control periods that count at most as time between two cycles."""


@unique
class Step(IntEnum):
    """What a cycle does for an arm after its decision."""

    NONE = 0
    BRIDGE = 1
    ANSWER = 2


@part
def _put_estimate(observer: Observer, out: SlipEstimate) -> None:
    """Write what an observer publishes to a SLIP_ESTIMATE."""
    out.sliding, out.significance = observer.sliding, observer.significance
    for k in range(6):
        out.deviation[k], out.error[k] = math.sqrt(observer.variance[k]), observer.error[k]


@part
def _begin(
    config: ControllerConfig,
    task: TaskState,
    state: ArmState,
    inputs: CycleInputs,
    outputs: CycleOutputs,
    stamp_ns: int,
    lead: bool,
) -> None:
    """Begin a cycle of an arm; the first one begins the controller. lead: whether it is the first arm."""
    if state.begun == 0:
        state.begun, state.now_ns = 1, inputs.now_ns
        begin_modes(config.modes, state.mode, inputs.now_ns)
        clear_since(state.since)
        _without_slip(state.law)
        forget(state.observed, NEVER)
        start_tare(state.tare, NEVER)
        state.following.since_ns = NEVER
        if lead:
            task.path.scale, task.path.rate = 1.0, 0.0
        start_grip(config.grip, state.grip)
    outputs.answered, outputs.evaluated = 0, 0
    if inputs.health_given != 0:
        outputs.health = inputs.health
    outputs.ledger[0] = state.cycles
    _put_time(outputs.ledger, 1, stamp_ns)
    state.cycles += 1


@part
def _put_time(ledger: WholeArray, at: int, time_ns: int) -> None:
    """Write a time [ns] as seconds and nanoseconds."""
    ledger[at], ledger[at + 1] = time_ns // 1_000_000_000, time_ns % 1_000_000_000


@part
def _end(
    config: ControllerConfig, task: TaskState, state: ArmState, inputs: CycleInputs, outputs: CycleOutputs
) -> None:
    """Write mode and the end of the ledger."""
    outputs.mode = state.mode
    outputs.path_scale, outputs.grip = task.path.scale, state.grip.command
    put_governed(config, task, state, outputs.governor)
    at, h = 3 + 4 * config.law.contacts, outputs.health
    _put_time(outputs.ledger, at, inputs.now_ns)
    outputs.ledger[at + 2] = state.mode.mode
    outputs.ledger[at + 3] = h.joint | h.wrench << 8 | h.slip << 16 | h.outside << 24
    outputs.ledger[at + 4], outputs.ledger[at + 5] = inputs.request, task.taken


@part
def _never_seen(config: ControllerConfig, state: ArmState) -> int:
    """Return the bits of the inputs that have never been seen: no command before every input was seen once."""
    bits = 0
    for k in range(config.law.contacts):
        if state.wrench_inputs[k].seen == 0:
            bits |= FIRST_WRENCH << k
        if config.arbitration.slip_needed != 0 and state.slip_inputs[k].seen == 0:
            bits |= FIRST_WRENCH << (MAX_CONTACTS + k)
    return bits


@part
def _model_wrench(config: ControllerConfig, task: TaskState, state: ArmState, inputs: CycleInputs) -> None:
    """Let the wrench be that of a held object that moves as the path does, where no sensor measures it.

    Implements: ours: Newton's law for the object at the desired acceleration, f = m (g - a), without its rotation.
    """
    law, hold, R = state.law, config.hold, mat(inputs.arm.rotation)
    force = vec(hold.weight)
    if follows(state.mode.mode) and law.known != 0:
        force = force - hold.mass * vec(task.desired.acceleration)
    pad = pad_rotation(config.law.contact[0], law.slips[0])
    load, R_o = Spatial(force, -(R @ _arm_of_load(config, state, pad)).cross(force)), R @ pad.T()
    state.wrench_modelled = 1
    for k in range(config.law.contacts):
        if inputs.arm.M[0, 0] > 0.0:
            put_spatial(state.wrench_of_model[k], (R_o @ pad_rotation(config.law.contact[k], law.slips[k])).T() @ load)


@part
def _shows_loss(config: ControllerConfig, state: ArmState, inputs: CycleInputs) -> bool:
    """Return whether the sensor reads much less than the model's wrench, or another one: the object may be lost."""
    R = mat(inputs.arm.rotation)
    read = wrench_at_pad(config.wrench_sensor, state.wrench_inputs[0].values, R) - spatial(state.tare.wrench_bias)
    return (read - spatial(state.wrench_of_model[0])).linear.norm() > LOSS * vec(config.hold.weight).norm()


@part
def _count_wrench_as_good(config: ControllerConfig, state: ArmState, inputs: CycleInputs) -> None:
    """Let the inputs of the wrench count as good, where there is no sensor."""
    stamp_ns = state.joint.answers.stamp_ns
    for k in range(config.law.contacts):
        own = state.wrench_inputs[k]
        own.seen, own.known, own.invalid, own.zeros, own.refused, own.ahead = 1, 1, 0, 0, 0, 0
        own.stamp_ns, own.arrival_ns, own.equal_since_ns = stamp_ns, inputs.now_ns, stamp_ns


@part
def _wait(config: ControllerConfig, state: ArmState, inputs: CycleInputs, missing: Reason, keep_limiter: int) -> None:
    """Give no effort. Without a command the arm may move, so HOLD restarts from the pose found then."""
    reasons = TransitionReasons(missing, NOTHING, NOTHING, NOTHING)
    next_mode(config.modes, state.mode, reasons, inputs.request, inputs.now_ns)
    state.limiter.started, state.now_ns, state.hold.known = keep_limiter, inputs.now_ns, 0
    state.hold.load_error[:] = 0.0
    state.estimate.started = 0
    forget_latency(state.latency)


@part
def _classify_inputs(
    config: ControllerConfig, state: ArmState, inputs: CycleInputs, outputs: CycleOutputs, fault: int, alone: bool
) -> None:
    """Write the fault of each input in this cycle, and the stamps of the samples that it uses.

    alone: whether another arm is not answered in this cycle.
    """
    stamp_ns = state.joint.answers.stamp_ns
    # What is frozen stays so while the path comes to rest, and in the HOLD after it.
    moves = state.joint.moves != 0 or holds_for(state.mode, Input.WRENCH, Fault.FROZEN)
    moves = moves or state.since.wrench_bad_ns != NEVER
    if inputs.health_given == 0:
        health = outputs.health
        health.joint, health.wrench, health.slip, health.outside = fault, 0, 0, state.outside
        for k in range(config.law.contacts):
            wrench = vector_validity(config.wrench, state.wrench_inputs[k], inputs.now_ns, stamp_ns, moves)
            slip = vector_validity(config.slip, state.slip_inputs[k], inputs.now_ns, stamp_ns, moves)
            health.wrench, health.slip = max(health.wrench, wrench), max(health.slip, slip)
    if alone:
        outputs.health.outside = Fault.OTHER_ARM.value
    for k in range(config.law.contacts):
        _put_time(outputs.ledger, 3 + 4 * k, state.wrench_inputs[k].stamp_ns)
        _put_time(outputs.ledger, 5 + 4 * k, state.slip_inputs[k].stamp_ns)


@part
def _without_slip(law: LawState) -> None:
    """Begin where no object has slipped."""
    for k in range(MAX_CONTACTS):
        put(law.slips[k].position, ZERO)
        put_mat(law.slips[k].rotation, IDENTITY)


@part
def begin_law(
    config: ControllerConfig, task: TaskState, state: ArmState, inputs: CycleInputs, outputs: CycleOutputs, lead: bool
) -> None:
    """Begin the law: the arm where it is, no slip; of the first arm also the trajectory, starting here and now."""
    law, sample, n = state.law, state.joint.answers, config.law.joints
    law.known, law.stamp_ns = 1, sample.stamp_ns
    law.start_position[:], law.start_rotation[:] = inputs.arm.position, inputs.arm.rotation
    for j in range(n):
        law.posture[j] = config.cycle.posture[j] if config.cycle.posture_given != 0 else sample.position[j]
        law.position[j], law.gravity[j] = sample.position[j], inputs.arm.gravity[j]
    law.e_previous[:] = 0.0
    _without_slip(law)
    law.slip_latency.known, law.slip_latency.latency_ns, law.slip_latency.period_ns = 0, 0.0, 0.0
    law.held = 0
    start_giving_up(law.given_up)
    law.ramp = state.tuned
    law.ramp.begin_ns = sample.stamp_ns
    if config.cycle.has_observer != 0:
        reset(config.observer, state.observer, sample.stamp_ns, inputs.arm.twist)
    if config.governor.mode != Governing.OFF:
        _gains_now(state, sample.stamp_ns, outputs)
        begin_pad(config, state, inputs.arm, outputs.gains)
    if lead:
        _begin_task(config, task, state, inputs)


@part
def _begin_task(config: ControllerConfig, task: TaskState, state: ArmState, inputs: CycleInputs) -> None:
    """Begin the object's motion with the law of the first arm."""
    arm = inputs.arm
    task.start_ns = state.joint.answers.stamp_ns
    if config.stream.on != 0:
        rest_on_path(config, task, arm)
    if config.goals.on != 0:
        rest_at(task.goal, Reference(vec(arm.position), mat(arm.rotation), Spatial(ZERO, ZERO), Spatial(ZERO, ZERO)))
    if config.governor.mode != Governing.OFF:
        begin_governing(config, task, state)


@part
def _look(
    config: ControllerConfig,
    task: TaskState,
    state: ArmState,
    inputs: CycleInputs,
    outputs: CycleOutputs,
    lead: bool,
    alone: bool,
    together: AtRest,
) -> None:
    """Look at the inputs of an arm and decide; the mode is that of this cycle then.

    lead: whether it is the first arm; alone: whether another arm is not answered in this cycle; together: see `AtRest`.
    """
    decision = outputs.decision
    decision.step, decision.request = Step.NONE.value, inputs.request
    decision.before = state.mode
    if inputs.request == Request.RESET_FAULT:
        task.forgets = 1
    fault = inputs.health.joint if inputs.health_given != 0 else state.joint.pending_fault
    state.joint.pending = 0
    _begin(config, task, state, inputs, outputs, state.joint.answers.stamp_ns, lead)
    if fault == Fault.RESTARTED and state.law.known != 0:
        # Everything starts again; the limiter continues from the last command, where that is recent: the joints feel it
        state.law.known = 0
        _wait(config, state, inputs, of_fault(Cause.INPUT, Input.JOINT_STATE, fault), state.limiter.started)
    if config.cycle.models_wrench != 0:
        _count_wrench_as_good(config, state, inputs)
    decision.never_seen = _never_seen(config, state)
    missing = inputs.missing | decision.never_seen
    if state.law.known == 0 and not usable(fault):
        missing |= GOOD_JOINT_STATE
    if missing != 0:
        _wait(config, state, inputs, because(Cause.WAITS, missing), 0)
        return
    _classify_inputs(config, state, inputs, outputs, fault, alone)
    state.wrench_modelled = 0
    if config.cycle.models_wrench != 0 or (not fine(outputs.health.wrench) and state.law.known != 0):
        _model_wrench(config, task, state, inputs)
    if state.wrench_modelled != 0 and outputs.health.wrench == Fault.FROZEN and _shows_loss(config, state, inputs):
        state.wrench_modelled = 0  # what reads the same is right then
    if state.law.known == 0:
        begin_law(config, task, state, inputs, outputs, lead)
    _decide(config, task, state, inputs, outputs, together)


@part
def _decide(
    config: ControllerConfig,
    task: TaskState,
    state: ArmState,
    inputs: CycleInputs,
    outputs: CycleOutputs,
    together: AtRest,
) -> None:
    """Find what speaks against the law, and go to the mode of this cycle."""
    sample, fault, now_ns, decision = state.joint.answers, outputs.health.joint, inputs.now_ns, outputs.decision
    bad = not (usable(fault) or fault == Fault.NOT_RUN)
    state.since.joint_bad_ns = since_when(state.since.joint_bad_ns, bad, now_ns)
    if bad and inputs.arm.M[0, 0] == 0.0:  # the model does not know where the arm is either
        decision.step, decision.entered = Step.BRIDGE.value, state.mode.mode
        return
    if inputs.request == Request.ENABLE or inputs.request == Request.RESET_FAULT:
        # A user who enables the law, or ends a fault, has checked that the clocks agree and nothing is late.
        forget_latency(state.latency)
        forget_drive_delay(state.drive_delay)
        forget_repeats(state.wrench_inputs)
        if state.estimate.unmeasured[0] == 0:  # else no user can be right: the joint states contradict themselves
            state.joint.equal_since_ns = now_ns
    if inputs.request == Request.RESET_FAULT:
        clear_findings(state.estimate)  # what is still wrong is found again
    measure_latency(state.latency, now_ns, sample.stamp_ns, now_ns - state.now_ns, config.cycle.late_ns)
    request = _stop_first(config, state, inputs.request, now_ns)
    reweighed = config.tare.duration_ns > 0 and not bad and _tare(config, state, inputs, together)
    decision.reweighed = 1 if reweighed else 0
    freezes = frozen(config.joint, state.joint, now_ns)
    n, contacts = config.law.joints, config.law.contacts
    q, qd = sample.position, sample.velocity
    reasons, level = arbitrate(config, task, state, outputs.health, freezes, n, contacts, q, qd, now_ns)
    if reasons.fault.cause == Cause.JOINT_TOO_FAST or reasons.fault.cause == Cause.FALLS:
        said = _with_disturbance(config, state, inputs, reasons.fault)
        reasons = TransitionReasons(reasons.missing, said, reasons.hold, reasons.degraded)
    decision.entered = state.mode.mode
    next_mode(config.modes, state.mode, reasons, request, now_ns)
    decision.step, decision.request, decision.level = Step.ANSWER.value, request, level
    decision.freezes = 1 if freezes else 0
    put_reason(decision.fault, reasons.fault)


@part
def _with_disturbance(config: ControllerConfig, state: ArmState, inputs: CycleInputs, fault: Reason) -> Reason:
    """Return a fault with the largest disturbance of a joint, where there is one: it may be behind it."""
    joint, torque = most_disturbed(config.estimator, state.estimate, inputs.arm.M, config.law.effort_limit)
    return disturbed(fault, joint, torque) if abs(torque) > DISTURBED * config.law.effort_limit[joint] else fault


class AtRest(NamedTuple):
    """What the wrenches of several arms show together at rest.

    arms: how many; known: whether all hold it and all are measured; beyond: force beyond the weight of the object, a
    share of it for each arm [N] {w}. What is left of a single wrench may be internal: arms may press on each other.
    """

    arms: int
    known: bool
    beyond: Vec


@part
def _all_at_rest(configs: Records[ControllerConfig], states: Records[ArmState], inputs: Records[CycleInputs]) -> AtRest:
    """Return what the wrenches of all arms show together at rest; of one arm, or after the tare of all, nothing."""
    n, held, wanted, beyond = len(configs), configs[0].tare.duration_ns > 0, False, ZERO
    for k in range(n):
        held = held and states[k].mode.mode == Mode.HOLD and states[k].wrench_inputs[0].seen != 0
        wanted = wanted or states[k].tare.done == 0
    if n == 1 or not held or not wanted:
        return AtRest(n, False, ZERO)
    for k in range(n):
        R = mat(inputs[k].arm.rotation)
        measured = R @ measured_wrench(configs[k], states[k], R).linear
        beyond = beyond + (measured - vec(configs[k].hold.weight))
    return AtRest(n, True, (1.0 / n) * beyond)


@part
def _wrench_at_rest(
    config: ControllerConfig, state: ArmState, inputs: CycleInputs, together: AtRest
) -> tuple[Spatial, Spatial]:
    """Return the object's wrench on the pad beyond that of the model, and that of the model [N, N m] {ee}.

    Of several arms a share of what they show together, in which torques are not compared.
    """
    R = mat(inputs.arm.rotation)
    r = _arm_of_load(config, state, pad_rotation(config.law.contact[0], state.law.slips[0]))
    expected = object_load(config.hold, R, R @ r)
    if together.arms == 1:
        return own_wrench(config, state, R) - expected, expected
    return Spatial(R.T() @ together.beyond, ZERO), Spatial(expected.linear, ZERO)


@part
def _tare(config: ControllerConfig, state: ArmState, inputs: CycleInputs, together: AtRest) -> bool:
    """Read the sensors at rest while HOLD keeps the arm, and take what is a bias out of the samples of this cycle.

    Returns whether the object's weight was found, and is another than before.
    """
    tare, queue, mass_share = state.tare, state.queue, state.tare.mass_share
    if inputs.request == Request.TARE and not follows(state.mode.mode):
        start_tare(tare, NEVER)
    if tare.done == 0 and state.mode.mode == Mode.HOLD:
        n, stamp_ns, wrench = config.law.joints, state.joint.answers.stamp_ns, state.wrench_inputs[0]
        six, (beyond, expected) = np.zeros(6), _wrench_at_rest(config, state, inputs, together)
        over = measure_at_rest(
            config.tare, tare, stamp_ns, state.joint.last.position[:n], state.joint.last.velocity[:n]
        )
        for k in range(queue.count):
            if queue.samples[k].stamp_ns >= tare.begun_ns:
                add_slip(config.tare, tare, queue.samples[k].twist)
        if wrench.stamp_ns > tare.wrench_ns and (together.arms == 1 or together.known):
            tare.wrench_ns = wrench.stamp_ns
            put_spatial(six, beyond)
            add(tare.wrench, six, 6)
        if over:
            put_spatial(six, expected)
            take_biases(config.tare, tare, six, stamp_ns, state.joint.last.position[:n])
    elif tare.done == 0:  # FAULT damps the same velocities as HOLD
        wrong = state.estimate.finding != Finding.NONE
        measure_without_rest(config.tare, tare, state.joint.last.velocity[: config.law.joints], wrong)
    for k in range(queue.count):
        for i in range(6):
            queue.samples[k].twist[i] -= tare.slip_bias[i]
    return bool(tare.mass_share != mass_share)


@part
def _gains_now(state: ArmState, stamp_ns: int, outputs: CycleOutputs) -> None:
    """Write gains and payload in effect, with the mass that a tare has found; its inertia grows as much."""
    gains_at(state.law.ramp, stamp_ns, outputs.gains)
    measured = 1.0 + state.tare.mass_share
    outputs.gains.object.mass *= measured
    for i in range(3):
        for j in range(3):
            outputs.gains.object.inertia[i, j] *= measured


@part
def measured_wrench(config: ControllerConfig, state: ArmState, R_ee: Mat) -> Spatial:
    """Return the wrench on the own pad [N, N m] {ee} as the sensor reads it, or that of the model."""
    if state.wrench_modelled != 0:
        return spatial(state.wrench_of_model[0])
    return wrench_at_pad(config.wrench_sensor, state.wrench_inputs[0].values, R_ee)


@part
def own_wrench(config: ControllerConfig, state: ArmState, R_ee: Mat) -> Spatial:
    """Return the wrench of the object on the own pad [N, N m] {ee}, without the sensor's bias, or that of the model."""
    measured = measured_wrench(config, state, R_ee)
    if state.wrench_modelled != 0:
        return measured
    return measured - spatial(state.tare.wrench_bias)


@part
def _put_own_wrench(config: ControllerConfig, state: ArmState, inputs: CycleInputs, h: Array) -> None:
    """Write the wrench of the object on the own pad (6,) [N, N m] {w}, without the sensor's bias."""
    R_ee = mat(inputs.arm.rotation)
    put_spatial(h, R_ee @ own_wrench(config, state, R_ee))


@part
def _begin_together(task: TaskState, states: Records[ArmState], inputs: Records[CycleInputs]) -> bool:
    """Let the law of all arms begin in the same cycle, on one path; return whether an arm is not answered in this one.

    An arm that begins without the others holds until they begin with it.
    """
    alone, begins = False, task.begun == 0
    for k in range(len(states)):
        alone = alone or inputs[k].present == 0
        begins = begins or states[k].law.known == 0 or (inputs[k].present != 0 and _restarts(states[k], inputs[k]))
    if len(states) > 1 and not alone:
        for k in range(len(states)):
            if begins and not _restarts(states[k], inputs[k]):
                states[k].law.known = 0
    if begins:
        task.begun = 0
    return alone


@part
def _restarts(state: ArmState, inputs: CycleInputs) -> bool:
    """Return whether the source of an arm's joint states has restarted."""
    fault = inputs.health.joint if inputs.health_given != 0 else state.joint.pending_fault
    return bool(fault == Fault.RESTARTED)


@part
def _agree(
    configs: Records[ControllerConfig],
    task: TaskState,
    states: Records[ArmState],
    inputs: Records[CycleInputs],
    outputs: Records[CycleOutputs],
    alone: bool,
) -> None:
    """Let the law work for all arms or for none; take down how they hold the object where it begins for all."""
    n = len(states)
    begun, any_works, all_work = not alone, False, not alone
    for k in range(n):
        if inputs[k].present != 0:
            works = _works(configs[k], states[k], inputs[k], outputs[k])
            outputs[k].decision.works = 1 if works else 0
            any_works, all_work = any_works or works, all_work and works
        begun = begun and states[k].law.known != 0
    if task.begun == 0 and begun:
        task.begun = 1
        for k in range(n):
            relative(states[0].law, states[k].law, states[k].grasp)
    if any_works and not all_work:
        for k in range(n):
            if inputs[k].present != 0:
                _hold_with_the_others(configs[k], states[k], inputs[k], outputs[k])


@part
def _works(config: ControllerConfig, state: ArmState, inputs: CycleInputs, outputs: CycleOutputs) -> bool:
    """Return whether the law works in this cycle, or its last effort is repeated."""
    step = outputs.decision.step
    if step == Step.BRIDGE and not bridges(config, state, inputs.now_ns):
        return False
    return step != Step.NONE and follows(state.mode.mode)


@part
def _hold_with_the_others(
    config: ControllerConfig, state: ArmState, inputs: CycleInputs, outputs: CycleOutputs
) -> None:
    """Hold because another arm does; all count again from here until they may resume, so they resume together."""
    decision = outputs.decision
    if decision.works != 0:
        state.mode = decision.before
        reason = of_fault(Cause.INPUT, Input.ANY, Fault.OTHER_ARM)
        reasons = TransitionReasons(NOTHING, read_reason(decision.fault), reason, NOTHING)
        next_mode(config.modes, state.mode, reasons, decision.request, inputs.now_ns)
        if outputs.health.outside == Fault.NONE:
            outputs.health.outside = Fault.OTHER_ARM.value
    state.mode.good_since_ns = NEVER


@part
def _leave_to_drives(config: ControllerConfig, state: ArmState, inputs: CycleInputs) -> None:
    """Give no command: without feedback HOLD would lose the arm; drives hold it by themselves."""
    state.limiter.started, state.now_ns, state.hold.known = 0, inputs.now_ns, 0
    stay_blind(config.estimator, state.estimate)


@part
def _at_work(state: ArmState, outputs: CycleOutputs) -> bool:
    """Return whether the law is to be evaluated in this cycle."""
    return bool(outputs.decision.step == Step.ANSWER and follows(state.mode.mode))


@part
def _prepare(
    config: ControllerConfig, task: TaskState, state: ArmState, inputs: CycleInputs, outputs: CycleOutputs, lead: bool
) -> None:
    """Do what comes before the law in this cycle, or instead of it."""
    decision = outputs.decision
    if decision.step == Step.BRIDGE:
        _bridge(config, task, state, inputs, outputs, outputs.health.joint)
    elif decision.step == Step.ANSWER and not follows(state.mode.mode):
        known_anew = decision.request == Request.RESET_FAULT or decision.reweighed != 0
        if known_anew and config.governor.mode != Governing.OFF:
            _gains_now(state, state.joint.answers.stamp_ns, outputs)
            forget_friction(config, task, state, inputs.arm, outputs.gains, lead)
        frozen_s = 1e-9 * (inputs.now_ns - state.joint.equal_since_ns)
        blind = frozen_s > BLIND_S and holds_for(state.mode, Input.JOINT_STATE, Fault.FROZEN)
        if blind or is_blind(config.estimator, state.estimate):
            _leave_to_drives(config, state, inputs)
        else:
            _hold(config, task, state, inputs, outputs, fine(outputs.health.wrench) and decision.freezes == 0, lead)
    elif decision.step == Step.ANSWER and not follows(decision.entered):
        # After a HOLD the path starts from rest; and the time that passed in it is not part of the path.
        if lead:
            task.path.scale, task.path.rate = (1.0 if decision.entered == Mode.WAITING_INPUT else 0.0), 0.0
            rest_on_path(config, task, inputs.arm)
            if decision.entered != Mode.WAITING_INPUT:
                rest_after_hold(config, task, inputs.arm)
        state.hold.known, state.hold.load_error[:] = 0, 0.0
        forget(state.observed, state.observed.blind_since_ns)
        if config.cycle.has_observer != 0:
            reset(config.observer, state.observer, state.joint.answers.stamp_ns, inputs.arm.twist)


@part
def _stop_first(config: ControllerConfig, state: ArmState, request: int, now_ns: int) -> int:
    """Let a user's HOLD begin when the path has come to rest: a sudden stop throws a weakly gripped object."""
    stays = request == Request.ENABLE or request == Request.RESET_FAULT or request == Request.FAILED
    if stays or not follows(state.mode.mode):
        stopping = state.since.stopping_ns != NEVER
        state.since.stopping_ns = NEVER
        # An input that stopped the law on the way to rest does not take the user's wish away.
        return request if stays or not stopping else Request.HOLD.value
    if request == Request.HOLD and state.since.stopping_ns == NEVER:
        state.since.stopping_ns = now_ns
        return Request.NONE.value
    if state.since.stopping_ns != NEVER and now_ns - state.since.stopping_ns >= config.arbitration.slow_down_ns:
        state.since.stopping_ns = NEVER
        return Request.HOLD.value
    return Request.NONE.value  # a second request does not stop the path more suddenly


@part
def bridges(config: ControllerConfig, state: ArmState, now_ns: int) -> bool:
    """Return whether a gap of good joint states is bridged: shortly, and not after a pause of the controller."""
    ran = now_ns - state.now_ns <= config.arbitration.gap_ns
    return ran and state.limiter.started != 0 and now_ns - state.since.joint_bad_ns <= config.arbitration.bridge_ns


@part
def _bridge(
    config: ControllerConfig, task: TaskState, state: ArmState, inputs: CycleInputs, outputs: CycleOutputs, fault: int
) -> None:
    """Bridge a short gap of good joint states, in which nothing tells where the arm is, with the last effort.

    Then let it go to gravity compensation, and give no command where the gap is a pause.
    """
    n, now_ns = config.law.joints, inputs.now_ns
    # The law has to end where the wrench stays away, whatever the joint states are like.
    ends = follows(state.mode.mode) and stays_away(outputs.health.wrench)
    if bridges(config, state, now_ns) and not ends:
        # `_finish` takes the disturbance off once more.
        outputs.wanted[:n] = state.limiter.effort[:n] - state.estimate.taken_off[:n]
    else:
        outputs.wanted[:n] = state.law.gravity[:n]
        reasons = TransitionReasons(NOTHING, NOTHING, of_fault(Cause.INPUT, Input.JOINT_STATE, fault), NOTHING)
        next_mode(config.modes, state.mode, reasons, inputs.request, now_ns)
        task.path.scale, task.path.rate, state.hold.known = 0.0, 0.0, 0
        if is_blind(config.estimator, state.estimate):
            _leave_to_drives(config, state, inputs)
            return
    # A jump of the positions leaves the efforts believable, unless another publisher sends joint states too: after a
    # pause the limiter starts at what the joints feel. Where nothing tells that, the drives go on as in the pause.
    rest, felt = np.zeros(MAX_JOINTS), np.zeros(MAX_JOINTS)
    if fault == Fault.JUMP and outputs.health.outside != Fault.SECOND_PUBLISHER:
        felt[:] = state.joint.answers.effort
    elif needs_restart(config.motion.drive, state.limiter, now_ns):
        _leave_to_drives(config, state, inputs)
        return
    _finish(config, state, inputs, outputs, state.law.position, rest, felt, False)


@part
def _arm_of_load(config: ControllerConfig, state: ArmState, pad: Mat) -> Vec:
    """Return r = x_c - x_o at which the load pulls, on the axes of the pad whose attitude is `pad` [m] {ee}."""
    slips, own, positions = state.law.slips, config.law.contact[0], ZERO
    # The levers of several shares of the weight cancel, as far as they can.
    if config.law.contacts < config.hold.carriers:  # where the other pads are is not known
        return ZERO
    if config.law.contacts > 1:
        r = mean_arm(config.law, config.gains, slips)
    else:
        r = contact_arm(pad, vec(own.position), own, slips[0])
    for k in range(config.law.contacts):
        positions = positions + vec(config.law.contact[k].position)
    return plausible_arm(pad.T() @ ((1.0 / config.law.contacts) * positions), r)


@part
def _hold(
    config: ControllerConfig,
    task: TaskState,
    state: ArmState,
    inputs: CycleInputs,
    outputs: CycleOutputs,
    wrench_good: bool,
    lead: bool,
) -> None:
    """Keep the posture in which HOLD began; what the wrench has shown of the load stays until the law begins."""
    law, sample = state.law, state.joint.answers
    # After a pause something else has held the arm.
    if state.hold.known == 0 or inputs.now_ns - state.now_ns > config.arbitration.gap_ns:
        begin_posture(config.hold, state.hold, sample)
    dt_ns = max(sample.stamp_ns - law.stamp_ns, 0)
    friction, limit = config.estimator.friction, config.motion.velocity
    keep_posture(config.hold, state.hold, sample, limit, inputs.arm.M, friction, dt_ns * 1e-9)
    pad = pad_rotation(config.law.contact[0], law.slips[0])
    r = _arm_of_load(config, state, pad)
    if wrench_good:
        measured = own_wrench(config, state, mat(inputs.arm.rotation))
        update_load_error(config.hold, state.hold, inputs.arm, r, measured, dt_ns * 1e-9)
    late_s = state.latency.most_ns * 1e-9 + state.drive_delay.found_s
    hold_effort(config.hold, state.hold, inputs.arm, sample, pad, r, late_s, outputs.wanted)
    if not (state.mode.reason.cause == Cause.FALLS and state.mode.reason.prefix == 0):
        carry_load(config.hold, state.hold, inputs.arm, r, outputs.wanted)
    if lead:
        task.start_ns += dt_ns
    _keep_joints(config, state, inputs)
    task.path.scale, task.path.rate = 0.0, 0.0
    forget(state.observed, NEVER)
    state.since.saturated_ns, state.following.since_ns = NEVER, NEVER
    _finish(config, state, inputs, outputs, sample.position, sample.velocity, sample.effort, False)


@part
def keep_law(config: ControllerConfig, state: ArmState, inputs: CycleInputs, outputs: CycleOutputs) -> None:
    """Keep what the next evaluation of the law needs of this one."""
    state.law.e_previous[:] = outputs.law.e[3:]
    for k in range(config.law.contacts):
        state.law.slips[k] = outputs.slips[k]
    _keep_joints(config, state, inputs)


@part
def _keep_joints(config: ControllerConfig, state: ArmState, inputs: CycleInputs) -> None:
    """Keep stamp and position of a good joint state, and gravity there.

    With other arms on the object its share of the weight belongs to it: an arm that loses sight must not let them
    carry all of it at once.
    """
    law, sample, n = state.law, state.joint.answers, config.law.joints
    law.stamp_ns = max(sample.stamp_ns, law.stamp_ns)
    law.position[:n] = sample.position[:n]
    if all_finite(inputs.arm.gravity[:n]):
        law.gravity[:n] = inputs.arm.gravity[:n]
    if config.hold.carriers > 1 and state.mode.reason.cause != Cause.FALLS:
        r = _arm_of_load(config, state, pad_rotation(config.law.contact[0], law.slips[0]))
        carry_load(config.hold, state.hold, inputs.arm, r, law.gravity)


@part
def _stops(config: ControllerConfig, state: ArmState, outputs: CycleOutputs) -> bool:
    """Return whether an arm needs the path to come to rest."""
    unseen = unseen_ns(config.estimator, state.estimate) > config.arbitration.bridge_ns
    wrench = state.since.wrench_bad_ns != NEVER
    return bool(outputs.decision.level == Level.SLOWING or state.since.stopping_ns != NEVER or unseen or wrench)


@part
def _path_speed(configs: Records[ControllerConfig], states: Records[ArmState], outputs: Records[CycleOutputs]) -> float:
    """Return how fast the path may be run through for other reasons than friction: as the slowest arm can follow it."""
    speed = states[0].observed.path_speed
    for k in range(len(states)):
        speed = min(speed, states[k].observed.path_speed)
    for k in range(len(states)):
        if _at_work(states[k], outputs[k]) and _stops(configs[k], states[k], outputs[k]):
            speed = 0.0
    return float(speed)


@part
def _move_on(config: ControllerConfig, task: TaskState, state: ArmState, path_speed: float) -> None:
    """Move on along the path, in the time of the first arm's joint states; state: of the first arm."""
    dt_ns = max(state.joint.answers.stamp_ns - state.law.stamp_ns, 0)
    screen(config, task, state, True)
    governed = config.governor.mode != Governing.OFF
    if not governed and (path_speed < 1.0 or task.path.scale != 1.0 or task.path.rate != 0.0):
        advance(task.path, path_speed, dt_ns * 1e-9, config.cycle.slow_down_s)
    if governed:
        task.path.scale, task.path.rate = 1.0, 0.0  # the governor brings the path to rest, as friction admits
    task.start_ns += lost_ns(task.path, dt_ns)


@part
def _follow(
    config: ControllerConfig, task: TaskState, state: ArmState, inputs: CycleInputs, outputs: CycleOutputs, lead: bool
) -> None:
    """Let the law command the arm, on what `sense` has found."""
    sample, n = state.joint.answers, config.law.joints
    dt_ns = max(sample.stamp_ns - state.law.stamp_ns, 0)
    cause = command(config, task, state, inputs, outputs, lead)
    if cause != Cause.NONE:
        _hold_without_law(config, task, state, inputs, outputs, cause)
        return
    keep_law(config, state, inputs, outputs)
    outputs.wanted[:n] = outputs.law.effort[:n]
    axes, law = config.law.contact[0].slip_axes, outputs.law
    observe_motion(config.drop, axes, state.observed, inputs.arm, law, outputs.reference, dt_ns * 1e-9)
    watch_for_blindness(state.observed, law.slip_speed, config.drop.evidence, inputs.now_ns)
    _watch_following(config, state, inputs, outputs)
    _finish(config, state, inputs, outputs, sample.position, sample.velocity, sample.effort, True)


@part
def _watch_following(config: ControllerConfig, state: ArmState, inputs: CycleInputs, outputs: CycleOutputs) -> None:
    """Look whether the arm moves as commanded; its velocity of now is not that of the commands under way."""
    h, twist, commanded = np.empty(6), inputs.arm.twist.copy(), np.zeros(MAX_JOINTS)
    _put_own_wrench(config, state, inputs, h)
    if config.command.interface != Interface.EFFORT:
        commanded[:] = state.motion.velocity
        _put_twist_of_joints(config, state, inputs, twist)
    n, q, effort, now_ns = config.law.joints, state.joint.answers.position, state.limiter.effort, inputs.now_ns
    watch_following(
        state.following, config.motion, n, q, twist, outputs.reference.twist, inputs.arm, outputs.law, h, effort,
        commanded, now_ns,
    )  # fmt: skip


@part
def _hold_without_law(
    config: ControllerConfig, task: TaskState, state: ArmState, inputs: CycleInputs, outputs: CycleOutputs, cause: int
) -> None:
    """Hold because the law could not be evaluated: gravity compensation with damping in this cycle, and HOLD."""
    law, sample, n = state.law, state.joint.answers, config.law.joints
    _keep_joints(config, state, inputs)
    for j in range(n):
        torque = law.gravity[j] - config.cycle.joint_damping * sample.velocity[j]
        outputs.wanted[j] = min(max(torque, -config.law.effort_limit[j]), config.law.effort_limit[j])
    reasons = TransitionReasons(NOTHING, NOTHING, because(cause, 0), NOTHING)
    next_mode(config.modes, state.mode, reasons, Request.NONE.value, inputs.now_ns)
    if cause == Cause.BAD_REFERENCE or cause == Cause.NO_TORQUE:
        task.forgets = 1
    task.path.scale, task.path.rate = 0.0, 0.0
    begin_posture(config.hold, state.hold, sample)
    _finish(config, state, inputs, outputs, sample.position, sample.velocity, sample.effort, False)


@part
def sense(
    config: ControllerConfig,
    task: TaskState,
    state: ArmState,
    history: Array,
    inputs: CycleInputs,
    outputs: CycleOutputs,
    slip_unknown: bool,
) -> int:
    """Find slip, gains and load of an arm in this cycle; return why it could not be, Cause.NONE where it could.

    slip_unknown: there is no slip sample; an observer continues with the model alone.
    """
    law, sample, samples = state.law, state.joint.answers, outputs.samples
    if sample.stamp_ns < law.stamp_ns:
        return Cause.OLD_JOINT_STATE.value
    for k in range(config.law.contacts):
        if state.wrench_modelled != 0:
            samples[k].wrench[:] = state.wrench_of_model[k]
        else:
            samples[k].wrench[:] = state.wrench_inputs[k].values
        samples[k].slip_twist[:] = state.slip_inputs[k].values
        if slip_unknown:
            samples[k].slip_twist[:] = 0.0
    samples[0].slip_twist[:] -= state.tare.slip_bias
    put_spatial(samples[0].wrench, own_wrench(config, state, mat(inputs.arm.rotation)))
    if slip_unknown:
        state.queue.count = 0
    _gains_now(state, law.stamp_ns, outputs)
    measure_slip_latency(law.slip_latency, sample.stamp_ns, state.queue)
    outputs.follow_error[:] = 0.0
    if config.cycle.has_observer != 0:
        observer, queue, motion = state.observer, state.queue, outputs.motion
        if not predict_motion(config.law, outputs.gains, inputs.arm, samples, law.slips, observer.twist, motion):
            return Cause.NO_ESTIMATE.value
        if config.observer.nis_likely < config.observer.nis_slip:  # else it makes no difference
            motion.load = load_of_motion(config, state, outputs.gains, inputs.arm, spatial(samples[0].wrench))
        if config.estimator.on != 0:
            pad_variances(config.estimator, inputs.arm, motion)
            if config.command.interface != Interface.EFFORT:
                _put_twist_now(config, state, inputs, motion.v_ee)
        if not observe(config.observer, observer, history, motion, sample.stamp_ns, queue.samples, queue.count):
            return Cause.NO_ESTIMATE.value
        _put_estimate(observer, outputs.estimate)
        samples[0].slip_twist[:] = observer.twist
        if config.cycle.corrects_follow != 0:
            outputs.follow_error[:] = observer.error
    else:
        linear, angular = config.cycle.dead_band_linear, config.cycle.dead_band_angular
        if linear != 0.0 or angular != 0.0:
            v_s = spatial(config.law.contact[0].slip_axes) * spatial(samples[0].slip_twist)
            put_spatial(samples[0].slip_twist, beyond_dead_band(v_s, linear, angular))
        _adapt_slip_gain(config, state, outputs)
    if outputs.gains.gains.kappa != 0.0:
        _limit_internal_gain(config, state, outputs)
    if config.cycle.gate_shut != 0:
        for k in range(config.law.contacts):
            samples[k].slip_twist[:] = 0.0
    if config.governor.mode != Governing.OFF:
        feel_pad(config, task, state, outputs, (sample.stamp_ns - law.stamp_ns) * 1e-9)
    return Cause.NONE.value


@part
def _put_twist_now(config: ControllerConfig, state: ArmState, inputs: CycleInputs, twist: Array) -> None:
    """Write the pad's twist of now (6,) {w}: the law's is that of the commands under way.

    So is its Jacobian: what that changes on the way there is taken off.
    """
    _put_twist_of_joints(config, state, inputs, twist)
    for i in range(6):
        twist[i] -= config.cycle.drive_lag_s * inputs.arm.jdot_qd[i]


@part
def _put_twist_of_joints(config: ControllerConfig, state: ArmState, inputs: CycleInputs, twist: Array) -> None:
    """Write the twist (6,) {w} that the joints' velocities of now give the pad: zero where none moves."""
    for i in range(6):
        twist[i] = 0.0
        for j in range(config.law.joints):
            twist[i] += inputs.arm.J[i, j] * state.estimate.velocity[j]


@part
def command(
    config: ControllerConfig, task: TaskState, state: ArmState, inputs: CycleInputs, outputs: CycleOutputs, lead: bool
) -> int:
    """Evaluate the law on what `sense` has found; return why it could not be, Cause.NONE where it could."""
    law, sample = state.law, state.joint.answers
    dt, slipping = (sample.stamp_ns - law.stamp_ns) * 1e-9, state.pad.estimate.slipping
    if config.giving_up.witness != 0 and config.giving_up.on != 0 and slipping == 0:
        outputs.samples[0].slip_twist[:] = 0.0  # nor may it move the pad on the object: a wrong lever stops the arm
    if not _reference(config, task, state, outputs, lead):
        return Cause.BAD_REFERENCE.value
    error = (vec(inputs.arm.position) - vec(outputs.reference.position)).norm()
    v_s = slip_velocity(config.law.contact[0], outputs.samples[0])
    fall = state.observed.fall_speed
    judge_compensation(config.giving_up, law.given_up, outputs.gains.gains, v_s, slipping, error, fall, dt)
    integrate_slips(config.law, outputs.samples, law.slips, dt, outputs.slips)
    if config.cycle.slip_ahead_s > 0.0:
        _foresee_slip(config, state, inputs, outputs)
    evaluate(config.law, inputs.arm, sample, law, outputs)
    if config.governor.mode != Governing.OFF and outputs.law.ok != 0:
        factor = guard(config, task, state, inputs.arm, outputs, held(config, state, outputs.gains))
        if factor < 1.0:
            scale_acceleration(config.law, inputs.arm, sample, law, factor, outputs)
    outputs.evaluated = outputs.law.ok
    return Cause.NONE.value if outputs.law.ok != 0 else Cause.NO_TORQUE.value


@part
def _foresee_slip(config: ControllerConfig, state: ArmState, inputs: CycleInputs, outputs: CycleOutputs) -> None:
    """Replace the slip velocity by the one to which the commands under way lead, as the joints are, see `foresee`.

    Until then the pad's twist changes by what is known, and the object's as the wrench accelerates it now. Else the law
    would answer for as long as drives take to what it has answered already. No larger than now: where the object
    nearly holds, its acceleration changes with the pad's, and what is predicted is none.

    Implements: ours: v_s + J (qd_commanded - qd) - t (G^T a_o + Phi2), a predictor after O. J. M. Smith, 1957.
    """
    contact, sample, now = config.law.contact[0], outputs.samples[0], np.zeros(6)
    v_s = slip_velocity(contact, sample)
    if v_s.dot(v_s) == 0.0:
        return
    _put_twist_now(config, state, inputs, now)
    follow = spatial(outputs.motion.follow)
    change = spatial(inputs.arm.twist) - spatial(now) - config.cycle.slip_ahead_s * follow
    error = config.cycle.slip_ahead_s * spatial(outputs.follow_error)
    ahead = v_s + spatial(contact.slip_axes) * (mat(inputs.arm.rotation).T() @ change - error)
    gains = outputs.gains.gains
    most, speed = slip_speed(gains, v_s), slip_speed(gains, ahead)
    put_spatial(sample.slip_twist, (most / speed) * ahead if speed > most else ahead)


@part
def _adapt_slip_gain(config: ControllerConfig, state: ArmState, outputs: CycleOutputs) -> None:
    """Lower k_s to what the measured delays allow, where it is free to be chosen."""
    if config.cycle.k_s_adapts == 0:
        return
    held, late = whole_cycles(state.law.slip_latency, config.cycle.period_ns)
    if held != state.law.held or late != state.law.late:  # they seldom change
        state.law.held, state.law.late = held, late
        state.law.k_s_limit = held_sample_limit(held, late) / (1e-9 * config.cycle.period_ns) / config.cycle.k_s_margin
    outputs.gains.gains.k_s = min(outputs.gains.gains.k_s, state.law.k_s_limit)


@part
def _limit_internal_gain(config: ControllerConfig, state: ArmState, outputs: CycleOutputs) -> None:
    """Lower kappa to what the measured delay from a wrench to its answer, and the drives' lag, allow."""
    gains, late_ns = outputs.gains.gains, 0
    for k in range(config.law.contacts):
        late_ns = max(late_ns, state.joint.answers.stamp_ns - state.wrench_inputs[k].stamp_ns)
    delay_s = config.cycle.drive_lag_s + 1e-9 * (config.cycle.period_ns + state.latency.most_ns + late_ns)
    least = min(gains.M_D[0], gains.M_D[1], gains.M_D[2])
    most = internal_gain_limit(least, config.cycle.pad_stiffness, delay_s)
    gains.kappa = min(gains.kappa, config.cycle.kappa_share * most)


@part
def _reference(config: ControllerConfig, task: TaskState, state: ArmState, outputs: CycleOutputs, lead: bool) -> bool:
    """Write the desired motion of this cycle; return whether it is finite.

    A path by topic or towards a goal is that of the first pad; the other pads keep to the object as they held it when
    the law began. A built-in path each pad runs through from where it was then.
    """
    law = state.law
    keeps = not lead and (task.reference_known != 0 or config.stream.on != 0 or config.goals.on != 0)
    if state.reference_known != 0:
        desired = read_reference(state.reference)
    elif keeps:
        desired = carried(read_reference(task.desired), state.grasp)
    elif task.reference_known != 0:
        desired = read_reference(task.reference)
    elif config.governor.mode != Governing.OFF:
        desired = governed_reference(config, task, state, lead)
    elif config.goals.on != 0:
        desired = follow_goal(task, state)
    else:
        t = (state.joint.answers.stamp_ns - task.start_ns) * 1e-9 - config.cycle.start_s
        desired = reference_at(config.path, t, law.start_position, law.start_rotation)
    if not keeps and (task.path.scale != 1.0 or task.path.rate != 0.0):
        desired = scaled(desired, task.path)
    put_reference(outputs.reference, desired)
    if lead:
        task.desired = outputs.reference
    finite = all_finite(outputs.reference.position) and all_finite(outputs.reference.twist)
    finite = finite and all_finite(outputs.reference.acceleration)
    for k in range(3):
        finite = finite and all_finite(outputs.reference.rotation[k])
    return finite


@part
def _finish(
    config: ControllerConfig,
    state: ArmState,
    inputs: CycleInputs,
    outputs: CycleOutputs,
    q: Array,
    qd: Array,
    felt: Array,
    law_at_work: bool,
) -> None:
    """Add limit avoidance, pass the effort limiter, and write the outcome.

    Args:
        config, state, inputs, outputs: of the arm; `outputs.wanted` is what goes in.
        q, qd: joint state [rad], [rad/s].
        felt: measured joint efforts, where a pause makes the limiter restart [N m].
        law_at_work: whether the effort is the law's; then the pad's speed is limited too.
    """
    n, now_ns, by_effort = config.law.joints, inputs.now_ns, config.command.interface == Interface.EFFORT
    moves_s = min(_passed_s(config, state, inputs), 1e-9 * config.motion.drive.longest_step_ns)
    if needs_restart(config.motion.drive, state.limiter, now_ns):
        # Loops of the drives overcome friction, which the model does not have: there it begins with gravity.
        feel, friction = np.zeros(MAX_JOINTS), config.estimator.friction
        if by_effort:
            feel[:n] = felt[:n]
        start_limiter(config.motion.drive, state.limiter, n, feel, state.law.gravity, qd, friction, now_ns)
        known = state.motion.started == 0 or inputs.arm.M[0, 0] > 0.0  # else nothing tells where the drives are by now
        if known and not by_effort:
            _start_motion(config, state, q, qd)
            moves_s = min(moves_s, 1e-9 * config.motion.drive.period_ns)
    torque, clipped = np.empty(MAX_JOINTS), np.zeros(MAX_JOINTS, np.int64)
    torque[:n] = outputs.wanted[:n]
    if config.estimator.on != 0:
        _oppose_disturbance(config, state, inputs, torque)
    avoid_limits(config.motion, n, q, qd, inputs.arm, law_at_work, torque)
    if inputs.arm.M[0, 0] > 0.0:
        estimator, limit = config.estimator, config.law.effort_limit
        watch_drive_delay(estimator, state.drive_delay, state.estimate, inputs.arm.M, state.limiter.effort, limit)
    finite = limit_effort(config.motion.drive, state.limiter, n, torque, now_ns, clipped, outputs.limited)
    if not by_effort:
        _move(config, state, inputs, outputs, moves_s)
    _remember_input(config, state, inputs, by_effort)
    if config.estimator.on != 0:
        publish_joints(state.estimate, outputs.joints)
    saturated = 0
    for j in range(n):
        outputs.effort[j] = state.limiter.effort[j]
        if config.cycle.leaves_gravity != 0:
            outputs.effort[j] -= state.law.gravity[j]
        if by_effort:
            outputs.command[j] = outputs.effort[j]
        outputs.saturated[j] = 1 if clipped[j] != 0 or (law_at_work and outputs.law.saturated[j] != 0) else 0
        saturated += outputs.saturated[j]
    state.since.saturated_ns = since_when(state.since.saturated_ns, saturated != 0, now_ns)
    state.now_ns = now_ns
    outputs.answered = 1
    outputs.ok = 1 if law_at_work and finite else 0


@part
def _start_motion(config: ControllerConfig, state: ArmState, q: Array, qd: Array) -> None:
    """Begin with commands; after a pause where the joints are, not where the last command led: drives may have braked.

    Args:
        config, state: of the arm.
        q, qd: joint state of this cycle; that to which commands lead, where joints are estimated [rad], [rad/s].
    """
    if config.estimator.on != 0 and state.estimate.started != 0 and state.motion.started != 0:
        start_motion(config.command, state.motion, state.estimate.position, state.estimate.velocity)
        state.estimate.started = 0
    else:
        start_motion(config.command, state.motion, q, qd)


@part
def _passed_s(config: ControllerConfig, state: ArmState, inputs: CycleInputs) -> float:
    """Return the time since the last command [s], no longer than a few control periods."""
    return float(min(max(inputs.now_ns - state.now_ns, 0), LONGEST_PAUSE * config.cycle.period_ns) * 1e-9)


@part
def _oppose_disturbance(config: ControllerConfig, state: ArmState, inputs: CycleInputs, torque: Array) -> None:
    """Take what the model of the arm leaves out off the effort; without a good joint state as in the cycle before."""
    if inputs.arm.M[0, 0] > 0.0:
        dt, arm = _passed_s(config, state, inputs), inputs.arm
        h, of_wrench = np.empty(6), np.zeros(MAX_JOINTS)
        _put_own_wrench(config, state, inputs, h)
        for j in range(config.law.joints):
            for i in range(6):
                of_wrench[j] += arm.J[i, j] * h[i]
        fault = state.mode.mode == Mode.FAULT
        judged = config.tare.duration_ns == 0 or state.tare.rough != 0
        oppose_disturbance(config.estimator, state.estimate, arm.M, of_wrench, dt, fault, judged, torque)
    else:
        for j in range(config.law.joints):
            torque[j] += state.estimate.taken_off[j]


@part
def _move(config: ControllerConfig, state: ArmState, inputs: CycleInputs, outputs: CycleOutputs, dt: float) -> None:
    """Write the velocity or position that the effort makes of the last one; without the law it comes to rest.

    A short gap of good joint states is bridged with the velocity before. A pause counts no longer than in the effort
    limiter, and not at all where the command begins anew: drives that have come to rest at the last command meanwhile
    would take what it is worth in one period.

    Args:
        config, state, inputs, outputs: of the arm.
        dt: time that the command moves on [s].
    """
    motion, limited = state.motion, np.zeros(MAX_JOINTS, np.int64)
    estimate = state.estimate
    if follows(state.mode.mode):
        qdd = np.zeros(MAX_JOINTS)
        _acceleration(config, state, inputs, qdd)
        advance_motion(config.command, motion, qdd, estimate.velocity, dt, limited)
        ignored = ignored_joint(config.command, motion, estimate.velocity, dt)
        if ignored >= 0:
            find(estimate, Finding.IGNORED.value, ignored, estimate.velocity[ignored], motion.expected[ignored])
    else:
        stop_motion(config.command, motion, dt, limited)
        if estimate.finding == Finding.IGNORED:
            return_to(config.command, motion, estimate.position, dt)
    for j in range(config.law.joints):
        position = config.command.interface == Interface.POSITION
        outputs.command[j] = motion.position[j] if position else motion.velocity[j]


@part
def _acceleration(config: ControllerConfig, state: ArmState, inputs: CycleInputs, qdd: Array) -> None:
    """Write the acceleration that the effort gives the joints (n,) [rad/s^2]; zeros without a good joint state."""
    h, arm = np.empty(6), inputs.arm
    if arm.M[0, 0] > 0.0:
        _put_own_wrench(config, state, inputs, h)
        if not joint_acceleration(config.law.joints, arm.M, arm.bias, arm.J, h, state.limiter.effort, qdd):
            qdd[:] = 0.0


@part
def _remember_input(config: ControllerConfig, state: ArmState, inputs: CycleInputs, by_effort: bool) -> None:
    """Keep what the joints are known to do: the acceleration by the effort, or the velocity that drives follow.

    Without a good joint state the effort goes on as it was, and so does the acceleration.
    """
    u = state.estimate.inputs[state.estimate.newest].copy()
    if not by_effort:
        u[:] = state.motion.velocity
    elif inputs.arm.M[0, 0] > 0.0:
        _acceleration(config, state, inputs, u)
    remember_input(config.estimator, state.estimate, u)


@part
def _sense_all(
    configs: Records[ControllerConfig],
    task: TaskState,
    states: Records[ArmState],
    history: Array,
    inputs: Records[CycleInputs],
    outputs: Records[CycleOutputs],
) -> None:
    """Let every arm at work sense; where one cannot, it and the others hold."""
    n, failed = len(states), False
    rows = history.shape[0] // n
    for k in range(n):
        if _at_work(states[k], outputs[k]):
            level, own = outputs[k].decision.level, history[k * rows : (k + 1) * rows]
            unknown = level == Level.OBSERVED or level == Level.SLOWING
            cause = sense(configs[k], task, states[k], own, inputs[k], outputs[k], unknown)
            outputs[k].decision.cause, failed = cause, failed or cause != Cause.NONE
    if failed:
        for k in range(n):
            if _at_work(states[k], outputs[k]):
                _give_way(configs[k], task, states[k], inputs[k], outputs[k], k == 0)


@part
def _give_way(
    config: ControllerConfig, task: TaskState, state: ArmState, inputs: CycleInputs, outputs: CycleOutputs, lead: bool
) -> None:
    """Hold an arm because it, or another one, could not sense."""
    if outputs.decision.cause != Cause.NONE:
        _hold_without_law(config, task, state, inputs, outputs, outputs.decision.cause)
    else:
        _hold_with_the_others(config, state, inputs, outputs)
        _hold(config, task, state, inputs, outputs, fine(outputs.health.wrench), lead)


@part
def _share_speed(states: Records[ArmState], outputs: Records[CycleOutputs]) -> None:
    """Let all arms count as the one that follows worst, where the law has worked for all."""
    speed, n = states[0].observed.path_speed, len(states)
    for k in range(n):
        if outputs[k].decision.works == 0:
            return
        speed = min(speed, states[k].observed.path_speed)
    for k in range(n):
        states[k].observed.path_speed = speed


@kernel(INT(IN1, OUT1, IN1, OUT1))
def cycle(config_buffer: Array, state_buffer: Array, inputs_buffer: Array, outputs_buffer: Array) -> int:
    """Answer the joint states that wait for it; return how many arms have an effort.

    Args:
        config_buffer: CONFIG of every arm.
        state_buffer: TASK_STATE, ARM_STATE of every arm, and the histories of their observers; changed.
        inputs_buffer: INPUTS of every arm.
        outputs_buffer: OUTPUTS of every arm.
    """
    configs, inputs, outputs = (
        records(config_buffer, CONFIG), records(inputs_buffer, INPUTS), records(outputs_buffer, OUTPUTS)
    )  # fmt: skip
    n = len(configs)
    end = TASK_SIZE + n * ARM_SIZE
    task, states = record(state_buffer[:TASK_SIZE], TASK_STATE), records(state_buffer[TASK_SIZE:end], ARM_STATE)
    history = state_buffer[end:].reshape(-1, ROW_SIZE)
    alone = _begin_together(task, states, inputs)
    together = _all_at_rest(configs, states, inputs)
    for k in range(n):
        if inputs[k].present != 0:
            _look(configs[k], task, states[k], inputs[k], outputs[k], k == 0, alone, together)
    _agree(configs, task, states, inputs, outputs, alone)
    for k in range(n):
        if inputs[k].present != 0:
            _prepare(configs[k], task, states[k], inputs[k], outputs[k], k == 0)
    path_speed = _path_speed(configs, states, outputs)
    if _at_work(states[0], outputs[0]):
        _move_on(configs[0], task, states[0], path_speed)
    _sense_all(configs, task, states, history, inputs, outputs)
    if configs[0].governor.mode != Governing.OFF and _at_work(states[0], outputs[0]):
        agree_on_friction(configs[0], task, states)
        step_on_path(configs[0], task, states, inputs[0].arm, outputs[0], path_speed)
    answered, holds = 0, False
    for k in range(n):
        if _at_work(states[k], outputs[k]):
            _follow(configs[k], task, states[k], inputs[k], outputs[k], k == 0)
    _share_speed(states, outputs)
    for k in range(n):
        if inputs[k].present != 0:
            if outputs[k].decision.never_seen == 0:
                states[k].queue.count = 0
            _end(configs[k], task, states[k], inputs[k], outputs[k])
            holds = holds or not follows(states[k].mode.mode)
            answered += outputs[k].answered
    if holds:
        screen(configs[0], task, states[0], False)
    return answered


@kernel(INT(IN1, OUT1, IN1, OUT1, INT))
def watchdog(config_buffer: Array, state_buffer: Array, inputs_buffer: Array, outputs_buffer: Array, arm: int) -> int:
    """Answer that joint states of an arm stay away: HOLD, efforts go to gravity compensation where the arm was.

    Where no command was given before, there is none now.

    Args:
        config_buffer, state_buffer, inputs_buffer, outputs_buffer: as in `cycle`.
        arm: number of the arm.

    Returns:
        1 where effort or mode have changed by it.
    """
    config, inputs = records(config_buffer, CONFIG)[arm], records(inputs_buffer, INPUTS)[arm]
    outputs, task = records(outputs_buffer, OUTPUTS)[arm], record(state_buffer[:TASK_SIZE], TASK_STATE)
    begin = TASK_SIZE + arm * ARM_SIZE
    state = record(state_buffer[begin : begin + ARM_SIZE], ARM_STATE)
    n = config.law.joints
    _begin(config, task, state, inputs, outputs, state.law.stamp_ns, arm == 0)
    outputs.health.joint = Fault.SILENT.value
    mode, since, enabled, cause = state.mode.mode, state.mode.good_since_ns, state.mode.enabled, state.mode.reason.cause
    prefix, detail = state.mode.reason.prefix, state.mode.reason.detail
    effort, velocity = state.limiter.effort.copy(), state.motion.velocity.copy()
    reasons = TransitionReasons(NOTHING, NOTHING, of_fault(Cause.INPUT, Input.JOINT_STATE, Fault.SILENT), NOTHING)
    next_mode(config.modes, state.mode, reasons, inputs.request, inputs.now_ns)
    task.path.scale, task.path.rate, state.hold.known = 0.0, 0.0, 0
    outputs.wanted[:n] = state.law.gravity[:n]
    if state.limiter.started != 0:
        go_on(config.motion.drive, state.limiter, inputs.now_ns)
        rest = np.zeros(MAX_JOINTS)
        _finish(config, state, inputs, outputs, state.law.position, rest, rest, False)
    else:
        _leave_to_drives(config, state, inputs)  # as before
    _end(config, task, state, inputs, outputs)
    if not follows(state.mode.mode):
        first = record(state_buffer[TASK_SIZE : TASK_SIZE + ARM_SIZE], ARM_STATE)
        screen(records(config_buffer, CONFIG)[0], task, first, False)
    same_mode = state.mode.mode == mode and state.mode.good_since_ns == since and state.mode.enabled == enabled
    same_mode = same_mode and state.mode.reason.cause == cause and state.mode.reason.prefix == prefix
    same = same_mode and state.mode.reason.detail == detail
    for j in range(n):
        same = same and state.limiter.effort[j] == effort[j] and state.motion.velocity[j] == velocity[j]
    return 0 if same else 1


@kernel(VOID(IN1, IN1, IN1, OUT1))
def describe(config_buffer: Array, inputs_buffer: Array, outputs_buffer: Array, symbols_buffer: Array) -> None:
    """Fill the SYMBOLS of an arm's cycle, when something looks at them.

    Args:
        config_buffer, inputs_buffer, outputs_buffer: CONFIG, INPUTS, OUTPUTS of the arm, after `cycle`.
        symbols_buffer: SYMBOLS.
    """
    config, out = record(config_buffer, CONFIG), record(symbols_buffer, SYMBOLS)
    inputs, outputs = record(inputs_buffer, INPUTS), record(outputs_buffer, OUTPUTS)
    no_symbols(outputs.effort, outputs.saturated, symbols_buffer)
    if outputs.ok != 0:
        law, estimate = outputs.law, outputs.estimate
        symbols(config.law, outputs.gains, inputs.arm, outputs.slips, outputs.reference, law, estimate, out)
        for j in range(config.law.joints):
            out.effort[j], out.saturated[j] = outputs.effort[j], outputs.saturated[j]
