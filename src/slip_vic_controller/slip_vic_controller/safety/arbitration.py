"""Arbitration: everything that speaks against the law in a cycle, and what is done while slip is not known.

A fault wins over a reason to hold, and that over a reason to be careful. While slip is unknown, never as if there
were none: the observer predicts it from the wrench alone for a bounded time; then the path comes to rest, and the law
continues with the prediction, or without compensation where there is none; then HOLD.
"""

from __future__ import annotations

from enum import IntEnum, unique
from typing import Protocol

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.records import Real, Record, Records, Whole, dtype_of
from slip_core.vectors import spatial
from slip_vic_controller.arm.joint_estimate import EstimatorConfig, Finding, JointEstimate
from slip_vic_controller.arm.plausibility import unseen_ns
from slip_vic_controller.arm.tare import Sensor, Tare, TareConfig, moved_joint
from slip_vic_controller.contact.estimate import Health as ContactHealth
from slip_vic_controller.law.extensions import CompensationState
from slip_vic_controller.safety.drop_detection import DropDetectionConfig, ObservedMotion, doubt_of_fall
from slip_vic_controller.safety.faults import Fault, Input
from slip_vic_controller.safety.following import Following, stuck
from slip_vic_controller.safety.latency import Latency
from slip_vic_controller.safety.limit_avoidance import MotionLimits, pushed_joint, too_fast
from slip_vic_controller.safety.modes import NOTHING, Mode, ModeState, TransitionReasons, follows, holds_for, since_when
from slip_vic_controller.safety.reasons import Cause, Reason, because, of_fault, read_reason
from slip_vic_controller.safety.validation import VectorInput, fine, usable
from slip_vic_controller.sizes import NEVER

SATURATED_NS = 100_000_000
"""How long efforts must be saturated to be a reason."""
FAST_NS = 5_000_000
"""How long a speed must be too high: a single bad sample is no speed."""


@unique
class Level(IntEnum):
    """Degradation levels of the slip velocity, downwards."""

    MEASURED = 0
    OBSERVED = 1
    SLOWING = 2
    HOLD = 3


class Health(Record):
    """The Fault of each input in a cycle."""

    joint: Whole
    wrench: Whole  # the worst of all contacts
    slip: Whole  # the worst of all contacts
    outside: Whole  # who else publishes


HEALTH = dtype_of(Health)


class ArbitrationConfig(Record):
    """How long each degradation level lasts, and what else speaks against the law."""

    observer_ns: Whole  # how long the observer may run alone, 0 where there is none
    slow_down_ns: Whole  # time for the path to come to rest
    bridge_ns: Whole  # how long the law goes on where the model has an arm that is not measured
    unseen_ns: Whole  # the same, with the time in which the path comes to rest
    gap_ns: Whole  # pause of the controller itself that is too long
    late_after: Whole  # late answers in a row
    slip_needed: Whole  # whether the law needs the slip velocity
    resume_slip_linear: Real  # m/s; slip at which the law does not begin
    resume_slip_angular: Real  # rad/s


class Since(Record):
    """Since when something is so, NEVER where it is not."""

    slip_unknown_ns: Whole
    too_fast_ns: Whole
    saturated_ns: Whole
    stopping_ns: Whole
    joint_bad_ns: Whole
    wrench_bad_ns: Whole  # while the law is at work
    sliding_ns: Whole  # stamp of the first sample of a slip at which the law does not begin


class GovernorMargin(Protocol):
    """What is read of the governor's configuration."""

    path_margin: float


class GovernorVerdict(Protocol):
    """What is read of the governor's state: loads [N], times of the path [s]."""

    infeasible: int
    overrun: int
    endless: int
    heaviest_time: float
    weight_load: float
    plan_load: float


class Contact(Protocol):
    """What is read of a contact's estimate."""

    variance: Array
    slip_health: int
    needs: float
    lacks: float


