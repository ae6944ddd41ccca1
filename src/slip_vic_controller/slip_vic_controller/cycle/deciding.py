"""What an arm does in this cycle: faults of its inputs, the tare, what speaks against the law, and the mode.

While slip is unknown, never as if there were none: the observer predicts it from the wrench alone for a bounded time;
then the path comes to rest, and the law continues with the prediction, or without compensation; then HOLD.
"""

from __future__ import annotations

import math

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.records import WholeArray
from slip_core.vectors import ZERO, Spatial, mat, put_spatial, spatial, vec
from slip_vic_controller.arm.estimator import clear_findings, unseen_ns
from slip_vic_controller.arm.tare import (
    MOVED,
    OUTLIER,
    add,
    add_slip,
    measure_at_rest,
    moved_most,
    start_tare,
    take_biases,
)
from slip_vic_controller.contact.estimate import SensorHealth
from slip_vic_controller.contact.friction_estimate import LEAST_FRICTION
from slip_vic_controller.contact.wrench_evidence import pull
from slip_vic_controller.cycle.modes import begin_law, forget_pad, wait
from slip_vic_controller.cycle.sensing import arm_of_load, model_wrench, tared_wrench
from slip_vic_controller.governor.layouts import PATH_MARGIN
from slip_vic_controller.governor.plan import Governing
from slip_vic_controller.law.arm import Arm
from slip_vic_controller.path.goals import GoalPhase
from slip_vic_controller.safety.conditions import (
    NOTHING,
    Health,
    Missing,
    Mode,
    Reason,
    Request,
    Why,
    because,
    find,
    first,
    follows,
    holds_for,
    lasted,
    next_mode,
    passed_ns,
    read_why,
    see,
    see_one_of,
)
from slip_vic_controller.safety.hold import carry_load, object_load
from slip_vic_controller.safety.limits import TRIP_SHARE
from slip_vic_controller.safety.validation import frozen, usable, vector_validity
from slip_vic_controller.sizes import MAX_CONTACTS, NEVER
from slip_vic_controller.state import ArmCycle, Arms, ArmState, ControllerConfig, CycleInputs, TaskState

# -- the tare -----------------------------------------------------------------------------------------


@part
def tare(c: ArmCycle, arms: Arms, alone: bool) -> bool:
    """Read the sensors at rest in HOLD, and subtract the biases from the samples of this cycle.

    Returns whether the object's weight was found and differs from before. Other arguments as in `decide`.
    """
    config, state, inputs = c.config, c.state, c.inputs
    tare, queue, mass_share = state.tare, state.queue, state.tare.mass_share
    if inputs.request == Request.TARE and not follows(state.mode.mode):
        start_tare(tare, NEVER)
        tare.watched = 0
    n, last, q = config.law.joints, state.joint.last, state.joint.answers.position
    # One that ends in this cycle is still the reason: what it finds is in use from the next one on.
    see(state.conditions, because(Reason.TARE.value, 0), tare.done == 0 and not follows(state.mode.mode), inputs.now_ns)
    if tare.done == 0 and state.mode.mode == Mode.HOLD:
        stamp_ns, wrench = state.joint.answers.stamp_ns, state.wrench_inputs[0]
        paused = inputs.now_ns - state.now_ns > config.joint.age_ns  # something else may have moved the arm
        if tare.watched == 0 or paused:
            tare.watched, tare.watched_from[:] = 1, q
        j = moved_most(n, q, tare.watched_from, MOVED)
        if j >= 0:
            find(state.estimate.found, Reason.MOVED_IN_TARE.value, j, q[j] - tare.watched_from[j], 0.0)
        six, (beyond, expected) = np.zeros(6), _wrench_at_rest(c, arms)
        all_measured = len(arms.states) == 1 or (c.task.begun != 0 and not alone)
        over = measure_at_rest(config.tare, tare, stamp_ns, last.position[:n], last.velocity[:n])
        for k in range(queue.count):
            if queue.samples[k].stamp_ns >= tare.begun_ns:
                add_slip(config.tare, tare, queue.samples[k].twist)
        if wrench.stamp_ns > tare.wrench_ns and all_measured:
            tare.wrench_ns = wrench.stamp_ns
            put_spatial(six, beyond)
            add(tare.wrench, six, 6)
        if over:
            take_biases(config.tare, tare, expected, stamp_ns, last.position[:n])
    elif tare.done == 0:
        tare.watched, tare.begun_ns = 0, NEVER
    for k in range(queue.count):
        for i in range(6):
            queue.samples[k].twist[i] -= tare.slip.bias[i]
    return bool(tare.mass_share != mass_share)


