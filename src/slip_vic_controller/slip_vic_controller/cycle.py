"""The control cycle: records in, records out, one compiled function.

    cycle(config, state, inputs, outputs)

`state` is advanced in place: copy it to keep it, its bytes are a snapshot, and equal bytes go on equally. Nothing here
raises, waits, reads a clock or keeps anything elsewhere. On its way a joint state passes input validation (when it
arrives), arbitration and modes, then the law (or HOLD), limit avoidance and the effort limiter; every command comes out
of `_finish`.
"""

from __future__ import annotations

import math
from enum import IntEnum, unique
from typing import Any, NamedTuple

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import IN1, INT, OUT1, VOID, kernel, part
from slip_core.records import REAL, WHOLE, layout, record
from slip_core.vectors import IDENTITY, ZERO, Mat, Spatial, Vec, mat, put, put_mat, put_spatial, spatial, vec
from slip_vic_controller.governing import (
    GOVERNED,
    begin_governing,
    follow_goal,
    govern,
    governed_reference,
    guard,
    held,
    put_governed,
    rest_on_path,
    screen,
)
from slip_vic_controller.interfaces import WRENCH_SENSOR, wrench_at_pad
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.law.bounds import held_sample_limit, internal_gain_limit
from slip_vic_controller.law.config import LAW_CONFIG
from slip_vic_controller.law.contact import (
    CONTACT_SAMPLE,
    SLIP,
    beyond_dead_band,
    contact_arm,
    integrate_slips,
    pad_rotation,
    slip_velocity,
)
from slip_vic_controller.law.gains import LAW_GAINS, RAMP, gains_at
from slip_vic_controller.law.giving_up import GIVEN_UP, GIVING_UP, judge_compensation, start_giving_up
from slip_vic_controller.law.internal import mean_arm
from slip_vic_controller.law.law import EVALUATION, evaluate, predict_motion, scale_acceleration
from slip_vic_controller.law.symbols import SLIP_ESTIMATE, SYMBOLS, no_symbols, symbols
from slip_vic_controller.observer.layouts import MOTION, OBSERVER, OBSERVER_CONFIG, ROW_SIZE
from slip_vic_controller.observer.observer import observe, reset
from slip_vic_controller.reference.friction_estimate import LOAD_HISTORY
from slip_vic_controller.reference.goals import GOAL, GOALS, rest_at
from slip_vic_controller.reference.governor import GOVERNOR, GOVERNOR_CONFIG
from slip_vic_controller.reference.grip import GRIP, GRIP_CONFIG, start_grip
from slip_vic_controller.reference.path_grid import PATH_GRID, Governing
from slip_vic_controller.reference.path_scaling import PATH_SCALING, advance, lost_ns, scaled
from slip_vic_controller.reference.paths import PATH, REFERENCE, Reference, put_reference, reference_at
from slip_vic_controller.reference.stream import STREAM, STREAM_CONFIG
from slip_vic_controller.safety.arbitration import (
    ARBITRATION,
    HEALTH,
    SINCE,
    Level,
    arbitrate,
    clear_since,
    watch_for_blindness,
)
from slip_vic_controller.safety.drop_detection import DROP_DETECTION, OBSERVED, forget, observe_motion
from slip_vic_controller.safety.effort_limiter import (
    LIMITER,
    limit_effort,
    needs_restart,
    start_limiter,
)
from slip_vic_controller.safety.faults import Fault, Input
from slip_vic_controller.safety.hold import (
    HOLD,
    HOLD_CONFIG,
    believable_arm,
    carry_load,
    hold_effort,
    keep_posture,
    update_load_error,
)
from slip_vic_controller.safety.latency import (
    LATENCY,
    SLIP_LATENCY,
    forget_latency,
    measure_latency,
    measure_slip_latency,
    whole_cycles,
)
from slip_vic_controller.safety.limit_avoidance import MOTION_LIMITS, avoid_limits
from slip_vic_controller.safety.modes import (
    MODE,
    MODE_POLICY,
    NO_REASONS,
    NOTHING,
    Mode,
    Request,
    TransitionReasons,
    begin_modes,
    follows,
    next_mode,
)
from slip_vic_controller.safety.reasons import (
    FIRST_WRENCH,
    GOOD_JOINT_STATE,
    Cause,
    Reason,
    because,
    of_fault,
)
from slip_vic_controller.safety.validation import (
    JOINT_INPUT,
    JOINT_LIMITS,
    SLIP_QUEUE,
    VECTOR_INPUT,
    VECTOR_LIMITS,
    all_finite,
    fine,
    frozen,
    stays_away,
    usable,
    vector_validity,
)
from slip_vic_controller.sizes import MAX_CONTACTS, MAX_JOINTS, NEVER

