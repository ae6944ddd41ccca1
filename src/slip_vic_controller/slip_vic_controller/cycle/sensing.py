"""What the law is evaluated on: wrench and load, contact, gains and slip velocity of an arm in this cycle."""

from __future__ import annotations

import math

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.records import Records
from slip_core.vectors import NOTHING, ZERO, Mat, Spatial, Vec, mat, put_mat, put_spatial, spatial, vec
from slip_vic_controller.arm.command import Interface
from slip_vic_controller.arm.estimator import SIGNIFICANT, EstimatorConfig
from slip_vic_controller.contact.belief import BELIEF_TUNING, certain_share, keep_past, see_load, see_slip, sliding
from slip_vic_controller.contact.estimate import SensorHealth
from slip_vic_controller.contact.friction_estimate import (
    QUIET_NS,
    certify,
    learn_carried,
    put_certain,
    remember,
    slip_sample,
    slip_threshold,
    suspect,
    take_weaker,
)
from slip_vic_controller.contact.observer import Motion, observe
from slip_vic_controller.contact.slip_health import DIFFERS, add_reading, judge_health
from slip_vic_controller.contact.wrench_evidence import lacks_load, take_in
from slip_vic_controller.governor import governor
from slip_vic_controller.governor.grip import Handover, load_ahead, load_to_hold, squeeze
from slip_vic_controller.governor.load import ALONE, Held, load, size, weight
from slip_vic_controller.governor.plan import Governing
from slip_vic_controller.interfaces import wrench_at_pad
from slip_vic_controller.law.arm import Arm, column
from slip_vic_controller.law.bounds import internal_gain_limit
from slip_vic_controller.law.contact import contact_arm, pad_rotation, slip_velocity
from slip_vic_controller.law.extensions import judge_compensation, slip_speed
from slip_vic_controller.law.gains import LawGains, gains_at
from slip_vic_controller.law.law import predict_motion
from slip_vic_controller.law.object import integrate_slips, mean_arm, sharing
from slip_vic_controller.safety.conditions import Reason, follows, lasted
from slip_vic_controller.safety.hold import plausible_arm
from slip_vic_controller.sizes import NEVER
from slip_vic_controller.state import ArmCycle, ArmState, ControllerConfig, CycleOutputs, TaskState

# -- the wrench on the own pad, and the lever at which the load pulls ----------------------------------


@part
def tared_wrench(config: ControllerConfig, state: ArmState, R_ee: Mat) -> Spatial:
    """Return what the tare reads [N, N m] {ee}: the sensor, which nothing else uses by then, or the model's wrench."""
    if config.models_wrench != 0:
        return spatial(state.wrench_of_model[0])
    return wrench_at_pad(config.wrench_sensor, state.wrench_inputs[0].values, R_ee)


@part
def own_wrench(config: ControllerConfig, state: ArmState, R_ee: Mat) -> Spatial:
    """Return the wrench of the object on the own pad [N, N m] {ee}, without the sensor's bias, or that of the model."""
    if state.wrench_modelled != 0:
        return spatial(state.wrench_of_model[0])
    return tared_wrench(config, state, R_ee) - spatial(state.tare.wrench.bias)


@part
def arm_of_load(config: ControllerConfig, state: ArmState) -> Vec:
    """Return r = x_c - x_o at which the load pulls [m] {ee}."""
    slips, own, positions = state.law.slips, config.law.contact[0], ZERO
    pad = pad_rotation(own, slips[0])
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
def model_wrench(c: ArmCycle) -> None:
    """Let the wrench be that of a held object that moves as the path does, where no sensor measures it.

    Implements: ours: Newton's law for the object at the desired acceleration, f = m (g - a), without its rotation.
    """
    config, state, inputs = c.config, c.state, c.inputs
    law, hold, R = state.law, config.hold, mat(inputs.arm.rotation)
    force = vec(hold.weight)
    if follows(state.mode.mode) and law.known != 0:
        force = force - hold.mass * vec(c.task.desired.acceleration)
    R_o = R @ pad_rotation(config.law.contact[0], law.slips[0]).T()
    of_object = Spatial(force, -(R @ arm_of_load(config, state)).cross(force))
    state.wrench_modelled = 1
    for k in range(config.law.contacts):
        if inputs.arm.M[0, 0] > 0.0:
            put_spatial(
                state.wrench_of_model[k], (R_o @ pad_rotation(config.law.contact[k], law.slips[k])).T() @ of_object
            )


# -- what loads the contact, and the one estimate of slip, friction and sensors ------------------------