@part
def _wrench_at_rest(c: ArmCycle, arms: Arms) -> tuple[Spatial, Spatial]:
    """Return the object's wrench on the pad beyond that of the model, and that of the model [N, N m] {ee}.

    Of several arms, an equal share of the total force, without torque: a single wrench may contain internal force,
    because arms can press on each other.
    """
    config, state, R = c.config, c.state, mat(c.inputs.arm.rotation)
    expected, beyond, n = object_load(config.hold, R, R @ arm_of_load(config, state)), ZERO, len(arms.states)
    if n == 1:
        return tared_wrench(config, state, R) - expected, expected
    for k in range(n):
        R_k = mat(arms.inputs[k].arm.rotation)
        force = R_k @ tared_wrench(arms.configs[k], arms.states[k], R_k).linear
        beyond = beyond + (force - vec(arms.configs[k].hold.weight))
    return Spatial(R.T() @ ((1.0 / n) * beyond), ZERO), Spatial(expected.linear, ZERO)


# -- the conditions of the table: where each is tested ------------------------------------------------


@part
def judge(config: ControllerConfig, task: TaskState, state: ArmState, health: Health, now_ns: int) -> Why:
    """Return what speaks against the law in this cycle.

    Args:
        config, task, state: of the controller, of all arms and of this one; the conditions in state are changed.
        health: of the inputs.
        now_ns: the controller's clock.
    """
    sample = state.joint.answers
    find_faults(config, state, health, sample.velocity, now_ns)
    find_bad_inputs(config, state, health, now_ns)
    find_reasons_to_wait(config, task, state, now_ns)
    find_hindrances(config, task, state, now_ns)
    return first(config.conditions, state.conditions, now_ns)


@part
def find_faults(config: ControllerConfig, state: ArmState, health: Health, qd: Array, now_ns: int) -> None:
    """Look for conditions that latch; qd: joint velocities (n,) [rad/s]."""
    rows = state.conditions
    _find_speeds(config, state, qd, now_ns)
    see_one_of(rows, Reason.VELOCITY.value, Reason.MOVED_IN_TARE.value, read_why(state.estimate.found), now_ns)
    # Noise of the joints' velocities can grow to such a slip velocity at rest, between two samples of a camera.
    v = state.pad.contact.variance
    doubt = OUTLIER * math.sqrt(max(v[0], v[1], v[2])) if config.estimator.on != 0 else 0.0
    falls = Why(Reason.FALLS.value, 0, 0, 0, state.observed.fall_speed, 0.0)
    see(rows, falls, state.observed.fall_speed > config.drop.drop_speed + doubt, now_ns)
    foreign = health.outside == Reason.FOREIGN_COMMAND
    see(rows, because(Reason.EFFORT_COMMAND.value, health.outside), foreign, now_ns)


@part
def _find_speeds(config: ControllerConfig, state: ArmState, qd: Array, now_ns: int) -> None:
    """Look for a joint or a pad that is too fast: one clock, since what runs away shows in one after another."""
    limits, twist, which = config.command, spatial(state.observed.twist), -1
    speed, most, turns = twist.linear.norm(), limits.speed_linear, twist.angular.norm()
    if turns > TRIP_SHARE * limits.speed_angular:
        speed, most = turns, limits.speed_angular
    for j in range(config.law.joints - 1, -1, -1):
        if abs(qd[j]) > TRIP_SHARE * limits.velocity[j]:
            which, speed, most = j, abs(qd[j]), limits.velocity[j]
    found = Why(Reason.TOO_FAST.value, 0, 0, which, speed, most)
    see(state.conditions, found, speed > TRIP_SHARE * most, now_ns)