CYCLE_CONFIG = layout(
    period_ns=WHOLE, bridge_ns=WHOLE, late_ns=WHOLE, slow_down_s=REAL, joint_damping=REAL, start_s=REAL,
    posture_given=WHOLE, posture=(REAL, MAX_JOINTS), has_observer=WHOLE, corrects_follow=WHOLE, dead_band_linear=REAL,
    dead_band_angular=REAL, k_s_adapts=WHOLE, k_s_margin=REAL, pad_stiffness=REAL, slip_delay_ns=WHOLE, gate_shut=WHOLE,
    leaves_gravity=WHOLE,
)  # fmt: skip
"""bridge_ns: gap of good joint states that is bridged; late_ns: what is too late for the law, 0 = nothing;
slow_down_s: time in which the path comes to rest; start_s: of the trajectory; k_s_adapts: whether k_s follows the
measured delays; pad_stiffness: for the bound on kappa [N/m]; slip_delay_ns: by which the stamps of slip samples are too
late; gate_shut: whether the law takes the object as held; leaves_gravity: whether the arm carries its own weight."""

CONFIG = layout(
    law=LAW_CONFIG, gains=LAW_GAINS, giving_up=GIVING_UP, path=PATH, observer=OBSERVER_CONFIG, cycle=CYCLE_CONFIG,
    joint=JOINT_LIMITS, wrench=VECTOR_LIMITS, slip=VECTOR_LIMITS, modes=MODE_POLICY, arbitration=ARBITRATION,
    drop=DROP_DETECTION, motion=MOTION_LIMITS, hold=HOLD_CONFIG, governor=GOVERNOR_CONFIG,
    wrench_sensor=WRENCH_SENSOR, grip=GRIP_CONFIG, goals=GOALS, stream=STREAM_CONFIG,
)  # fmt: skip
"""All that does not change while the controller runs."""

LAW_STATE = layout(
    known=WHOLE, stamp_ns=WHOLE, start_ns=WHOLE, start_position=(REAL, 3), start_rotation=(REAL, (3, 3)),
    posture=(REAL, MAX_JOINTS), position=(REAL, MAX_JOINTS), gravity=(REAL, MAX_JOINTS), e_previous=(REAL, 3),
    slips=(SLIP, MAX_CONTACTS), ramp=RAMP, slip_latency=SLIP_LATENCY, held=WHOLE, late=WHOLE, k_s_limit=REAL,
    given_up=GIVEN_UP,
)  # fmt: skip
"""What the law needs of the past. stamp_ns: of the last joint state; start_*: origin of the trajectory; position,
gravity: the last finite joint position and g there; held, late, k_s_limit: delays in cycles, and the k_s for them;
given_up: whether the compensation is."""

STATE = layout(
    cycles=WHOLE, begun=WHOLE, now_ns=WHOLE, outside=WHOLE, joint=JOINT_INPUT,
    wrench_inputs=(VECTOR_INPUT, MAX_CONTACTS), slip_inputs=(VECTOR_INPUT, MAX_CONTACTS), queue=SLIP_QUEUE,
    reference_known=WHOLE, reference=REFERENCE, mode=MODE, since=SINCE, observed=OBSERVED, latency=LATENCY,
    limiter=LIMITER, hold=HOLD, path=PATH_SCALING, tuned=RAMP, law=LAW_STATE, observer=OBSERVER,
    governor=GOVERNOR, grid=PATH_GRID, loads=LOAD_HISTORY, grip=GRIP,
    taken=WHOLE, goal=GOAL, stream=STREAM,
)  # fmt: skip
"""Everything that is remembered between cycles; taken: how many references or goals have come. The observer's history
of ticks and samples follows in the buffer."""

STATE_SIZE = STATE.itemsize // 8

INPUTS = layout(now_ns=WHOLE, request=WHOLE, missing=WHOLE, health_given=WHOLE, health=HEALTH, arm=ARM)
"""now_ns: the controller's clock; missing: bits of what else is missing; health: of the inputs where it is given, by a
replay; arm: at the joint state that is answered."""

LEDGER = 3 + 4 * MAX_CONTACTS + 5 + 1
OUTPUTS = layout(
    answered=WHOLE, evaluated=WHOLE, ok=WHOLE, ledger=(WHOLE, LEDGER), effort=(REAL, MAX_JOINTS),
    limited=(WHOLE, MAX_JOINTS), saturated=(WHOLE, MAX_JOINTS), grip=REAL, health=HEALTH, mode=MODE,
    path_scale=REAL, governor=GOVERNED, wanted=(REAL, MAX_JOINTS),
    samples=(CONTACT_SAMPLE, MAX_CONTACTS), slips=(SLIP, MAX_CONTACTS), follow_error=(REAL, 6), gains=LAW_GAINS,
    reference=REFERENCE, motion=MOTION, law=EVALUATION, estimate=SLIP_ESTIMATE,
)  # fmt: skip
"""What a cycle gives. answered: 0 = no effort, something is missing; evaluated: `law` holds; ok: the law's effort went
out; effort [N m]; grip: commanded [N]; limited: joints at the rate limit; wanted: before limit avoidance.

ledger: all that the cycle depends on: its number, stamp of the joint state, then stamps of the newest wrench and slip
velocity of each contact (none where they were not used); behind them the controller's clock, mode, health, request, and
how many references or goals have been taken. Times are seconds and nanoseconds."""


