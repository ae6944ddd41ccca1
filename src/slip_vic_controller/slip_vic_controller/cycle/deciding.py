"""What an arm does in this cycle: faults of its inputs, what speaks against the law, and the mode that follows."""

from __future__ import annotations

from slip_core.compiled import part
from slip_vic_controller.arm.joint_estimate import clear_findings
from slip_vic_controller.arm.tare import is_unchecked
from slip_vic_controller.cycle.beginning import begin_cycle, begin_law
from slip_vic_controller.cycle.judging import judge, slows
from slip_vic_controller.cycle.ledger import put_time
from slip_vic_controller.cycle.taring import AtRest, tare
from slip_vic_controller.cycle.wrench import model_wrench, overloaded_joint, shows_loss
from slip_vic_controller.safety.conditions import (
    NOTHING,
    Missing,
    Reason,
    Why,
    because,
    of_fault,
    passed_ns,
    put_why,
    read_why,
    since_when,
)
from slip_vic_controller.safety.latency import forget_latency, measure_latency
from slip_vic_controller.safety.modes import Mode, Request, follows, holds_for, next_mode
from slip_vic_controller.safety.validation import fine, forget_repeats, frozen, usable, vector_validity
from slip_vic_controller.sizes import MAX_CONTACTS, NEVER
from slip_vic_controller.state import ArmState, ControllerConfig, CycleInputs, CycleOutputs, Step, TaskState


@part
def decide_mode(
    config: ControllerConfig,
    task: TaskState,
    state: ArmState,
    inputs: CycleInputs,
    outputs: CycleOutputs,
    lead: bool,
    alone: bool,
    together: AtRest,
) -> None:
    """Classify the inputs of an arm and decide the mode of this cycle.

    lead: whether it is the first arm; alone: whether another arm is not answered in this cycle; together: see `AtRest`.
    """
    decision = outputs.decision
    decision.step, decision.request = Step.NONE.value, inputs.request
    decision.before = state.mode
    if inputs.request == Request.RESET_FAULT:
        task.forgets = 1
    fault = inputs.health.joint if inputs.health_given != 0 else state.joint.pending_fault
    state.joint.pending = 0
    begin_cycle(config, task, state, inputs, outputs, state.joint.answers.stamp_ns, lead)
    if fault == Reason.RESTARTED and state.law.known != 0:
        # Everything starts again; the limiter continues from the last command, where that is recent: the joints feel it
        state.law.known = 0
        _wait(config, state, inputs, of_fault(Reason.JOINTS_RESTARTED.value, fault), state.limiter.started)
    if config.cycle.models_wrench != 0:
        _count_wrench_as_good(config, state, inputs)
    decision.never_seen = _never_seen(config, state)
    missing = inputs.missing | decision.never_seen
    if state.law.known == 0 and not usable(fault):
        missing |= Missing.GOOD_JOINT_STATE.value
    if missing != 0:
        _wait(config, state, inputs, because(Reason.WAITS.value, missing), 0)
        return
    _classify_inputs(config, state, inputs, outputs, fault, alone)
    state.wrench_modelled = 0
    if config.cycle.models_wrench != 0 or (not fine(outputs.health.wrench) and state.law.known != 0):
        model_wrench(config, task, state, inputs)
    if state.wrench_modelled != 0 and outputs.health.wrench == Reason.FROZEN and shows_loss(config, state, inputs):
        state.wrench_modelled = 0  # what reads the same is right then
    if state.law.known == 0:
        begin_law(config, task, state, inputs, outputs, lead)
        heavy = _too_heavy(config, state, inputs)
        if heavy.reason != Reason.NONE:
            state.law.known = 0
            _wait(config, state, inputs, heavy, 0)
            return
    if is_unchecked(config.tare, state.tare):
        model_wrench(config, task, state, inputs)
    _decide(config, task, state, inputs, outputs, together)