@part
def gains_now(state: ArmState, stamp_ns: int, outputs: CycleOutputs) -> None:
    """Write gains and payload in effect, with the mass that a tare has found; its inertia grows as much."""
    gains_at(state.law.ramp, stamp_ns, outputs.gains)
    measured = 1.0 + state.tare.mass_share
    outputs.gains.object.mass *= measured
    outputs.gains.object.inertia[:] *= measured


@part
def held(config: ControllerConfig, state: ArmState, gains: LawGains) -> Held:
    """Return the object as the own pad holds it."""
    limits, contact, slip = config.governor, config.law.contact[0], state.law.slips[0]
    shared = sharing(config.law, gains, state.law.slips) if config.law.contacts > 1 else ALONE
    pad = pad_rotation(contact, slip)
    inertia = pad.T() @ (mat(gains.object.inertia) @ pad)
    r = contact_arm(pad, vec(gains.contact_position), contact, slip)
    return Held(gains.object.mass, inertia, r, spatial(limits.weights), vec(limits.gravity), shared)


@part
def begin_pad(c: ArmCycle) -> None:
    """Initialise a pad: its load is that of the object at rest, with the gains in effect."""
    config, state, gains = c.config, c.state, c.outputs.gains
    gains_now(state, state.joint.answers.stamp_ns, c.outputs)
    state.grip.opens = 0
    grip, weighed = state.grip.actual / config.grip.nominal_force, state.tare.mass_share != 0.0
    at_rest = size(weight(held(config, state, gains), mat(c.inputs.arm.rotation)))
    governor.start_pad(config.governor, state.pad, at_rest, bool(weighed), grip)


@part
def pulls(config: ControllerConfig, state: ArmState, handover: int, now_ns: int) -> bool:
    """Return whether a hand pulls at the object, and the arm is configured to do this about it."""
    return bool(config.handover == handover and lasted(config.conditions, state.conditions, Reason.HAND.value, now_ns))


@part
def hold_on(c: ArmCycle, dt: float) -> None:
    """Let the grip of a pad follow the present load and the increase that the path plans."""
    config, task, state, pad = c.config, c.task, c.state, c.state.pad
    carries = load_to_hold(pad.belief, pad.commanded) + config.governor.friction.probe
    if task.governor.planned == 1:
        carries += load_ahead(task.grid, task.governor.time, config.grip.preview_s)
    pad.contact.F_risk = config.governor.friction.configured * certain_share(pad.belief, config.grip.risk)
    needed = carries * config.grip.nominal_force / pad.contact.F_risk
    slides = sliding(pad.belief) > BELIEF_TUNING.slides
    squeeze(config.grip, state.grip, needed, pad.contact.slipping != 0, slides, dt)
    if pulls(config, state, Handover.OPEN.value, state.now_ns):
        state.grip.opens = 1
    if state.grip.opens == 0:  # open, it carries nothing
        pad.grip = state.grip.actual / config.grip.nominal_force


@part
def estimate_contact(c: ArmCycle, unknown: bool, dt: float) -> None:
    """Write the contact estimate of this cycle, and let the grip follow.

    unknown: whether there is no slip sample that may be used; dt: since the cycle before [s].
    """
    config, state, pad, limits = c.config, c.state, c.state.pad, c.config.governor
    stamp_ns, alone = state.joint.answers.stamp_ns, config.law.contacts == 1
    contact, friction, evidence = pad.contact, pad.friction, pad.evidence
    measured = spatial(limits.weights) * spatial(c.outputs.samples[0].wrench)
    pad.measured = size(measured)
    if config.grip.follow != 0:
        see_load(pad.belief, measured, pad.commanded, pad.grip * limits.friction.configured, dt)
        keep_past(pad.belief, stamp_ns)
    remember(friction, stamp_ns, pad.measured / pad.grip, pad.commanded / pad.grip)
    certify(limits.friction, contact, friction, stamp_ns)
    found = bool(config.has_observer != 0 and state.observer.sliding != 0)
    for k in range(state.queue.count):
        sample = state.queue.samples[k]
        v = spatial(limits.slip_axes) * spatial(sample.twist)
        slip = Spatial(v.linear, limits.radius * v.angular)  # S v_s, turning as a speed at the torsional radius
        slip_sample(limits.friction, contact, friction, sample.stamp_ns, slip, found)
        if config.grip.follow != 0:
            see_slip(pad.belief, sample.stamp_ns, size(slip), slip_threshold(limits.friction, found))
        if alone and limits.friction.quantum != math.inf:
            add_reading(pad.sensor, sample.stamp_ns, slip, -spatial(evidence.measured), contact.slipping != 0)
            judge_health(pad.sensor, DIFFERS, SIGNIFICANT, config.tare.slip_linear, limits.friction.quantum)
    if alone and dt > 0.0 and state.wrench_modelled == 0:
        weigh_evidence(c, measured, found, dt)
    put_certain(limits.friction, contact)
    suspect(limits.friction, contact, friction, found)
    if config.grip.follow != 0:
        hold_on(c, dt)
    contact.variance[:] = state.observer.variance
    contact.age_ns = stamp_ns - state.slip_inputs[0].stamp_ns
    contact.slip_health = SensorHealth.SILENT.value if unknown else SensorHealth.OK.value
    if pad.sensor.found != SensorHealth.OK:
        contact.slip_health, contact.slipping = pad.sensor.found, 0  # what it has shown is void
    elif evidence.unseen_ns != NEVER and contact.age_ns + QUIET_NS < stamp_ns - evidence.unseen_ns:
        contact.slip_health = SensorHealth.READS_NOTHING.value