class GraspedPad(Protocol):
    """What is read of a pad's state."""

    @property
    def contact(self) -> Contact:
        """Return what is known of the contact."""
        ...


class GivenUp(Protocol):
    """What is read of the law's state."""

    given_up: CompensationState


class PathScale(Protocol):
    """What is read of the path's scaling."""

    scale: float


class Configured(Protocol):
    """What arbitration reads of the controller's configuration."""

    arbitration: ArbitrationConfig
    motion: MotionLimits
    drop: DropDetectionConfig
    tare: TareConfig
    estimator: EstimatorConfig

    @property
    def governor(self) -> GovernorMargin:
        """Return the configuration of the governor."""
        ...


class Shared(Protocol):
    """What arbitration reads of the task of all arms."""

    @property
    def governor(self) -> GovernorVerdict:
        """Return the state of the governor."""
        ...

    @property
    def path(self) -> PathScale:
        """Return the scaling of the path."""
        ...


class Judged(Protocol):
    """What arbitration reads of an arm's state; `since` and `observed` change."""

    now_ns: int
    mode: ModeState
    since: Since
    observed: ObservedMotion
    estimate: JointEstimate
    tare: Tare
    following: Following
    latency: Latency
    slip_inputs: Records[VectorInput]

    @property
    def law(self) -> GivenUp:
        """Return the state of the law."""
        ...

    @property
    def pad(self) -> GraspedPad:
        """Return what the governor keeps of the pad."""
        ...


@part
def clear_since(since: Since) -> None:
    """Begin: nothing is so."""
    since.slip_unknown_ns, since.too_fast_ns, since.saturated_ns = NEVER, NEVER, NEVER
    since.stopping_ns, since.joint_bad_ns, since.wrench_bad_ns = NEVER, NEVER, NEVER
    since.sliding_ns = -1  # what slides in the very first sample is believed


@part
def degradation_level(config: ArbitrationConfig, since: Since, fault: int, now_ns: int) -> int:
    """Return the level for a fault of the slip velocity: a bounded time on each, from the moment it became unknown."""
    unknown = not fine(fault) and config.slip_needed != 0
    since.slip_unknown_ns = since_when(since.slip_unknown_ns, unknown, now_ns)
    if not unknown:
        return Level.MEASURED.value
    passed = now_ns - since.slip_unknown_ns
    if passed < config.observer_ns:
        return Level.OBSERVED.value
    return Level.SLOWING.value if passed < config.observer_ns + config.slow_down_ns else Level.HOLD.value


@part
def find_fault(config: Configured, state: Judged, n: int, q: Array, qd: Array, now_ns: int) -> Reason:
    """Return what must latch: a speed too high for long, a joint whose measurements are wrong, an object that falls.

    Args:
        config: of the controller.
        state: of the controller; changed.
        n: number of joints.
        q, qd: joint state; (n,) [rad], [rad/s].
        now_ns: the controller's clock.
    """
    found = too_fast(config.motion, n, qd, spatial(state.observed.twist))
    state.since.too_fast_ns = since_when(state.since.too_fast_ns, found.cause != Cause.NONE, now_ns)
    if found.cause != Cause.NONE and now_ns - state.since.too_fast_ns > FAST_NS:
        return found
    if state.estimate.finding != Finding.NONE:
        finding = state.estimate
        return Reason(Cause.JOINT.value, finding.joint + 256 * finding.finding, 0, finding.value, finding.limit)
    moved = moved_joint(config.tare, state.tare, q)
    if moved >= 0:
        return Reason(Cause.MOVED_IN_TARE.value, moved, 0, q[moved] - state.tare.watched_from[moved], 0.0)
    # Noise of the joints' velocities can grow to such a slip velocity at rest, between two samples of a camera.
    doubt = doubt_of_fall(state.pad.contact.variance) if config.estimator.on != 0 else 0.0
    if state.observed.fall_speed > config.drop.drop_speed + doubt:
        return Reason(Cause.FALLS.value, 0, 0, state.observed.fall_speed, 0.0)
    return NOTHING


