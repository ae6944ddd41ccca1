"""What speaks against the law in a cycle: where each condition of the table is found to be so.

While slip is unknown, never as if there were none: the observer predicts it from the wrench alone for a bounded time;
then the path comes to rest, and the law continues with the prediction, or without compensation; then HOLD.
"""

from __future__ import annotations

import math

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.vectors import spatial
from slip_vic_controller.arm.estimator import unseen_ns
from slip_vic_controller.arm.tare import moved_joint
from slip_vic_controller.contact.estimate import SensorHealth
from slip_vic_controller.contact.friction_estimate import LEAST_FRICTION
from slip_vic_controller.contact.wrench_evidence import pull
from slip_vic_controller.governor.plan import Governing
from slip_vic_controller.law.extensions import FASTEST_M_S, slip_speed
from slip_vic_controller.path.goals import GoalPhase
from slip_vic_controller.safety.conditions import (
    NOTHING,
    Health,
    Reason,
    Why,
    because,
    first,
    lasted,
    of_fault,
    passed_ns,
    read_why,
    see,
    see_one_of,
    since_when,
)
from slip_vic_controller.safety.limit_avoidance import TRIP_SHARE, pushed_joint
from slip_vic_controller.safety.modes import Mode, follows, holds_for
from slip_vic_controller.safety.motion import doubt_of_fall
from slip_vic_controller.safety.validation import frozen, usable
from slip_vic_controller.sizes import NEVER
from slip_vic_controller.state import ArmState, ControllerConfig, TaskState


@part
def judge(config: ControllerConfig, task: TaskState, state: ArmState, health: Health, now_ns: int) -> Why:
    """Return what speaks against the law in this cycle.

    Args:
        config, task, state: of the controller, of all arms and of this one; the conditions in state are changed.
        health: of the inputs.
        now_ns: the controller's clock.
    """
    sample = state.joint.answers
    find_faults(config, state, health, sample.position, sample.velocity, now_ns)
    find_bad_inputs(config, state, health, now_ns)
    find_reasons_to_wait(config, task, state, now_ns)
    find_hindrances(config, task, state, sample.position, now_ns)
    return first(config.conditions, state.conditions, now_ns)


@part
def find_faults(config: ControllerConfig, state: ArmState, health: Health, q: Array, qd: Array, now_ns: int) -> None:
    """Look for what must latch; q, qd: joint state (n,) [rad], [rad/s]."""
    rows = state.conditions
    _find_speeds(config, state, qd, now_ns)
    see_one_of(rows, Reason.VELOCITY.value, Reason.IGNORED.value, read_why(state.estimate.found), now_ns)
    moved = moved_joint(config.tare, state.tare, q)
    j = max(moved, 0)
    way = Why(Reason.MOVED_IN_TARE.value, 0, 0, j, q[j] - state.tare.watched_from[j], 0.0)
    see(rows, way, moved >= 0, now_ns)
    # Noise of the joints' velocities can grow to such a slip velocity at rest, between two samples of a camera.
    doubt = doubt_of_fall(state.pad.contact.variance) if config.estimator.on != 0 else 0.0
    falls = Why(Reason.FALLS.value, 0, 0, 0, state.observed.fall_speed, 0.0)
    see(rows, falls, state.observed.fall_speed > config.drop.drop_speed + doubt, now_ns)
    foreign = health.outside == Reason.FOREIGN_COMMAND
    see(rows, of_fault(Reason.EFFORT_COMMAND.value, health.outside), foreign, now_ns)


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
    see(rows, of_fault(Reason.INPUTS.value, health.outside), others, now_ns)
    bad = health.wrench != Reason.NONE
    see(rows, of_fault(Reason.WRENCH_SLOWS.value, health.wrench), bad and at_work, now_ns)
    # A wrench that is ahead shows joint states that are late, and the law works with these.
    for_now = at_work and health.wrench != Reason.FUTURE
    for_now = for_now and passed_ns(rows[Reason.WRENCH_SLOWS], now_ns) < conditions.slow_down_ns
    see(rows, of_fault(Reason.WRENCH.value, health.wrench), bad and not for_now, now_ns)
    unseen, unseen_fault = unseen_ns(config.estimator, state.estimate), 0 + health.joint
    if usable(unseen_fault):
        unseen_fault = Reason.FROZEN.value  # they repeat themselves
    see(rows, of_fault(Reason.JOINT_STATE_SLOWS.value, unseen_fault), unseen > conditions.bridge_ns, now_ns)
    fault = Reason.NONE.value
    moves = state.observed.moves != 0 and at_work and unseen == 0
    if now_ns - state.now_ns > conditions.gap_ns and state.mode.mode != Mode.WAITING_INPUT:
        fault = Reason.NOT_RUN.value
    elif unseen > (conditions.unseen_ns if at_work else conditions.bridge_ns):
        fault = unseen_fault
    elif frozen(config.joint, state.joint, now_ns) and (
        moves or holds_for(state.mode, Reason.JOINT_STATE.value, Reason.FROZEN.value)
    ):
        fault = Reason.FROZEN.value
    see(rows, of_fault(Reason.JOINT_STATE.value, fault), fault != Reason.NONE, now_ns)
    _find_bad_slip(config, state, health.slip, at_work, now_ns)


@part
def _find_bad_slip(config: ControllerConfig, state: ArmState, fault: int, at_work: bool, now_ns: int) -> None:
    """Let a slip velocity that is unknown count for a bounded time."""
    rows = state.conditions
    unknown = fault != Reason.NONE and config.conditions.slip_needed != 0
    see(rows, of_fault(Reason.SLIP_PREDICTED.value, fault), unknown, now_ns)
    see(rows, of_fault(Reason.SLIP_SLOWS.value, fault), unknown, now_ns)
    longest_ns = config.conditions.lasts_ns[Reason.SLIP_SLOWS] + config.conditions.slow_down_ns
    over = not at_work or passed_ns(rows[Reason.SLIP_PREDICTED], now_ns) >= longest_ns
    see(rows, of_fault(Reason.SLIP.value, fault), unknown and over, now_ns)