@part
def weigh_evidence(c: ArmCycle, measured: Spatial, found: bool, dt: float) -> None:
    """Compare the load with the one that the pad's motion needs, and learn friction where that shows a slip.

    measured: the load [N] {ee}; found: whether the observer finds slip; dt: since the cycle before [s].
    """
    config, state, pad, motion = c.config, c.state, c.state.pad, c.outputs.motion
    evidence, v_ee = pad.evidence, spatial(motion.v_ee)
    if evidence.begun != 0:
        a = (1.0 / dt) * (v_ee - spatial(evidence.twist))
        needed = load(held(config, state, c.outputs.gains), mat(motion.rotation), v_ee.angular, a)
        F = pad.grip * pad.contact.first
        if state.conditions[Reason.HAND].since_ns != NEVER:
            evidence.sum_s = 0.0  # what the hand carries is no load that is missing
        take_in(evidence.added, needed - spatial(pad.drawn), dt)
        if lacks_load(evidence, pad.contact, needed, measured, F, found, state.joint.answers.stamp_ns, dt):
            learn_carried(config.governor.friction, pad.contact, pad.friction, pad.contact.lacks / pad.grip)
    put_spatial(evidence.twist, v_ee)
    evidence.begun = 1


@part
def agree_on_friction(task: TaskState, states: Records[ArmState]) -> None:
    """Use the friction of the weakest pad for the path; where one pad slips, the object slips."""
    task.governor.contact = states[0].pad.contact
    for k in range(1, len(states)):
        take_weaker(task.governor.contact, states[k].pad.contact)


# -- the slip velocity of the law ----------------------------------------------------------------------


@part
def limit_internal_gain(config: ControllerConfig, state: ArmState, outputs: CycleOutputs) -> None:
    """Lower kappa to what the delay from wrench to command and the drives' lag allow."""
    gains, late_ns = outputs.gains.gains, 0
    for k in range(config.law.contacts):
        late_ns = max(late_ns, state.joint.answers.stamp_ns - state.wrench_inputs[k].stamp_ns)
    late_s = config.drive_lag_s + config.kappa_late_s
    delay_s = late_s + 1e-9 * (config.period_ns + late_ns)
    least = min(gains.M_D[0], gains.M_D[1], gains.M_D[2])
    most = internal_gain_limit(least, config.pad_stiffness, delay_s)
    gains.kappa = min(gains.kappa, config.kappa_share * most)


@part
def sense(c: ArmCycle, history: Array) -> int:
    """Find slip, gains and load of an arm in this cycle; return why it could not be, Reason.NONE where it could."""
    config, state, inputs, outputs = c.config, c.state, c.inputs, c.outputs
    law, sample, samples, queue = state.law, state.joint.answers, outputs.samples, state.queue
    dt = max(sample.stamp_ns - law.stamp_ns, 0) * 1e-9
    unknown = state.conditions[Reason.SLIP_PREDICTED].since_ns != NEVER
    unknown = unknown or state.pad.contact.slip_health > SensorHealth.READS_NOTHING
    for k in range(config.law.contacts):
        samples[k].wrench[:] = state.wrench_inputs[k].values
        if state.wrench_modelled != 0:
            samples[k].wrench[:] = state.wrench_of_model[k]
        if not unknown:
            samples[k].slip_twist[:] = state.slip_inputs[k].values
    samples[0].slip_twist[:] -= state.tare.slip.bias[:6]
    put_spatial(samples[0].wrench, own_wrench(config, state, mat(inputs.arm.rotation)))
    if unknown:
        queue.count = 0  # an observer continues with the model alone
    gains_now(state, law.stamp_ns, outputs)
    observer, motion, observes = state.observer, outputs.motion, config.has_observer != 0
    put_mat(motion.rotation, mat(inputs.arm.rotation))
    put_spatial(motion.v_ee, spatial(inputs.arm.twist))
    if observes:
        if not predict_motion(config.law, outputs.gains, inputs.arm, samples, law.slips, observer.twist, motion):
            return Reason.NO_ESTIMATE.value
        if config.estimator.on != 0:
            pad_variances(config.estimator, inputs.arm, motion)
    if config.estimator.on != 0 and config.command.interface != Interface.EFFORT:
        put_spatial(motion.v_ee, twist_now(c))
    if observes:
        if not observe(config.observer, observer, history, motion, sample.stamp_ns, queue.samples, queue.count):
            return Reason.NO_ESTIMATE.value
        outputs.sliding, outputs.follow_error[:] = observer.sliding, observer.error
    if outputs.gains.gains.kappa != 0.0:
        limit_internal_gain(config, state, outputs)
    if config.governor.mode != Governing.OFF or config.conditions.slip_needed != 0:
        estimate_contact(c, unknown, dt)
    _slip_for_law(c, dt)
    return Reason.NONE.value


