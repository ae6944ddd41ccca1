"""What an arm does in this cycle: faults of its inputs, where its law begins, what speaks against it, and the mode."""

from __future__ import annotations

from slip_core.compiled import part
from slip_core.records import WholeArray
from slip_core.vectors import IDENTITY, ZERO, mat, put, put_mat, vec
from slip_core.vectors import NOTHING as NO_MOTION
from slip_vic_controller.arm.joint_estimate import clear_findings
from slip_vic_controller.arm.tare import is_unchecked
from slip_vic_controller.cycle.contact import begin_pad
from slip_vic_controller.cycle.holding import forget_pad, wait
from slip_vic_controller.cycle.judging import judge
from slip_vic_controller.cycle.sensing import gains_now
from slip_vic_controller.cycle.taring import AtRest, tare
from slip_vic_controller.cycle.wrench import arm_of_load, model_wrench
from slip_vic_controller.governor.governor import start_governor
from slip_vic_controller.governor.plan import Governing
from slip_vic_controller.law.contact import pad_rotation
from slip_vic_controller.path.goals import rest_at
from slip_vic_controller.path.paths import Reference
from slip_vic_controller.path.stream import rest_stream
from slip_vic_controller.safety.conditions import (
    NOTHING,
    Missing,
    Reason,
    Why,
    of_fault,
    passed_ns,
    read_why,
)
from slip_vic_controller.safety.hold import carry_load
from slip_vic_controller.safety.latency import forget_latency, measure_latency
from slip_vic_controller.safety.modes import Mode, Request, follows, holds_for, next_mode
from slip_vic_controller.safety.validation import usable, vector_validity
from slip_vic_controller.sizes import MAX_CONTACTS, NEVER
from slip_vic_controller.state import ArmCycle, ArmState, ControllerConfig, CycleInputs


@part
def decide(c: ArmCycle, alone: bool, together: AtRest) -> None:
    """Classify the inputs of an arm and decide the mode of this cycle.

    alone: whether another arm is not answered in this cycle; together: see `AtRest`.
    """
    config, task, state, inputs, outputs = c.config, c.task, c.state, c.inputs, c.outputs
    outputs.before, outputs.health = state.mode, inputs.health
    if state.cycles == 0:
        state.now_ns = inputs.now_ns
    if inputs.request == Request.RESET_FAULT:
        task.forgets = 1
    fault = inputs.health.joint if inputs.health_given != 0 else state.joint.pending_fault
    state.joint.pending = 0
    if fault == Reason.RESTARTED and state.law.known != 0:
        wait(c, of_fault(Reason.JOINTS_RESTARTED.value, fault))  # everything starts again
        return
    if config.models_wrench != 0:
        _count_wrench_as_good(config, state, inputs)
    missing = inputs.missing | _never_seen(config, state)
    if state.law.known == 0 and not usable(fault):
        missing |= Missing.GOOD_JOINT_STATE.value
    if missing != 0:
        wait(c, Why(Reason.WAITS.value, fault, 0, int(missing), 0.0, 0.0))
        return
    _classify_inputs(c, fault, alone)
    good, restarts = outputs.health.wrench == Reason.NONE, state.law.known == 0
    state.wrench_modelled = 0
    if config.models_wrench != 0 or not (good or restarts):
        model_wrench(c)
    if restarts:
        begin_law(c)
        heavy = _too_heavy(config, state, inputs)
        if heavy.reason != Reason.NONE:
            wait(c, heavy)
            return
    if is_unchecked(config.tare, state.tare):
        model_wrench(c)
    _obey(config, state, inputs)
    bad = not (usable(fault) or fault == Reason.NOT_RUN)
    if bad and inputs.arm.M[0, 0] == 0.0:
        silent = of_fault(Reason.JOINT_STATE.value, outputs.health.joint)
        next_mode(config.conditions, state.mode, silent, inputs.request, inputs.now_ns)
        outputs.decided = 1
        return
    stamp_ns, now_ns, resets = state.joint.answers.stamp_ns, inputs.now_ns, inputs.request == Request.RESET_FAULT
    measure_latency(state.latency, now_ns, stamp_ns, now_ns - state.now_ns)
    request = _rest_before_hold(config, state, inputs.request, now_ns)
    reweighed = config.tare.duration_ns > 0 and not bad and tare(c, together)
    why = judge(config, task, state, outputs.health, now_ns)
    next_mode(config.conditions, state.mode, why, request, now_ns)
    outputs.decided = 1
    if (resets or reweighed) and not follows(state.mode.mode):
        forget_pad(c)