@part
def slides(config: ArbitrationConfig, since: Since, inputs: Records[VectorInput], contacts: int) -> bool:
    """Return whether an object slides too fast for the law to begin; the time in `since` is changed.

    After a sample at rest two have to say so: one of them may be an outlier.
    """
    linear, angular, newest_ns = config.resume_slip_linear, config.resume_slip_angular, NEVER
    for i in range(contacts):
        v = spatial(inputs[i].values)
        if linear * linear < v.linear.dot(v.linear) or angular * angular < v.angular.dot(v.angular):
            newest_ns = max(newest_ns, inputs[i].stamp_ns)
    since.sliding_ns = since_when(since.sliding_ns, newest_ns != NEVER, newest_ns)
    return bool(newest_ns != since.sliding_ns)


@part
def unseen_fault(health: Health) -> int:
    """Return the fault of joint states that show nothing: their own, or that they repeat themselves."""
    return Fault.FROZEN.value if usable(health.joint) else health.joint


@part
def find_hold(
    config: Configured,
    task: Shared,
    state: Judged,
    health: Health,
    level: int,
    fault: int,
    frozen: bool,
    sliding: bool,
    now_ns: int,
) -> Reason:
    """Return why the law must not work now; arguments as in `arbitrate`, fault: of the slip velocity."""
    arbitration, at_work = config.arbitration, follows(state.mode.mode)
    unknown = not fine(fault) and arbitration.slip_needed != 0
    if health.outside != Fault.NONE:
        return of_fault(Cause.INPUT, Input.ANY, health.outside)
    # A wrench that is ahead shows joint states that are late, and the law works with these.
    slows = at_work and health.wrench != Fault.FUTURE and now_ns - state.since.wrench_bad_ns < arbitration.slow_down_ns
    if not fine(health.wrench) and not slows:
        return of_fault(Cause.INPUT, Input.WRENCH, health.wrench)
    if now_ns - state.now_ns > arbitration.gap_ns and state.mode.mode != Mode.WAITING_INPUT:
        return of_fault(Cause.INPUT, Input.JOINT_STATE, Fault.NOT_RUN)
    if state.latency.in_a_row >= arbitration.late_after:
        return of_fault(Cause.INPUT, Input.JOINT_STATE, Fault.LATE)
    passed_ns = unseen_ns(config.estimator, state.estimate)
    if passed_ns > (arbitration.unseen_ns if at_work else arbitration.bridge_ns):
        return of_fault(Cause.INPUT, Input.JOINT_STATE, unseen_fault(health))
    moves = state.observed.moves != 0 and at_work and passed_ns == 0
    if frozen and (moves or holds_for(state.mode, Input.JOINT_STATE, Fault.FROZEN)):
        return of_fault(Cause.INPUT, Input.JOINT_STATE, Fault.FROZEN)
    if level == Level.HOLD or (unknown and not at_work):  # the levels are for a law that is at work
        return of_fault(Cause.INPUT, Input.SLIP, fault)
    if config.tare.duration_ns > 0 and not at_work:
        if state.tare.done == 0:
            return because(Cause.TARE, 0)
        if state.tare.sensor != Sensor.NONE:
            return Reason(Cause.BIASED.value, state.tare.sensor, 0, state.tare.worst, state.tare.bound)
    governor = task.governor
    if governor.infeasible != 0:
        where, carries = round(1e3 * governor.heaviest_time), config.governor.path_margin * governor.plan_load
        return Reason(Cause.PATH_TOO_HEAVY.value, where, 0, governor.weight_load, carries)
    if not at_work and arbitration.slip_needed != 0 and sliding:
        # With the delay of its loop the law would swing instead of catching what already slides fast.
        return because(Cause.SLIDES, 0)
    return NOTHING