@part
def pad_variances(config: EstimatorConfig, arm: Arm, out: Motion) -> None:
    """Write the variances of the pad's twist and of the noise in its change over a period, on pad axes; (6,), (6,).

    Args:
        config: variances of the joint velocities, alike and independent.
        arm: at this joint state.
        out: result.

    Implements: ours: diag(A A^T) sigma^2 with A = R^T J.
    """
    to_pad, total = mat(arm.rotation).T(), NOTHING
    for j in range(config.joints):
        a = to_pad @ column(arm, j)
        total = total + a * a
    put_spatial(out.velocity_variance, config.velocity_variance * total)
    put_spatial(out.change_variance, config.change_variance * total)


@part
def _slip_for_law(c: ArmCycle, dt: float) -> None:
    """Write the slip velocity for the law, and integrate the slip displacement with the present one.

    It is the estimated one, or the newest sample; with drives that answer late the one to which the commands under way
    lead; and zero where the law takes the object as held.
    """
    config, state, outputs = c.config, c.state, c.outputs
    law, samples, contact = state.law, outputs.samples, state.pad.contact
    if config.gate_shut != 0:
        for k in range(config.law.contacts):
            samples[k].slip_twist[:] = 0.0
    elif config.has_observer != 0:
        samples[0].slip_twist[:] = state.observer.twist
    integrate_slips(config.law, samples, law.slips, dt, outputs.slips)
    if config.law.yields > 0.0:
        v_s = slip_velocity(config.law.contact[0], samples[0])
        judge_compensation(law.given_up, outputs.gains.gains, v_s, state.observed.fall_speed, dt)
    if config.slip_ahead_s > 0.0:
        _foresee_slip(c)
    contact.v_s[:] = samples[0].slip_twist


@part
def _foresee_slip(c: ArmCycle) -> None:
    """Replace the slip velocity by the one to which the commands under way lead, as the joints are, see `foresee`.

    Until then the pad's twist changes by what is known, and the object's as the wrench accelerates it now. Else the law
    would answer for as long as drives take to what it has answered already. No larger than now: where the object
    nearly holds, its acceleration changes with the pad's, and what is predicted is none.

    Implements: ours: v_s + J (qd_commanded - qd) - t (G^T a_o + Phi2), a predictor after O. J. M. Smith, 1957.
    """
    config, outputs, rotation = c.config, c.outputs, mat(c.inputs.arm.rotation)
    contact, sample = config.law.contact[0], outputs.samples[0]
    v_s = slip_velocity(contact, sample)
    if v_s.dot(v_s) == 0.0:
        return
    change = spatial(c.inputs.arm.twist) - twist_now(c) - config.slip_ahead_s * spatial(outputs.motion.follow)
    error = config.slip_ahead_s * spatial(outputs.follow_error)
    ahead = v_s + spatial(contact.slip_axes) * (rotation.T() @ change - error)
    gains = outputs.gains.gains
    most, speed = slip_speed(gains, v_s), slip_speed(gains, ahead)
    put_spatial(sample.slip_twist, (most / speed) * ahead if speed > most else ahead)


@part
def twist_now(c: ArmCycle) -> Spatial:
    """Return the pad's twist of now {w}, zero where no joint moves: the law's is that of the commands under way.

    So is its Jacobian: what that changes on the way there is taken off.
    """
    arm, twist = c.inputs.arm, NOTHING
    for j in range(c.config.law.joints):
        twist = twist + c.state.estimate.velocity[j] * column(arm, j)
    return twist - c.config.drive_lag_s * spatial(arm.jdot_qd)