@part
def _put_estimate(observer: Any, out: Any) -> None:
    """Write what an observer publishes to a SLIP_ESTIMATE."""
    out.sliding, out.significance = observer.sliding, observer.significance
    for k in range(6):
        out.deviation[k], out.error[k] = math.sqrt(observer.variance[k]), observer.error[k]


@part
def _begin(c: Any, s: Any, i: Any, o: Any, stamp_ns: int) -> None:
    """Begin a cycle; the first one begins the controller."""
    if s.begun == 0:
        s.begun, s.now_ns = 1, i.now_ns
        begin_modes(c.modes, s.mode, i.now_ns)
        clear_since(s.since)
        forget(s.observed, NEVER)
        s.path.scale, s.path.rate = 1.0, 0.0
        start_grip(c.grip, s.grip)
    o.answered, o.evaluated = 0, 0
    if i.health_given != 0:
        o.health = i.health
    o.ledger[0] = s.cycles
    _put_time(o.ledger, 1, stamp_ns)
    s.cycles += 1


@part
def _put_time(ledger: Array, at: int, time_ns: int) -> None:
    """Write a time [ns] as seconds and nanoseconds."""
    ledger[at], ledger[at + 1] = time_ns // 1_000_000_000, time_ns % 1_000_000_000


@part
def _end(c: Any, s: Any, i: Any, o: Any) -> None:
    """Write mode and the end of the ledger."""
    o.mode = s.mode
    o.path_scale, o.grip = s.path.scale, s.grip.command
    put_governed(c, s, o.governor)
    at, h = 3 + 4 * c.law.contacts, o.health
    _put_time(o.ledger, at, i.now_ns)
    o.ledger[at + 2] = s.mode.mode
    o.ledger[at + 3] = h.joint | h.wrench << 8 | h.slip << 16 | h.outside << 24
    o.ledger[at + 4], o.ledger[at + 5] = i.request, s.taken
    if not follows(s.mode.mode):
        screen(c, s, False)


@part
def _never_seen(c: Any, s: Any) -> int:
    """Return the bits of the inputs that have never been seen: no command before every input was seen once."""
    bits = 0
    for k in range(c.law.contacts):
        if s.wrench_inputs[k].seen == 0:
            bits |= FIRST_WRENCH << k
        if c.arbitration.slip_needed != 0 and s.slip_inputs[k].seen == 0:
            bits |= FIRST_WRENCH << (MAX_CONTACTS + k)
    return bits


@part
def _wait(c: Any, s: Any, i: Any, missing: Reason, keep_limiter: int) -> None:
    """Give no effort. Without one the arm goes anywhere: HOLD, also that of a fault, begins anew where it is then."""
    next_mode(c.modes, s.mode, TransitionReasons(missing, NOTHING, NOTHING, NOTHING), i.request, i.now_ns)
    s.limiter.started, s.now_ns, s.hold.known, s.hold.load_error[:] = keep_limiter, i.now_ns, 0, 0.0
    forget_latency(s.latency)


@part
def _classify_inputs(c: Any, s: Any, i: Any, o: Any, fault: int) -> None:
    """Write the fault of each input in this cycle, and the stamps of the samples that it uses."""
    stamp_ns, moves = s.joint.answers.stamp_ns, s.joint.moves != 0
    if i.health_given == 0:
        o.health.joint, o.health.wrench, o.health.slip, o.health.outside = fault, 0, 0, s.outside
        for k in range(c.law.contacts):
            wrench = vector_validity(c.wrench, s.wrench_inputs[k], i.now_ns, stamp_ns, moves)
            slip = vector_validity(c.slip, s.slip_inputs[k], i.now_ns, stamp_ns, moves)
            o.health.wrench, o.health.slip = max(o.health.wrench, wrench), max(o.health.slip, slip)
    for k in range(c.law.contacts):
        _put_time(o.ledger, 3 + 4 * k, s.wrench_inputs[k].stamp_ns)
        _put_time(o.ledger, 5 + 4 * k, s.slip_inputs[k].stamp_ns)


@part
def begin_law(c: Any, s: Any, i: Any, o: Any) -> None:
    """Begin the law: the arm where it is, no slip, the trajectory starting here and now."""
    law, sample, n = s.law, s.joint.answers, c.law.joints
    law.known, law.stamp_ns, law.start_ns = 1, sample.stamp_ns, sample.stamp_ns
    law.start_position[:], law.start_rotation[:] = i.arm.position, i.arm.rotation
    for j in range(n):
        law.posture[j] = c.cycle.posture[j] if c.cycle.posture_given != 0 else sample.position[j]
        law.position[j], law.gravity[j] = sample.position[j], i.arm.gravity[j]
    law.e_previous[:] = 0.0
    for k in range(MAX_CONTACTS):
        put(law.slips[k].position, ZERO)
        put_mat(law.slips[k].rotation, IDENTITY)
    law.slip_latency.known, law.slip_latency.latency_ns, law.slip_latency.period_ns = 0, 0.0, 0.0
    law.held = 0
    start_giving_up(law.given_up)
    law.ramp = s.tuned
    law.ramp.begin_ns = sample.stamp_ns
    if c.cycle.has_observer != 0:
        reset(c.observer, s.observer, sample.stamp_ns, i.arm.twist)
    if c.stream.on != 0:
        rest_on_path(c, s, i.arm)
    if c.goals.on != 0:
        rest_at(s.goal, Reference(vec(i.arm.position), mat(i.arm.rotation), Spatial(ZERO, ZERO), Spatial(ZERO, ZERO)))
    if c.governor.mode != Governing.OFF:
        gains_at(law.ramp, sample.stamp_ns, o.gains)
        begin_governing(c, s, i.arm, o.gains)