@part
def find_degraded(
    config: Configured,
    task: Shared,
    state: Judged,
    health: Health,
    level: int,
    fault: int,
    n: int,
    q: Array,
    now_ns: int,
) -> Reason:
    """Return why to be careful; arguments as in `arbitrate`, fault: of the slip velocity."""
    since = state.since
    if unseen_ns(config.estimator, state.estimate) > config.arbitration.bridge_ns:
        return of_fault(Cause.SLOWING, Input.JOINT_STATE, unseen_fault(health))
    if since.wrench_bad_ns != NEVER:
        return of_fault(Cause.SLOWING, Input.WRENCH, health.wrench)
    if level == Level.OBSERVED:
        return of_fault(Cause.PREDICTED, Input.SLIP, fault)
    if level == Level.SLOWING:
        return of_fault(Cause.SLOWING, Input.SLIP, fault)
    if since.stopping_ns != NEVER:
        return because(Cause.STOPPING, 0)
    if since.saturated_ns != NEVER and now_ns - since.saturated_ns > SATURATED_NS:
        return because(Cause.SATURATED, 0)
    if stuck(state.following, now_ns):
        following = state.following
        return Reason(following.cause, following.joint, 0, following.value, following.error)
    contact = state.pad.contact
    if contact.slip_health >= ContactHealth.READS_NOTHING:
        return Reason(Cause.CONTRADICTS.value, contact.slip_health, 0, contact.needs, contact.lacks)
    cause = Cause.NONE
    if task.governor.overrun != 0:
        cause = Cause.OVERRUNS
    elif task.governor.endless != 0:
        cause = Cause.ENDLESS_SLIP
    elif state.law.given_up.left_s > 0.0:
        cause = Cause.GIVEN_UP
    elif state.observed.path_speed < 1.0 or task.path.scale < 1.0:
        cause = Cause.PATH_WAITS
    if cause == Cause.NONE:
        return NOTHING
    # What keeps the pad from its path there is no slip, and no friction that is too low; nor is it what lasts of that.
    pushed = pushed_joint(config.motion, n, q)
    if pushed >= 0:
        return Reason(Cause.PUSHED_BACK.value, pushed, 0, q[pushed], 0.0)
    if state.mode.reason.cause == Cause.PUSHED_BACK:
        return read_reason(state.mode.reason)
    return because(cause, 0)


@part
def arbitrate(
    config: Configured,
    task: Shared,
    state: Judged,
    health: Health,
    frozen: bool,
    n: int,
    contacts: int,
    q: Array,
    qd: Array,
    now_ns: int,
) -> tuple[TransitionReasons, int]:
    """Return what speaks against the law in this cycle, and the degradation level of the slip velocity.

    Args:
        config, task, state: of the controller, of all arms and of this one; the times in state are changed.
        health: of the inputs.
        frozen: whether the joint values have been equal to the last bit for long.
        n, contacts: numbers of joints and contacts.
        q, qd: joint state; (n,) [rad], [rad/s].
        now_ns: the controller's clock.
    """
    wrench_bad = not fine(health.wrench) and follows(state.mode.mode)
    state.since.wrench_bad_ns = since_when(state.since.wrench_bad_ns, wrench_bad, now_ns)
    sliding = slides(config.arbitration, state.since, state.slip_inputs, contacts)
    level = degradation_level(config.arbitration, state.since, health.slip, now_ns)
    fault, hold, degraded = find_fault(config, state, n, q, qd, now_ns), NOTHING, NOTHING
    if health.outside == Fault.FOREIGN_COMMAND:
        if fault.cause == Cause.NONE:
            fault = of_fault(Cause.INPUT, Input.EFFORT_COMMAND, health.outside)
    else:
        hold = find_hold(config, task, state, health, level, health.slip, frozen, sliding, now_ns)
    if hold.cause == Cause.NONE and health.outside == Fault.NONE:
        degraded = find_degraded(config, task, state, health, level, health.slip, n, q, now_ns)
    return TransitionReasons(NOTHING, fault, hold, degraded), level