@part
def find_reasons_to_wait(config: ControllerConfig, task: TaskState, state: ArmState, now_ns: int) -> None:
    """Look for why the law must not begin or continue, though all inputs are good."""
    rows, tare, governor, at_work = state.conditions, state.tare, task.governor, follows(state.mode.mode)
    waits = config.tare.duration_ns > 0 and not at_work
    see(rows, because(Reason.TARE.value, 0), waits and tare.done == 0, now_ns)
    found = read_why(tare.found) if waits else NOTHING
    see_one_of(rows, Reason.BIASED.value, Reason.INVERTED_WRENCH.value, found, now_ns)
    heavy = governor.infeasible != 0
    where, carries = round(1e3 * governor.heaviest_time) if heavy else 0, config.governor.path_margin
    load = Why(Reason.PATH_TOO_HEAVY.value, 0, 0, where, governor.weight_load, carries * governor.plan_load)
    see(rows, load, heavy, now_ns)
    # The compensation does not end such a slip: with the delay of its loop the law would swing.
    sliding = slides(config, state) and not at_work and config.conditions.slip_needed != 0
    see(rows, because(Reason.SLIDES.value, 0), sliding, now_ns)


@part
def slides(config: ControllerConfig, state: ArmState) -> bool:
    """Return whether an object slides too fast for the law to begin; `sliding_ns` is changed.

    After a sample at rest two have to say so: one of them may be an outlier.
    """
    newest_ns = NEVER
    for i in range(config.law.contacts):
        if slip_speed(config.gains.gains, spatial(state.slip_inputs[i].values)) > FASTEST_M_S:
            newest_ns = max(newest_ns, state.slip_inputs[i].stamp_ns)
    state.sliding_ns = since_when(state.sliding_ns, newest_ns != NEVER, newest_ns)
    return bool(newest_ns != state.sliding_ns)


@part
def find_hindrances(config: ControllerConfig, task: TaskState, state: ArmState, q: Array, now_ns: int) -> None:
    """Look for what keeps the law from its path; q: (n,) [rad]."""
    rows, governor, contact = state.conditions, task.governor, state.pad.contact
    health = contact.slip_health
    nothing = Why(Reason.READS_NOTHING.value, 0, 0, 0, contact.needs, contact.lacks)
    see(rows, nothing, health == SensorHealth.READS_NOTHING, now_ns)
    mistake = Why(Reason.SLIP_SENSOR.value, 0, 0, health, state.pad.sensor.value, state.pad.sensor.limit)
    see(rows, mistake, health > SensorHealth.READS_NOTHING, now_ns)
    load = pull(state.pad.evidence)
    pulled, F = math.sqrt(load.dot(load)), state.pad.grip * contact.F_median
    hand = config.law.contacts == 1 and rests_at_end(config, task) and pulled > LEAST_FRICTION * F
    see(rows, Why(Reason.HAND.value, 0, 0, 0, pulled, F), hand, now_ns)
    given_up, waits = state.law.given_up.left_s > 0.0, state.observed.path_speed < 1.0 or task.path.scale < 1.0
    see(rows, because(Reason.OVERRUNS.value, 0), governor.overrun != 0, now_ns)
    see(rows, because(Reason.ENDLESS_SLIP.value, 0), governor.endless != 0, now_ns)
    see(rows, because(Reason.GIVEN_UP.value, 0), given_up, now_ns)
    see(rows, because(Reason.PATH_WAITS.value, 0), waits, now_ns)
    # What keeps the pad from its path there is no slip, and no friction that is too low; nor is it what lasts of that.
    hindered = governor.overrun != 0 or governor.endless != 0 or given_up or waits
    pushed, why = pushed_joint(config.command, config.law.joints, q), read_why(state.mode.reason)
    if pushed >= 0:
        why = Why(Reason.RANGE_END.value, 0, 0, pushed, q[pushed], 0.0)
    if why.reason != Reason.RANGE_END:
        hindered, why = False, because(Reason.RANGE_END.value, 0)
    see(rows, why, hindered, now_ns)


@part
def rests_at_end(config: ControllerConfig, task: TaskState) -> bool:
    """Return whether a governed path, or one to a goal, is over: then the object needs its weight alone."""
    path, phase = task.governor, task.goal.phase
    over = path.arrived != 0
    if config.follows_goals != 0:
        over = phase == GoalPhase.RESTS or phase == GoalPhase.REACHED
    return bool(config.governor.mode != Governing.OFF and over and path.out_rate == 0.0)


@part
def pulls(config: ControllerConfig, state: ArmState, handover: int, now_ns: int) -> bool:
    """Return whether a hand pulls at the object, and the arm is configured to do this about it."""
    return bool(config.handover == handover and lasted(config.conditions, state.conditions, Reason.HAND.value, now_ns))


@part
def slows(config: ControllerConfig, state: ArmState, now_ns: int) -> bool:
    """Return whether the path has to come to rest, because of a user or of an input."""
    rows = state.conditions
    stops = rows[Reason.STOPPING].since_ns != NEVER or rows[Reason.WRENCH_SLOWS].since_ns != NEVER
    stops = stops or rows[Reason.JOINT_STATE_SLOWS].since_ns != NEVER
    return bool(stops or lasted(config.conditions, rows, Reason.SLIP_SLOWS.value, now_ns))