class Decision(NamedTuple):
    """What a cycle has found when it knows whether the law may work.

    step: what comes next, see `Step`; never_seen: bits of the inputs that have never been seen; reasons, request: of
    the mode machine; level: degradation level; entered: mode before; freezes: whether the joint state is frozen.
    """

    step: int
    never_seen: int
    reasons: TransitionReasons
    request: int
    level: int
    entered: int
    freezes: bool


@unique
class Step(IntEnum):
    """What a cycle does after its decision."""

    NONE = 0
    BRIDGE = 1
    ANSWER = 2


@part
def _decide(c: Any, s: Any, i: Any, o: Any, never_seen: int) -> Decision:
    """Find what speaks against the law, and go to the mode of this cycle."""
    sample, fault, now_ns = s.joint.answers, o.health.joint, i.now_ns
    if not (usable(fault) or fault == Fault.NOT_RUN):
        return Decision(0 + Step.BRIDGE.value, never_seen, NO_REASONS, i.request, 0, s.mode.mode, False)
    s.since.joint_bad_ns = NEVER
    if i.request == Request.ENABLE:
        forget_latency(s.latency)  # whoever asks for the law has seen to it that a clock was set, and nothing is late
    measure_latency(s.latency, now_ns, sample.stamp_ns, now_ns - s.now_ns, c.cycle.late_ns)
    request = _stop_first(c, s, i.request, now_ns)
    freezes = frozen(c.joint, s.joint, now_ns)
    n, contacts = c.law.joints, c.law.contacts
    reasons, level = arbitrate(c, s, o.health, freezes, n, contacts, sample.velocity, now_ns)
    entered = s.mode.mode
    next_mode(c.modes, s.mode, reasons, request, now_ns)
    return Decision(0 + Step.ANSWER.value, never_seen, reasons, request, level, entered, freezes)


@part
def _answer(c: Any, s: Any, history: Array, i: Any, o: Any, decision: Decision) -> None:
    """Do what the mode of this cycle asks for."""
    sample, entered = s.joint.answers, decision.entered
    if not follows(s.mode.mode):
        _hold(c, s, i, o, fine(o.health.wrench) and not decision.freezes)
        return
    if not follows(entered):
        # After a HOLD the path starts from rest; and the time that passed in it is not part of the path.
        s.path.scale, s.path.rate = (1.0 if entered == Mode.WAITING_INPUT else 0.0), 0.0
        s.hold.known, s.hold.load_error[:] = 0, 0.0
        forget(s.observed, s.observed.blind_since_ns)
        if c.cycle.has_observer != 0:
            reset(c.observer, s.observer, sample.stamp_ns, i.arm.twist)  # what it knew is void
        rest_on_path(c, s, i.arm)
    _follow(c, s, history, i, o, decision.level)


@part
def _stop_first(c: Any, s: Any, request: int, now_ns: int) -> int:
    """Let a user's HOLD begin when the path has come to rest: a sudden stop throws a weakly gripped object."""
    stays = request == Request.ENABLE or request == Request.RESET_FAULT or request == Request.FAILED
    if stays or not follows(s.mode.mode):
        s.since.stopping_ns = NEVER
        return request
    if request == Request.HOLD and s.since.stopping_ns == NEVER:
        s.since.stopping_ns = now_ns
        return Request.NONE.value
    if s.since.stopping_ns != NEVER and now_ns - s.since.stopping_ns >= 2 * c.arbitration.slow_down_ns:
        s.since.stopping_ns = NEVER
        return Request.HOLD.value
    return Request.NONE.value  # who asks twice does not stop the path more suddenly


@part
def bridges(c: Any, s: Any, now_ns: int) -> bool:
    """Return whether a bad joint state is bridged with the last effort: shortly, and not after a pause."""
    ran = now_ns - s.now_ns <= c.arbitration.gap_ns  # after a pause the last effort is old, however young the sample
    short = s.since.joint_bad_ns == NEVER or now_ns - s.since.joint_bad_ns <= c.cycle.bridge_ns
    return ran and s.limiter.started != 0 and short