@part
def _too_heavy(config: ControllerConfig, state: ArmState, inputs: CycleInputs) -> Why:
    """Return why the arm cannot be held where it is, NOTHING where it can.

    No drive can either, so the arm sinks until its lever is short enough: to begin there is for a user to say.
    """
    joint, torque = overloaded_joint(config, state, inputs)
    if joint >= 0:
        return Why(Reason.TOO_HEAVY.value, 0, 0, joint, torque, config.law.effort_limit[joint])
    asked = inputs.request == Request.ENABLE or inputs.request == Request.RESET_FAULT
    refused = state.mode.mode == Mode.WAITING_INPUT and state.mode.reason.reason == Reason.TOO_HEAVY
    return read_why(state.mode.reason) if refused and not asked else NOTHING


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
def _wait(config: ControllerConfig, state: ArmState, inputs: CycleInputs, missing: Why, keep_limiter: int) -> None:
    """Give no effort. Without a command the arm may move, so HOLD restarts from the pose found then."""
    next_mode(config.modes, state.mode, missing, inputs.request, inputs.now_ns)
    state.limiter.started, state.now_ns, state.hold.known = keep_limiter, inputs.now_ns, 0
    state.hold.load_error[:] = 0.0
    state.estimate.started, state.tare.watched = 0, 0
    forget_latency(state.latency)


@part
def _count_wrench_as_good(config: ControllerConfig, state: ArmState, inputs: CycleInputs) -> None:
    """Let the inputs of the wrench count as good, where there is no sensor."""
    stamp_ns = state.joint.answers.stamp_ns
    for k in range(config.law.contacts):
        own = state.wrench_inputs[k]
        own.seen, own.known, own.fault, own.bad = 1, 1, Reason.NONE.value, 0
        own.stamp_ns, own.arrival_ns, own.equal_since_ns = stamp_ns, inputs.now_ns, stamp_ns


@part
def _classify_inputs(
    config: ControllerConfig, state: ArmState, inputs: CycleInputs, outputs: CycleOutputs, fault: int, alone: bool
) -> None:
    """Write the fault of each input in this cycle, and the stamps of the samples that it uses.

    alone: whether another arm is not answered in this cycle.
    """
    stamp_ns = state.joint.answers.stamp_ns
    # What is frozen stays so while the path comes to rest, and in the HOLD after it.
    moves = state.joint.moves != 0 or holds_for(state.mode, Reason.WRENCH.value, Reason.FROZEN.value)
    moves = moves or state.conditions[Reason.WRENCH_SLOWS].since_ns != NEVER
    if inputs.health_given == 0:
        health = outputs.health
        health.joint, health.wrench, health.slip, health.outside = fault, 0, 0, state.outside
        for k in range(config.law.contacts):
            wrench = vector_validity(config.wrench, state.wrench_inputs[k], inputs.now_ns, stamp_ns, moves)
            slip = vector_validity(config.slip, state.slip_inputs[k], inputs.now_ns, stamp_ns, moves)
            health.wrench, health.slip = max(health.wrench, wrench), max(health.slip, slip)
    if alone:
        outputs.health.outside = Reason.OTHER_ARM.value
    for k in range(config.law.contacts):
        put_time(outputs.ledger, 3 + 4 * k, state.wrench_inputs[k].stamp_ns)
        put_time(outputs.ledger, 5 + 4 * k, state.slip_inputs[k].stamp_ns)


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
    bad = not (usable(fault) or fault == Reason.NOT_RUN)
    state.joint_bad_ns = since_when(state.joint_bad_ns, bad, now_ns)
    if bad and inputs.arm.M[0, 0] == 0.0:  # the model does not know where the arm is either
        decision.step, decision.entered = Step.BRIDGE.value, state.mode.mode
        return
    if inputs.request == Request.ENABLE or inputs.request == Request.RESET_FAULT:
        # A user who enables the law, or ends a fault, has checked that the clocks agree and nothing is late.
        forget_latency(state.latency)
        forget_repeats(state.wrench_inputs)
        if state.estimate.unmeasured[0] == 0:  # else no user can be right: the joint states contradict themselves
            state.joint.equal_since_ns = now_ns
    if inputs.request == Request.RESET_FAULT:
        clear_findings(state.estimate)  # what is still wrong is found again
    measure_latency(state.latency, now_ns, sample.stamp_ns, now_ns - state.now_ns)
    request = _rest_before_hold(config, state, inputs.request, now_ns)
    reweighed = config.tare.duration_ns > 0 and not bad and tare(config, state, inputs, together)
    decision.reweighed = 1 if reweighed else 0
    freezes = frozen(config.joint, state.joint, now_ns)
    why = judge(config, task, state, outputs.health, freezes, now_ns)
    decision.entered = state.mode.mode
    next_mode(config.modes, state.mode, why, request, now_ns)
    decision.step, decision.request, decision.freezes = Step.ANSWER.value, request, 1 if freezes else 0
    decision.slows = 1 if slows(config, state, now_ns) else 0
    put_why(decision.why, why)


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