@part
def find_bad_inputs(config: ControllerConfig, state: ArmState, health: Health, now_ns: int) -> None:
    """Look for inputs that the law cannot work with, or only for a bounded time."""
    rows, conditions, at_work = state.conditions, config.conditions, follows(state.mode.mode)
    others = health.outside != Reason.NONE and health.outside != Reason.FOREIGN_COMMAND
    see(rows, because(Reason.INPUTS.value, health.outside), others, now_ns)
    bad = health.wrench != Reason.NONE
    see(rows, because(Reason.WRENCH_SLOWS.value, health.wrench), bad and at_work, now_ns)
    # A wrench that is ahead shows joint states that are late, and the law works with these.
    for_now = at_work and health.wrench != Reason.FUTURE
    for_now = for_now and passed_ns(rows[Reason.WRENCH_SLOWS], now_ns) < conditions.slow_down_ns
    see(rows, because(Reason.WRENCH.value, health.wrench), bad and not for_now, now_ns)
    unseen, unseen_fault = unseen_ns(config.estimator, state.estimate), 0 + health.joint
    if usable(unseen_fault):
        unseen_fault = Reason.FROZEN.value  # they repeat themselves
    see(rows, because(Reason.JOINT_STATE_SLOWS.value, unseen_fault), unseen > conditions.bridge_ns, now_ns)
    fault = Reason.NONE.value
    moves = state.observed.moves != 0 and at_work and unseen == 0
    if now_ns - state.now_ns > config.joint.age_ns and state.mode.mode != Mode.WAITING_INPUT:
        fault = Reason.NOT_RUN.value
    elif unseen > (conditions.unseen_ns if at_work else conditions.bridge_ns):
        fault = unseen_fault
    elif frozen(config.joint, state.joint, now_ns) and (
        moves or holds_for(state.mode, Reason.JOINT_STATE.value, Reason.FROZEN.value)
    ):
        fault = Reason.FROZEN.value
    see(rows, because(Reason.JOINT_STATE.value, fault), fault != Reason.NONE, now_ns)
    unknown = health.slip != Reason.NONE and conditions.slip_needed != 0
    see(rows, because(Reason.SLIP_PREDICTED.value, health.slip), unknown, now_ns)
    see(rows, because(Reason.SLIP_SLOWS.value, health.slip), unknown, now_ns)
    longest_ns = conditions.lasts_ns[Reason.SLIP_SLOWS] + conditions.slow_down_ns
    over = not at_work or passed_ns(rows[Reason.SLIP_PREDICTED], now_ns) >= longest_ns
    see(rows, because(Reason.SLIP.value, health.slip), unknown and over, now_ns)


@part
def find_reasons_to_wait(config: ControllerConfig, task: TaskState, state: ArmState, now_ns: int) -> None:
    """Look for why the law must not begin or continue, though all inputs are good."""
    rows, tare, governor, at_work = state.conditions, state.tare, task.governor, follows(state.mode.mode)
    waits = config.tare.duration_ns > 0 and not at_work
    found = read_why(tare.found) if waits else NOTHING
    see_one_of(rows, Reason.BIASED.value, Reason.INVERTED_WRENCH.value, found, now_ns)
    heavy = governor.infeasible != 0
    where = round(1e3 * governor.heaviest_time) if heavy else 0
    load = Why(Reason.PATH_TOO_HEAVY.value, 0, 0, where, governor.weight_load, PATH_MARGIN * governor.plan_load)
    see(rows, load, heavy, now_ns)


@part
def find_hindrances(config: ControllerConfig, task: TaskState, state: ArmState, now_ns: int) -> None:
    """Look for what keeps the law from its path."""
    rows, governor, contact = state.conditions, task.governor, state.pad.contact
    value, limit = state.pad.sensor.value, state.pad.sensor.limit
    if contact.slip_health == SensorHealth.READS_NOTHING:
        value, limit = contact.needs, contact.lacks
    mistake = Why(Reason.SLIP_SENSOR.value, 0, 0, contact.slip_health, value, limit)
    see(rows, mistake, contact.slip_health >= SensorHealth.READS_NOTHING, now_ns)
    load = pull(state.pad.evidence)
    pulled, F = math.sqrt(load.dot(load)), state.pad.grip * contact.F_median
    least = max(LEAST_FRICTION * F, config.governor.bias)  # a grip that follows leaves F at rest next to nothing
    hand = config.law.contacts == 1 and rests_at_end(config, task) and pulled > least
    see(rows, Why(Reason.HAND.value, 0, 0, 0, pulled, F), hand, now_ns)
    given_up, waits = state.law.given_up.left_s > 0.0, state.observed.path_speed < 1.0 or task.path.scale < 1.0
    see(rows, because(Reason.OVERRUNS.value, 0), governor.overrun != 0, now_ns)
    see(rows, because(Reason.ENDLESS_SLIP.value, 0), governor.endless != 0, now_ns)
    see(rows, because(Reason.GIVEN_UP.value, 0), given_up, now_ns)
    see(rows, because(Reason.PATH_WAITS.value, 0), waits, now_ns)


