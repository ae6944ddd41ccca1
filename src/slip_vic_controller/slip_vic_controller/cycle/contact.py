"""The contact in the cycle: what loads it, and the one estimate of slip, friction and sensors that all others read."""

from __future__ import annotations

import math

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.records import Records
from slip_core.vectors import Mat, Spatial, Vec, mat, put_spatial, spatial, vec
from slip_vic_controller.contact.estimate import (
    SensorHealth,
    compare_directions,
    end_slip,
    put_friction,
    take_weakest,
    weaker,
)
from slip_vic_controller.contact.friction_estimate import (
    certify,
    learn_carried,
    remember,
    slip_sample,
)
from slip_vic_controller.contact.wrench_evidence import lacks_load
from slip_vic_controller.governor import governor
from slip_vic_controller.governor.grip import follow_load, load_ahead
from slip_vic_controller.governor.layouts import GovernorConfig
from slip_vic_controller.governor.load import ALONE, Held, Shared, load, size, surface, weight
from slip_vic_controller.law.arm import Arm
from slip_vic_controller.law.contact import Contact, Slip, contact_arm, pad_rotation
from slip_vic_controller.law.gains import LawGains
from slip_vic_controller.law.internal import sharing
from slip_vic_controller.sizes import NEVER
from slip_vic_controller.state import ArmState, ControllerConfig, CycleOutputs, TaskState

SEES_NS = 50_000_000
"""How long after a slip by the wrench a sample must be measured that shows nothing of it [ns]."""


@part
def held_by(mass: float, inertia: Mat, position: Vec, contact: Contact, slip: Slip) -> Held:
    """Return the object on the axes of the pad that holds it.

    Args:
        mass, inertia: [kg], [kg m2] {o}.
        position: of the contact on the object, o_x_p [m] {o}.
        contact, slip: CONTACT, SLIP.
    """
    pad = pad_rotation(contact, slip)
    return Held(mass, pad.T() @ (inertia @ pad), contact_arm(pad, position, contact, slip), ALONE)


@part
def held(config: ControllerConfig, state: ArmState, gains: LawGains) -> Held:
    """Return the object as the own pad holds it."""
    grasped, position = gains.object, vec(gains.contact_position)
    own = held_by(grasped.mass, mat(grasped.inertia), position, config.law.contact[0], state.law.slips[0])
    if config.law.contacts == 1:
        return own
    with_others, rho = sharing(config.law, gains, state.law.slips), config.governor.radius
    arm = math.sqrt(with_others.longest * with_others.longest + rho * rho)
    shared = Shared(with_others.contacts, with_others.middle, with_others.inverse, arm, rho)
    return Held(own.mass, own.inertia, own.r, shared)


@part
def load_at_rest(config: ControllerConfig, state: ArmState, gains: LawGains, arm: Arm) -> float:
    """Return the load of the object's weight on the own pad [N]."""
    weights = surface(spatial(config.governor.slip_axes), config.governor.radius)
    return size(weight(held(config, state, gains), weights, mat(arm.rotation), vec(config.governor.gravity)))


@part
def begin_pad(config: ControllerConfig, state: ArmState, arm: Arm, gains: LawGains) -> None:
    """Initialise a pad: its load is that of the object at rest."""
    grip, weighed = state.grip.actual / config.grip.nominal_force, state.tare.mass_share != 0.0
    governor.start_pad(config.governor, state.pad, load_at_rest(config, state, gains, arm), bool(weighed), grip)


@part
def squeeze(config: ControllerConfig, task: TaskState, state: ArmState, dt: float) -> None:
    """Let the grip of a pad follow the load of the planned path, and the commanded and measured load of now."""
    pad = state.pad
    load = max(pad.commanded, pad.measured)
    if task.governor.planned == 1:
        load = max(load, load_ahead(task.grid, task.governor.time, config.grip.preview_s))
    follow_load(config.grip, state.grip, load, pad.contact.F_median, dt)
    pad.grip = state.grip.actual / config.grip.nominal_force


@part
def scaled_slip(config: GovernorConfig, twist: Array) -> Spatial:
    """Return S v_s of a slip twist on the slip axes, turning as a speed at the torsional radius [m/s]."""
    v = spatial(config.slip_axes) * spatial(twist)
    return Spatial(v.linear, config.radius * v.angular)