@part
def _never_seen(config: ControllerConfig, state: ArmState) -> int:
    """Return the bits of the inputs that have never been seen: no command before every input was seen once."""
    bits = 0
    for k in range(config.law.contacts):
        if state.wrench_inputs[k].seen == 0:
            bits |= Missing.WRENCH.value << k
        if config.conditions.slip_needed != 0 and state.slip_inputs[k].seen == 0:
            bits |= Missing.WRENCH.value << (MAX_CONTACTS + k)
    return bits


@part
def _count_wrench_as_good(config: ControllerConfig, state: ArmState, inputs: CycleInputs) -> None:
    """Let the inputs of the wrench count as good, where there is no sensor."""
    stamp_ns = state.joint.answers.stamp_ns
    for k in range(config.law.contacts):
        own = state.wrench_inputs[k]
        own.seen, own.known, own.stamp_ns, own.arrival_ns, own.equal_since_ns = 1, 1, stamp_ns, inputs.now_ns, stamp_ns


@part
def _classify_inputs(c: ArmCycle, fault: int, alone: bool) -> None:
    """Write the fault of each input in this cycle, and the stamps of the samples that it uses.

    alone: whether another arm is not answered in this cycle.
    """
    config, state, inputs, outputs = c.config, c.state, c.inputs, c.outputs
    stamp_ns, health = state.joint.answers.stamp_ns, outputs.health
    # What is frozen stays so while the path comes to rest, and in the HOLD after it.
    moves = state.joint.moves != 0 or holds_for(state.mode, Reason.WRENCH.value, Reason.FROZEN.value)
    moves = moves or state.conditions[Reason.WRENCH_SLOWS].since_ns != NEVER
    if inputs.health_given == 0:
        health.joint, health.outside = fault, state.outside
    for k in range(config.law.contacts):
        wrench, slip = state.wrench_inputs[k], state.slip_inputs[k]
        if inputs.health_given == 0:
            health.wrench = max(health.wrench, vector_validity(config.wrench, wrench, inputs.now_ns, stamp_ns, moves))
            health.slip = max(health.slip, vector_validity(config.slip, slip, inputs.now_ns, stamp_ns, moves))
        put_time(outputs.ledger, 3 + 4 * k, wrench.stamp_ns)
        put_time(outputs.ledger, 5 + 4 * k, slip.stamp_ns)
    # What both sensors lag behind is the joint state's clock.
    stale = health.wrench == Reason.STALE and health.slip == Reason.STALE
    if stale and health.outside == Reason.NONE and not follows(state.mode.mode):
        health.outside = Reason.AHEAD.value
    if alone:
        health.outside = Reason.OTHER_ARM.value


@part
def put_time(ledger: WholeArray, at: int, time_ns: int) -> None:
    """Write a time [ns] as seconds and nanoseconds."""
    ledger[at], ledger[at + 1] = time_ns // 1_000_000_000, time_ns % 1_000_000_000