@part
def rests_at_end(config: ControllerConfig, task: TaskState) -> bool:
    """Return whether a governed path, or one to a goal, is over: then the object needs its weight alone."""
    path, phase = task.governor, task.goal.phase
    over = path.arrived != 0
    if config.follows_goals != 0:
        over = phase == GoalPhase.RESTS or phase == GoalPhase.REACHED
    return bool(config.governor.mode != Governing.OFF and over and path.out_rate == 0.0)


@part
def slows(config: ControllerConfig, state: ArmState, now_ns: int) -> bool:
    """Return whether the path has to come to rest, because of a user or of an input."""
    rows = state.conditions
    stops = rows[Reason.STOPPING].since_ns != NEVER or rows[Reason.WRENCH_SLOWS].since_ns != NEVER
    stops = stops or rows[Reason.JOINT_STATE_SLOWS].since_ns != NEVER
    return bool(stops or lasted(config.conditions, rows, Reason.SLIP_SLOWS.value, now_ns))


# -- the decision -------------------------------------------------------------------------------------


@part
def decide(c: ArmCycle, arms: Arms, alone: bool) -> None:
    """Classify the inputs of an arm and decide the mode of this cycle.

    arms: all that hold the object; alone: whether another arm is not answered in this cycle.
    """
    config, task, state, inputs, outputs = c.config, c.task, c.state, c.inputs, c.outputs
    outputs.before, outputs.health = state.mode, inputs.health
    if state.cycles == 0:
        state.now_ns = inputs.now_ns
    if inputs.request == Request.RESET_FAULT:
        task.forgets = 1
    fault = inputs.health.joint if inputs.health_given != 0 else state.joint.pending_fault
    state.joint.pending = 0
    if config.models_wrench != 0:
        _count_wrench_as_good(config, state, inputs)
    missing = inputs.missing | _never_seen(config, state)
    # After a restart everything starts again.
    if not usable(fault) if state.law.known == 0 else fault == Reason.RESTARTED:
        missing |= Missing.GOOD_JOINT_STATE.value
    if missing != 0:
        wait(c, Why(Reason.WAITS.value, fault, 0, int(missing), 0.0, 0.0))
        return
    _classify_inputs(c, fault, alone)
    unknown = outputs.health.wrench != Reason.NONE and state.law.known != 0
    if state.law.known == 0:
        begin_law(c)
        # No drive can hold it either, so the arm sinks until its lever is short enough: a user decides to begin there.
        heavy, stays = too_heavy(config, state, inputs.arm), inputs.request not in (Request.ENABLE, Request.RESET_FAULT)
        if heavy.reason == Reason.NONE and stays and state.mode.reason.reason == Reason.TOO_HEAVY:
            heavy = read_why(state.mode.reason)
        if heavy.reason != Reason.NONE:
            wait(c, heavy)
            return
    tared = config.tare.duration_ns == 0 or (state.tare.done != 0 and state.tare.found.reason == Reason.NONE)
    state.wrench_modelled = 0
    if config.models_wrench != 0 or unknown or not tared:
        model_wrench(c)
    _obey(config, state, inputs)
    bad = not (usable(fault) or fault == Reason.NOT_RUN)
    if bad and inputs.arm.M[0, 0] == 0.0:
        silent = because(Reason.JOINT_STATE.value, outputs.health.joint)
        next_mode(config.conditions, state.mode, silent, inputs.request, inputs.now_ns)
        outputs.decided = 1
        return
    now_ns, resets = inputs.now_ns, inputs.request == Request.RESET_FAULT
    request = _rest_before_hold(config, state, inputs.request, now_ns)
    reweighed = config.tare.duration_ns > 0 and not bad and tare(c, arms, alone)
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
def too_heavy(config: ControllerConfig, state: ArmState, arm: Arm) -> Why:
    """Return why the arm cannot be held where it is, NOTHING where it can."""
    torque = arm.gravity.copy()
    carry_load(config.hold, arm, arm_of_load(config, state), torque)
    for j in range(config.law.joints):
        if abs(torque[j]) > config.law.effort_limit[j]:
            return Why(Reason.TOO_HEAVY.value, 0, 0, j, torque[j], config.law.effort_limit[j])
    return NOTHING


@part
def _obey(config: ControllerConfig, state: ArmState, inputs: CycleInputs) -> None:
    """Reset the checks that a user vouches for when enabling the law or ending a fault: repeating sensors."""
    if inputs.request == Request.ENABLE or inputs.request == Request.RESET_FAULT:
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