@part
def estimate_contact(
    config: ControllerConfig, task: TaskState, state: ArmState, outputs: CycleOutputs, unknown: bool, dt: float
) -> None:
    """Write what is known of the contact in this cycle, and let the grip follow.

    unknown: whether there is no slip sample that may be used; dt: since the cycle before [s].
    """
    if config.grip.follow != 0:
        squeeze(config, task, state, dt)
    pad, limits, stamp_ns, alone = state.pad, config.governor, state.joint.answers.stamp_ns, config.law.contacts == 1
    friction, contact, weights = pad.estimate, pad.contact, surface(spatial(limits.slip_axes), limits.radius)
    measured = weights * spatial(outputs.samples[0].wrench)
    pad.measured = size(measured)
    remember(pad.loads, stamp_ns, pad.measured / pad.grip, pad.commanded / pad.grip)
    certify(limits.estimate, friction, pad.loads, stamp_ns)
    found = bool(config.cycle.has_observer != 0 and state.observer.sliding != 0)
    for k in range(state.queue.count):
        sample, before_ns = state.queue.samples[k], friction.last_ns
        slip = scaled_slip(limits, sample.twist)
        slip_sample(limits.estimate, friction, pad.loads, sample.stamp_ns, slip, found)
        if alone and friction.slipping != 0 and NEVER < before_ns <= sample.stamp_ns:
            drags, passed_s = -vec(pad.evidence.measured), 1e-9 * (sample.stamp_ns - before_ns)
            pad.directions.mounted = compare_directions(pad.directions, slip.linear, drags, passed_s)
    if alone and dt > 0.0:
        weigh_evidence(config, state, outputs, weights, measured, dt)
    put_friction(limits.estimate, friction, contact)
    contact.variance[:] = state.observer.variance
    contact.age_ns = stamp_ns - state.slip_inputs[0].stamp_ns
    contact.wrench_health = SensorHealth.SILENT.value if state.wrench_modelled != 0 else SensorHealth.OK.value
    contact.slip_health, evidence = SensorHealth.SILENT.value if unknown else SensorHealth.OK.value, pad.evidence
    if pad.directions.mounted != SensorHealth.OK:
        contact.slip_health = pad.directions.mounted
    elif evidence.unseen != 0 and contact.age_ns + SEES_NS < stamp_ns - evidence.unseen_ns:
        contact.slip_health, contact.needs, contact.lacks = (
            SensorHealth.READS_NOTHING.value, evidence.lacks_of, evidence.carried
        )  # fmt: skip


@part
def weigh_evidence(
    config: ControllerConfig, state: ArmState, outputs: CycleOutputs, weights: Spatial, measured: Spatial, dt: float
) -> None:  # fmt: skip
    """Compare the load with the one that the pad's motion needs, and learn friction where that shows a slip.

    weights: of the components, see `surface`; measured: the load [N] {ee}; dt: since the cycle before [s].
    """
    pad, limits, motion, stamp_ns = state.pad, config.governor, outputs.motion, state.joint.answers.stamp_ns
    evidence, v_ee = pad.evidence, spatial(motion.v_ee)
    if evidence.begun != 0:
        a = (1.0 / dt) * (v_ee - spatial(evidence.twist))
        grasped, R = held(config, state, outputs.gains), mat(motion.rotation)
        needed = load(grasped, weights, R, v_ee.angular, vec(limits.gravity), a)
        F, seen = pad.grip * pad.estimate.first, pad.estimate.slipping
        if lacks_load(evidence, pad.commanded, needed, measured, F, seen, stamp_ns, dt):
            learn_carried(limits.estimate, pad.estimate, evidence.carried / pad.grip, stamp_ns)
    put_spatial(evidence.twist, v_ee)
    evidence.begun = 1


@part
def commanded_load(config: ControllerConfig, state: ArmState, arm: Arm, outputs: CycleOutputs) -> float:
    """Return the load of the acceleration that is commanded without a governor [N]."""
    limits, w_ee, a_C = config.governor, vec(arm.twist[3:]), spatial(outputs.law.a_C)
    weights, grasped = surface(spatial(limits.slip_axes), limits.radius), held(config, state, outputs.gains)
    return size(load(grasped, weights, mat(arm.rotation), w_ee, vec(limits.gravity), a_C))


@part
def agree_on_friction(config: ControllerConfig, task: TaskState, states: Records[ArmState]) -> None:
    """Use the friction of the weakest pad for the path, and share slip among all pads; config: of the first arm."""
    path, n = task.governor, len(states)
    path.contact, path.grip = states[0].pad.contact, states[0].pad.grip
    if n == 1:
        return
    for k in range(1, n):
        path.grip = min(path.grip, states[k].pad.grip)
        weaker(path.contact, states[k].pad.contact)
    end_slip(config.governor.estimate, path.contact, states[0].joint.answers.stamp_ns)
    for k in range(n):
        take_weakest(config.governor.estimate, states[k].pad.estimate, states[k].pad.contact, path.contact)