@part
def _bridge(c: Any, s: Any, i: Any, o: Any, fault: int) -> None:
    """Bridge a short gap of good joint states with the last effort, then let it go to gravity compensation."""
    n, now_ns = c.law.joints, i.now_ns
    if s.since.joint_bad_ns == NEVER:
        s.since.joint_bad_ns = now_ns
    ends = follows(s.mode.mode) and stays_away(o.health.wrench)  # the law has to, whatever the joint states are like
    if bridges(c, s, now_ns) and not ends:
        o.wanted[:n] = s.limiter.effort[:n]
    else:
        o.wanted[:n] = s.law.gravity[:n]
        reasons = TransitionReasons(NOTHING, NOTHING, of_fault(Cause.INPUT, Input.JOINT_STATE, fault), NOTHING)
        next_mode(c.modes, s.mode, reasons, i.request, now_ns)
        s.path.scale, s.path.rate, s.hold.known = 0.0, 0.0, 0
    # After a pause the limiter starts at what the joints feel; a jump of the positions leaves the efforts believable,
    # unless somebody else sends joint states too.
    rest, felt = np.zeros(MAX_JOINTS), np.zeros(MAX_JOINTS)
    if fault == Fault.JUMP and o.health.outside != Fault.SECOND_PUBLISHER:
        felt[:] = s.joint.answers.effort
    _finish(c, s, i, o, s.law.position, rest, felt, False)


@part
def _arm_of_load(c: Any, s: Any, pad: Mat) -> Vec:
    """Return r = x_c - x_o at which the load pulls, on the axes of the pad whose attitude is `pad` [m] {ee}."""
    slips, own, told = s.law.slips, c.law.contact[0], ZERO
    # The levers of several shares of the weight cancel, as far as they can.
    r = mean_arm(c.law, c.gains, slips) if c.law.contacts > 1 else contact_arm(pad, vec(own.position), own, slips[0])
    for k in range(c.law.contacts):
        told = told + vec(c.law.contact[k].position)
    return believable_arm(pad.T() @ ((1.0 / c.law.contacts) * told), r)


@part
def _hold(c: Any, s: Any, i: Any, o: Any, wrench_good: bool) -> None:
    """Keep the posture in which HOLD began; what the wrench has told of the load stays until the law begins."""
    law, sample, n = s.law, s.joint.answers, c.law.joints
    if s.hold.known == 0 or i.now_ns - s.now_ns > c.arbitration.gap_ns:  # after a pause somebody else held the arm
        s.hold.known = 1
        s.hold.posture[:n] = sample.position[:n]
    keep_posture(s.hold, n, sample, c.motion.velocity)
    dt_ns = max(sample.stamp_ns - law.stamp_ns, 0)
    pad = pad_rotation(c.law.contact[0], law.slips[0])
    r = _arm_of_load(c, s, pad)
    if wrench_good:
        measured = wrench_at_pad(c.wrench_sensor, s.wrench_inputs[0].values, mat(i.arm.rotation))
        update_load_error(c.hold, s.hold, i.arm, r, measured, dt_ns * 1e-9)
    hold_effort(c.hold, s.hold, i.arm, sample, pad, r, s.latency.most_ns * 1e-9, o.wanted)
    if not (s.mode.reason.cause == Cause.FALLS and s.mode.reason.prefix == 0):
        carry_load(c.hold, s.hold, i.arm, r, o.wanted)
    law.start_ns += dt_ns
    _keep_joints(c, s, i)
    s.path.scale, s.path.rate = 0.0, 0.0
    forget(s.observed, NEVER)
    s.since.saturated_ns = NEVER
    _finish(c, s, i, o, sample.position, sample.velocity, sample.effort, False)


@part
def keep_law(c: Any, s: Any, i: Any, o: Any) -> None:
    """Keep what the next evaluation of the law needs of this one."""
    s.law.e_previous[:] = o.law.e[3:]
    for k in range(c.law.contacts):
        s.law.slips[k] = o.slips[k]
    _keep_joints(c, s, i)


@part
def _keep_joints(c: Any, s: Any, i: Any) -> None:
    """Keep stamp and position of a good joint state, and gravity there.

    With other arms on the object its share of the weight belongs to it: an arm that loses sight must not let them
    carry all of it at once.
    """
    law, sample, n = s.law, s.joint.answers, c.law.joints
    law.stamp_ns = max(sample.stamp_ns, law.stamp_ns)
    law.position[:n], law.gravity[:n] = sample.position[:n], i.arm.gravity[:n]
    if c.law.contacts > 1 and s.mode.reason.cause != Cause.FALLS:
        carry_load(c.hold, s.hold, i.arm, _arm_of_load(c, s, pad_rotation(c.law.contact[0], law.slips[0])), law.gravity)


