"""The contact in the cycle: what loads it, and the one estimate of slip, friction and sensors that all others read."""

from __future__ import annotations

import math

from slip_core.compiled import part
from slip_core.records import Records
from slip_core.vectors import Spatial, mat, put_spatial, spatial, vec
from slip_vic_controller.contact.belief import BELIEF_TUNING, certain_share, keep_past, see_load, see_slip, sliding
from slip_vic_controller.contact.estimate import SensorHealth
from slip_vic_controller.contact.friction_estimate import (
    certify,
    learn_carried,
    put_certain,
    remember,
    share_friction,
    slip_sample,
    suspect,
    take_weaker,
)
from slip_vic_controller.contact.slip_health import DIFFERS, add_reading, judge_health
from slip_vic_controller.contact.wrench_evidence import Handover, lacks_load
from slip_vic_controller.cycle.judging import pulls
from slip_vic_controller.governor import governor
from slip_vic_controller.governor.grip import load_ahead, load_to_hold, squeeze
from slip_vic_controller.governor.layouts import GovernorConfig
from slip_vic_controller.governor.load import ALONE, Held, load, size, weight
from slip_vic_controller.law.arm import Arm
from slip_vic_controller.law.contact import contact_arm, pad_rotation
from slip_vic_controller.law.gains import LawGains
from slip_vic_controller.law.internal import sharing
from slip_vic_controller.safety.conditions import Reason
from slip_vic_controller.sizes import NEVER
from slip_vic_controller.state import ArmState, ControllerConfig, CycleOutputs, TaskState


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
def begin_pad(config: ControllerConfig, state: ArmState, arm: Arm, gains: LawGains) -> None:
    """Initialise a pad: its load is that of the object at rest."""
    state.grip.opens = 0
    grip, weighed = state.grip.actual / config.grip.nominal_force, state.tare.mass_share != 0.0
    at_rest = size(weight(held(config, state, gains), mat(arm.rotation)))
    governor.start_pad(config.governor, state.pad, at_rest, bool(weighed), grip)


@part
def hold_on(config: ControllerConfig, task: TaskState, state: ArmState, dt: float) -> None:
    """Let the grip of a pad follow the load of now, and what the planned path adds to it."""
    pad, probe = state.pad, config.governor.friction.probe
    load = load_to_hold(pad.belief, pad.commanded) + probe
    if task.governor.planned == 1:
        load += load_ahead(task.grid, task.governor.time, config.grip.preview_s)
    pad.contact.F_risk = config.governor.friction.configured * certain_share(pad.belief, config.grip.risk)
    needed = load * config.grip.nominal_force / pad.contact.F_risk
    squeeze(config.grip, state.grip, needed, sliding(pad.belief) > BELIEF_TUNING.slides, dt)
    if pulls(config, state, Handover.OPEN.value, state.now_ns):
        state.grip.opens = 1
    if state.grip.opens == 0:  # open, it carries nothing
        pad.grip = state.grip.actual / config.grip.nominal_force


@part
def scaled_slip(config: GovernorConfig, twist: Spatial) -> Spatial:
    """Return S v_s of a slip twist on the slip axes, turning as a speed at the torsional radius [m/s]."""
    v = spatial(config.slip_axes) * twist
    return Spatial(v.linear, config.radius * v.angular)


@part
def estimate_contact(
    config: ControllerConfig, task: TaskState, state: ArmState, outputs: CycleOutputs, unknown: bool, dt: float
) -> None:
    """Write what is known of the contact in this cycle, and let the grip follow.

    unknown: whether there is no slip sample that may be used; dt: since the cycle before [s].
    """
    pad, limits, stamp_ns, alone = state.pad, config.governor, state.joint.answers.stamp_ns, config.law.contacts == 1
    contact, friction, evidence = pad.contact, pad.friction, pad.evidence
    measured = spatial(limits.weights) * spatial(outputs.samples[0].wrench)
    pad.measured = size(measured)
    if config.grip.follow != 0:
        see_load(pad.belief, measured, pad.commanded, pad.grip * limits.friction.configured, dt)
        keep_past(pad.belief, stamp_ns)
    remember(friction, stamp_ns, pad.measured / pad.grip, pad.commanded / pad.grip)
    certify(limits.friction, contact, friction, stamp_ns)
    found = bool(config.has_observer != 0 and state.observer.sliding != 0)
    for k in range(state.queue.count):
        sample = state.queue.samples[k]
        slip = scaled_slip(limits, spatial(sample.twist))
        slip_sample(limits.friction, contact, friction, sample.stamp_ns, slip, found)
        if config.grip.follow != 0:
            see_slip(pad.belief, sample.stamp_ns, size(slip), limits.friction.threshold)
        if alone and limits.friction.quantum != math.inf:
            add_reading(pad.sensor, sample.stamp_ns, slip, -spatial(evidence.measured), contact.slipping != 0)
            judge_health(pad.sensor, DIFFERS, config.tare.slip_linear, limits.friction.quantum)
    if alone and dt > 0.0:
        weigh_evidence(config, state, outputs, measured, found, dt)
    put_certain(limits.friction, contact)
    suspect(limits.friction, contact, friction, found)
    if config.grip.follow != 0:
        hold_on(config, task, state, dt)
    contact.variance[:] = state.observer.variance
    contact.age_ns = stamp_ns - state.slip_inputs[0].stamp_ns
    contact.slip_health = SensorHealth.SILENT.value if unknown else SensorHealth.OK.value
    if pad.sensor.found != SensorHealth.OK:
        contact.slip_health = pad.sensor.found
    elif evidence.unseen_ns != NEVER and contact.age_ns + limits.friction.quiet_ns < stamp_ns - evidence.unseen_ns:
        contact.slip_health = SensorHealth.READS_NOTHING.value


@part
def weigh_evidence(
    config: ControllerConfig, state: ArmState, outputs: CycleOutputs, measured: Spatial, found: bool, dt: float
) -> None:
    """Compare the load with the one that the pad's motion needs, and learn friction where that shows a slip.

    measured: the load [N] {ee}; found: whether the observer finds slip; dt: since the cycle before [s].
    """
    pad, limits, motion, stamp_ns = state.pad, config.governor, outputs.motion, state.joint.answers.stamp_ns
    evidence, v_ee = pad.evidence, spatial(motion.v_ee)
    if evidence.begun != 0:
        a = (1.0 / dt) * (v_ee - spatial(evidence.twist))
        needed = load(held(config, state, outputs.gains), mat(motion.rotation), v_ee.angular, a)
        F = pad.grip * pad.contact.first
        if state.conditions[Reason.HAND].since_ns != NEVER:
            evidence.sum_s = 0.0  # what the hand carries is no load that is missing
        if lacks_load(evidence, pad.contact, pad.commanded, needed, measured, F, found, stamp_ns, dt):
            learn_carried(limits.friction, pad.contact, pad.friction, pad.contact.lacks / pad.grip)
    put_spatial(evidence.twist, v_ee)
    evidence.begun = 1


@part
def agree_on_friction(config: ControllerConfig, task: TaskState, states: Records[ArmState]) -> None:
    """Use the friction of the weakest pad for the path, and share slip among all pads; config: of the first arm."""
    path, n = task.governor, len(states)
    limits, now_ns = config.governor.friction, states[0].joint.answers.stamp_ns
    path.contact = states[0].pad.contact
    for k in range(1, n):
        take_weaker(path.contact, states[k].pad.contact)
    if n > 1:
        for k in range(n):
            share_friction(limits, states[k].pad.contact, path.contact, now_ns)
        share_friction(limits, path.contact, path.contact, now_ns)