@part
def begin_law(c: ArmCycle) -> None:
    """Begin the law: the arm where it is, no slip; of the first arm also the trajectory, starting here and now."""
    config, task, state, outputs = c.config, c.task, c.state, c.outputs
    law, sample, n, arm = state.law, state.joint.answers, config.law.joints, c.inputs.arm
    law.known, law.stamp_ns = 1, sample.stamp_ns
    law.start_position[:], law.start_rotation[:] = arm.position, arm.rotation
    law.posture[:n] = config.posture[:n] if config.posture_given != 0 else sample.position[:n]
    law.position[:n], law.gravity[:n], law.e_previous[:] = sample.position[:n], arm.gravity[:n], 0.0
    for k in range(MAX_CONTACTS):
        put(law.slips[k].position, ZERO)
        put_mat(law.slips[k].rotation, IDENTITY)
    law.given_up.left_s, law.given_up.fast_s = 0.0, 0.0
    law.ramp = state.tuned
    law.ramp.begin_ns = sample.stamp_ns
    gains_now(state, sample.stamp_ns, outputs)
    begin_pad(config, state, arm, outputs.gains)
    if c.lead:
        task.start_ns = sample.stamp_ns
        if config.follows_stream != 0:
            rest_stream(task.stream, vec(arm.position), mat(arm.rotation))
        if config.follows_goals != 0:
            rest_at(task.goal, Reference(vec(arm.position), mat(arm.rotation), NO_MOTION, NO_MOTION))
        if config.governor.mode != Governing.OFF:
            start_governor(config.governor, task.governor, state.pad)


@part
def _too_heavy(config: ControllerConfig, state: ArmState, inputs: CycleInputs) -> Why:
    """Return why the arm cannot be held where it is, NOTHING where it can.

    No drive can either, so the arm sinks until its lever is short enough: to begin there is for a user to say.
    """
    torque = inputs.arm.gravity.copy()
    r = arm_of_load(config, state, pad_rotation(config.law.contact[0], state.law.slips[0]))
    carry_load(config.hold, state.hold, inputs.arm, r, torque)
    for j in range(config.law.joints):
        if abs(torque[j]) > config.law.effort_limit[j]:
            return Why(Reason.TOO_HEAVY.value, 0, 0, j, torque[j], config.law.effort_limit[j])
    asked = inputs.request == Request.ENABLE or inputs.request == Request.RESET_FAULT
    refused = state.mode.mode == Mode.WAITING_INPUT and state.mode.reason.reason == Reason.TOO_HEAVY
    return read_why(state.mode.reason) if refused and not asked else NOTHING


@part
def _obey(config: ControllerConfig, state: ArmState, inputs: CycleInputs) -> None:
    """Begin again with what a user who enables the law or ends a fault has seen to: clocks, sensors that repeat."""
    if inputs.request == Request.ENABLE or inputs.request == Request.RESET_FAULT:
        forget_latency(state.latency)
        for k in range(config.law.contacts):
            state.wrench_inputs[k].equal_since_ns = state.wrench_inputs[k].stamp_ns
        if state.estimate.unmeasured[0] == 0:  # else no user can be right: the joint states contradict themselves
            state.joint.equal_since_ns = inputs.now_ns
    if inputs.request == Request.RESET_FAULT:
        clear_findings(state.estimate)  # what is still wrong is found again


@part
def _rest_before_hold(config: ControllerConfig, state: ArmState, request: int, now_ns: int) -> int:
    """Let a user's HOLD begin when the path has come to rest: a sudden stop throws a weakly gripped object."""
    stays = request == Request.ENABLE or request == Request.RESET_FAULT or request == Request.FAILED
    stopping = state.conditions[Reason.STOPPING]
    if stays or not follows(state.mode.mode):
        asked = stopping.since_ns != NEVER
        stopping.since_ns = NEVER
        # An input that stopped the law on the way to rest does not take the user's wish away.
        return request if stays or not asked else Request.HOLD.value
    if request == Request.HOLD and stopping.since_ns == NEVER:
        stopping.since_ns = now_ns
    elif passed_ns(stopping, now_ns) >= config.conditions.slow_down_ns:
        stopping.since_ns = NEVER
        return Request.HOLD.value
    return Request.NONE.value  # a second request does not stop the path more suddenly