@part
def _follow(c: Any, s: Any, history: Array, i: Any, o: Any, level: int) -> None:
    """Let the law work, along the path as fast as errors and the degradation level allow."""
    law, sample, n = s.law, s.joint.answers, c.law.joints
    dt_ns = max(sample.stamp_ns - law.stamp_ns, 0)
    screen(c, s, True)
    stops = level == Level.SLOWING or s.since.stopping_ns != NEVER
    wanted = 0.0 if stops else s.observed.path_speed
    governed = c.governor.mode != Governing.OFF
    if not governed and (wanted < 1.0 or s.path.scale != 1.0 or s.path.rate != 0.0):
        advance(s.path, wanted, dt_ns * 1e-9, c.cycle.slow_down_s)
    if governed:
        s.path.scale, s.path.rate = 1.0, 0.0  # the governor brings the path to rest, as friction admits
    law.start_ns += lost_ns(s.path, dt_ns)
    cause = evaluate_law(c, s, history, i, o, level == Level.OBSERVED or level == Level.SLOWING, stops)
    if cause == Cause.NONE:
        keep_law(c, s, i, o)
        o.wanted[:n] = o.law.effort[:n]
        observe_motion(c.drop, c.law.contact[0].slip_axes, s.observed, i.arm, o.law, o.reference, dt_ns * 1e-9)
        watch_for_blindness(s.observed, o.law.slip_speed, c.drop.evidence, i.now_ns)
        _finish(c, s, i, o, sample.position, sample.velocity, sample.effort, True)
        return
    # The law could not be evaluated: gravity compensation with damping in this cycle, and HOLD.
    _keep_joints(c, s, i)
    for j in range(n):
        torque = law.gravity[j] - c.cycle.joint_damping * sample.velocity[j]
        o.wanted[j] = min(max(torque, -c.law.effort_limit[j]), c.law.effort_limit[j])
    reasons = TransitionReasons(NOTHING, NOTHING, because(cause, 0), NOTHING)
    next_mode(c.modes, s.mode, reasons, Request.NONE.value, i.now_ns)
    s.path.scale, s.path.rate, s.hold.known = 0.0, 0.0, 1
    s.hold.posture[:n] = sample.position[:n]
    _finish(c, s, i, o, sample.position, sample.velocity, sample.effort, False)


@part
def evaluate_law(c: Any, s: Any, history: Array, i: Any, o: Any, slip_unknown: bool, stops: bool) -> int:
    """Evaluate the law on the inputs of this cycle; return why it could not be, Cause.NONE where it could.

    slip_unknown: there is no slip sample; an observer goes on with the model alone. stops: the path comes to rest.
    """
    law, sample, contacts = s.law, s.joint.answers, c.law.contacts
    if sample.stamp_ns < law.stamp_ns:
        return Cause.OLD_JOINT_STATE.value
    for k in range(contacts):
        o.samples[k].wrench[:] = s.wrench_inputs[k].values
        o.samples[k].slip_twist[:] = s.slip_inputs[k].values
        if slip_unknown:
            o.samples[k].slip_twist[:] = 0.0
    put_spatial(
        o.samples[0].wrench, wrench_at_pad(c.wrench_sensor, s.wrench_inputs[0].values, mat(i.arm.rotation))
    )  # fmt: skip
    if slip_unknown:
        s.queue.count = 0
    gains_at(law.ramp, law.stamp_ns, o.gains)
    measure_slip_latency(law.slip_latency, sample.stamp_ns, s.queue)
    o.follow_error[:] = 0.0
    if c.cycle.has_observer != 0:
        if not predict_motion(c.law, o.gains, i.arm, o.samples, law.slips, s.observer.twist, o.motion):
            return Cause.NO_ESTIMATE.value
        if not observe(c.observer, s.observer, history, o.motion, sample.stamp_ns, s.queue.samples, s.queue.count):
            return Cause.NO_ESTIMATE.value
        _put_estimate(s.observer, o.estimate)
        o.samples[0].slip_twist[:] = s.observer.twist
        if c.cycle.corrects_follow != 0:
            o.follow_error[:] = s.observer.error
    else:
        linear, angular = c.cycle.dead_band_linear, c.cycle.dead_band_angular
        if linear != 0.0 or angular != 0.0:
            v_s = spatial(c.law.contact[0].slip_axes) * spatial(o.samples[0].slip_twist)
            put_spatial(o.samples[0].slip_twist, beyond_dead_band(v_s, linear, angular))
        _adapt_slip_gain(c, s, o)
    if o.gains.gains.kappa != 0.0:
        _limit_internal_gain(c, s, o)
    if c.cycle.gate_shut != 0:
        for k in range(contacts):
            o.samples[k].slip_twist[:] = 0.0
    dt = (sample.stamp_ns - law.stamp_ns) * 1e-9
    governed = c.governor.mode != Governing.OFF
    if governed:
        grasped = held(c, s, o.gains)
        govern(c, s, i.arm, o, grasped, dt, 0.0 if stops else s.observed.path_speed)
    if c.giving_up.witness != 0 and c.giving_up.on != 0 and s.governor.estimate.slipping == 0:
        o.samples[0].slip_twist[:] = 0.0  # nor does it move the pad on the object: a lever that is wrong stops the arm
    if not _reference(c, s, o):
        return Cause.BAD_REFERENCE.value
    error = (vec(i.arm.position) - vec(o.reference.position)).norm()
    v_s = slip_velocity(c.law.contact[0], o.samples[0])
    judge_compensation(
        c.giving_up, law.given_up, o.gains.gains, v_s, s.governor.estimate.slipping, error, s.observed.fall_speed, dt
    )
    integrate_slips(c.law, o.samples, law.slips, dt, o.slips)
    evaluate(c.law, i.arm, sample, law, o)
    if governed:
        factor = guard(c, s, i.arm, o, grasped)
        if factor < 1.0:
            scale_acceleration(c.law, i.arm, sample, law, factor, o)
    o.evaluated = o.law.ok
    return Cause.NONE.value if o.law.ok != 0 else Cause.NO_TORQUE.value


@part
def _adapt_slip_gain(c: Any, s: Any, o: Any) -> None:
    """Lower k_s to what the measured delays allow, where it is free to be chosen."""
    if c.cycle.k_s_adapts == 0:
        return
    held, late = whole_cycles(s.law.slip_latency, c.cycle.period_ns)
    if held != s.law.held or late != s.law.late:  # they seldom change
        s.law.held, s.law.late = held, late
        s.law.k_s_limit = held_sample_limit(held, late) / (1e-9 * c.cycle.period_ns) / c.cycle.k_s_margin
    o.gains.gains.k_s = min(o.gains.gains.k_s, s.law.k_s_limit)


@part
def _limit_internal_gain(c: Any, s: Any, o: Any) -> None:
    """Lower kappa to what the measured delay from a wrench to its answer allows."""
    gains, late_ns = o.gains.gains, 0
    for k in range(c.law.contacts):
        late_ns = max(late_ns, s.joint.answers.stamp_ns - s.wrench_inputs[k].stamp_ns)
    delay_s = 1e-9 * (c.cycle.period_ns + s.latency.most_ns + late_ns)
    least = min(gains.M_D[0], gains.M_D[1], gains.M_D[2])
    gains.kappa = min(gains.kappa, internal_gain_limit(least, c.cycle.pad_stiffness, delay_s))


@part
def _reference(c: Any, s: Any, o: Any) -> bool:
    """Write the desired motion of this cycle; return whether it is finite."""
    law, given = s.law, s.reference
    if s.reference_known != 0:
        desired = Reference(
            vec(given.position), mat(given.rotation), spatial(given.twist), spatial(given.acceleration)
        )  # fmt: skip
    elif c.governor.mode != Governing.OFF:
        desired = governed_reference(c, s)
    elif c.goals.on != 0:
        desired = follow_goal(c, s)
    else:
        t = (s.joint.answers.stamp_ns - law.start_ns) * 1e-9 - c.cycle.start_s
        desired = reference_at(c.path, t, law.start_position, law.start_rotation)
    if s.path.scale != 1.0 or s.path.rate != 0.0:
        desired = scaled(desired, s.path)
    put_reference(o.reference, desired)
    finite = all_finite(o.reference.position) and all_finite(o.reference.twist)
    finite = finite and all_finite(o.reference.acceleration)
    for k in range(3):
        finite = finite and all_finite(o.reference.rotation[k])
    return finite


@part
def _finish(c: Any, s: Any, i: Any, o: Any, q: Array, qd: Array, felt: Array, law_at_work: bool) -> None:
    """Add limit avoidance, pass the effort limiter, and write the outcome.

    Args:
        c, s, i, o: of the cycle; `o.wanted` is what goes in.
        q, qd: joint state [rad], [rad/s].
        felt: measured joint efforts, where a pause makes the limiter start anew [N m].
        law_at_work: whether the effort is the law's; then the pad's speed is limited too.
    """
    n, now_ns = c.law.joints, i.now_ns
    if needs_restart(c.motion.drive, s.limiter, now_ns):
        start_limiter(c.motion.drive, s.limiter, n, felt, s.law.gravity, now_ns)
    torque, clipped = np.empty(MAX_JOINTS), np.zeros(MAX_JOINTS, np.int64)
    torque[:n] = o.wanted[:n]
    avoid_limits(c.motion, n, q, qd, i.arm, law_at_work, torque)
    finite = limit_effort(c.motion.drive, s.limiter, n, torque, now_ns, clipped, o.limited)
    saturated = 0
    for j in range(n):
        o.effort[j] = s.limiter.effort[j]
        if c.cycle.leaves_gravity != 0:
            o.effort[j] -= s.law.gravity[j]
        o.saturated[j] = 1 if clipped[j] != 0 or (law_at_work and o.law.saturated[j] != 0) else 0
        saturated += o.saturated[j]
    if saturated == 0:
        s.since.saturated_ns = NEVER
    elif s.since.saturated_ns == NEVER:
        s.since.saturated_ns = now_ns
    s.now_ns = now_ns
    o.answered = 1
    o.ok = 1 if law_at_work and finite else 0


@part
def begin_cycle(c: Any, s: Any, i: Any, o: Any) -> Decision:
    """Look at the inputs and decide; the mode is that of this cycle then. Arguments by name, as of `cycle`."""
    fault = i.health.joint if i.health_given != 0 else s.joint.pending_fault
    s.joint.pending = 0
    _begin(c, s, i, o, s.joint.answers.stamp_ns)
    if fault == Fault.RESTARTED and s.law.known != 0:
        # Everything starts anew; the limiter goes on from the last command, where that is recent: the joints feel it.
        s.law.known = 0
        _wait(c, s, i, of_fault(Cause.INPUT, Input.JOINT_STATE, fault), s.limiter.started)
    never_seen = _never_seen(c, s)
    missing = i.missing | never_seen
    if s.law.known == 0 and not usable(fault):
        missing |= GOOD_JOINT_STATE
    if missing != 0:
        _wait(c, s, i, because(Cause.WAITS, missing), 0)
        return Decision(0 + Step.NONE.value, never_seen, NO_REASONS, i.request, 0, s.mode.mode, False)
    _classify_inputs(c, s, i, o, fault)
    if s.law.known == 0:
        begin_law(c, s, i, o)
    return _decide(c, s, i, o, never_seen)


@part
def end_cycle(c: Any, s: Any, history: Array, i: Any, o: Any, decision: Decision) -> None:
    """Do what was decided, and write the outcome. Arguments by name, as of `cycle`; history: rows of the observer."""
    if decision.step == Step.BRIDGE:
        _bridge(c, s, i, o, o.health.joint)
    elif decision.step == Step.ANSWER:
        _answer(c, s, history, i, o, decision)
    if decision.never_seen == 0:
        s.queue.count = 0
    _end(c, s, i, o)


@kernel(INT(IN1, OUT1, IN1, OUT1))
def cycle(config_buffer: Array, state_buffer: Array, inputs_buffer: Array, outputs_buffer: Array) -> int:
    """Answer the joint state that waits for it; return 1 where there is an effort, 0 where something is missing.

    Args:
        config_buffer: CONFIG.
        state_buffer: STATE and the observer's history; changed.
        inputs_buffer: INPUTS.
        outputs_buffer: OUTPUTS.
    """
    c, s = record(config_buffer, CONFIG), record(state_buffer[:STATE_SIZE], STATE)
    history = state_buffer[STATE_SIZE:].reshape(-1, ROW_SIZE)
    i, o = record(inputs_buffer, INPUTS), record(outputs_buffer, OUTPUTS)
    end_cycle(c, s, history, i, o, begin_cycle(c, s, i, o))
    return o.answered


@kernel(INT(IN1, OUT1, IN1, OUT1))
def watchdog(config_buffer: Array, state_buffer: Array, inputs_buffer: Array, outputs_buffer: Array) -> int:
    """Answer that joint states stay away: HOLD, efforts go to gravity compensation where the arm was.

    Args:
        config_buffer, state_buffer, inputs_buffer, outputs_buffer: as of `cycle`.

    Returns:
        1 where effort or mode have changed by it.
    """
    c, s = record(config_buffer, CONFIG), record(state_buffer[:STATE_SIZE], STATE)
    i, o = record(inputs_buffer, INPUTS), record(outputs_buffer, OUTPUTS)
    n = c.law.joints
    _begin(c, s, i, o, s.law.stamp_ns)
    o.health.joint = Fault.SILENT.value
    mode, since, enabled, cause = s.mode.mode, s.mode.good_since_ns, s.mode.enabled, s.mode.reason.cause
    prefix, detail = s.mode.reason.prefix, s.mode.reason.detail
    effort = s.limiter.effort.copy()
    reasons = TransitionReasons(NOTHING, NOTHING, of_fault(Cause.INPUT, Input.JOINT_STATE, Fault.SILENT), NOTHING)
    next_mode(c.modes, s.mode, reasons, i.request, i.now_ns)
    s.path.scale, s.path.rate, s.hold.known = 0.0, 0.0, 0
    o.wanted[:n] = s.law.gravity[:n]
    rest = np.zeros(MAX_JOINTS)
    _finish(c, s, i, o, s.law.position, rest, rest, False)
    _end(c, s, i, o)
    same_mode = s.mode.mode == mode and s.mode.good_since_ns == since and s.mode.enabled == enabled
    same_mode = same_mode and s.mode.reason.cause == cause and s.mode.reason.prefix == prefix
    same = same_mode and s.mode.reason.detail == detail
    for j in range(n):
        same = same and s.limiter.effort[j] == effort[j]
    return 0 if same else 1


@kernel(VOID(IN1, IN1, IN1, OUT1))
def describe(config_buffer: Array, inputs_buffer: Array, outputs_buffer: Array, symbols_buffer: Array) -> None:
    """Fill the SYMBOLS of a cycle, when somebody looks at them.

    Args:
        config_buffer, inputs_buffer, outputs_buffer: as of `cycle`, after it.
        symbols_buffer: SYMBOLS.
    """
    c, out = record(config_buffer, CONFIG), record(symbols_buffer, SYMBOLS)
    i, o = record(inputs_buffer, INPUTS), record(outputs_buffer, OUTPUTS)
    no_symbols(o.effort, o.saturated, symbols_buffer)
    if o.ok != 0:
        symbols(c.law, o.gains, i.arm, o.slips, o.reference, o.law, o.estimate, out)
        for j in range(c.law.joints):
            out.effort[j], out.saturated[j] = o.effort[j], o.saturated[j]
