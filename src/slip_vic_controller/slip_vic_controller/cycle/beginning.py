"""How a cycle of an arm begins, and how the law does: where the arm is now, before any slip."""

from __future__ import annotations

from slip_core.compiled import part
from slip_core.vectors import IDENTITY, ZERO, Spatial, mat, put, put_mat, vec
from slip_vic_controller.arm.tare import start_tare
from slip_vic_controller.contact.observer import reset
from slip_vic_controller.cycle.contact import begin_pad
from slip_vic_controller.cycle.gains import gains_now
from slip_vic_controller.cycle.ledger import put_time
from slip_vic_controller.governor.governor import start_governor
from slip_vic_controller.governor.grip import start_grip
from slip_vic_controller.governor.plan import Governing
from slip_vic_controller.path.goals import rest_at
from slip_vic_controller.path.paths import Reference
from slip_vic_controller.path.stream import rest_stream
from slip_vic_controller.safety.conditions import forget_conditions
from slip_vic_controller.safety.drop_detection import forget
from slip_vic_controller.safety.modes import begin_modes
from slip_vic_controller.sizes import MAX_CONTACTS, NEVER
from slip_vic_controller.state import ArmState, ControllerConfig, CycleInputs, CycleOutputs, LawState, TaskState


@part
def begin_cycle(
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
        forget_conditions(state.conditions)
        state.joint_bad_ns, state.sliding_ns = NEVER, -1  # what slides in the very first sample is believed
        _without_slip(state.law)
        forget(state.observed)
        start_tare(state.tare, NEVER)
        if lead:
            task.path.scale, task.path.rate = 1.0, 0.0
        start_grip(config.grip, state.grip)
    outputs.answered, outputs.evaluated = 0, 0
    if inputs.health_given != 0:
        outputs.health = inputs.health
    outputs.ledger[0] = state.cycles
    put_time(outputs.ledger, 1, stamp_ns)
    state.cycles += 1


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
    law.given_up.left_s, law.given_up.fast_s = 0.0, 0.0
    law.ramp = state.tuned
    law.ramp.begin_ns = sample.stamp_ns
    if config.cycle.has_observer != 0:
        reset(config.observer, state.observer, sample.stamp_ns, inputs.arm.twist)
    gains_now(state, sample.stamp_ns, outputs)
    begin_pad(config, state, inputs.arm, outputs.gains)
    if lead:
        _begin_task(config, task, state, inputs)


@part
def _begin_task(config: ControllerConfig, task: TaskState, state: ArmState, inputs: CycleInputs) -> None:
    """Begin the object's motion with the law of the first arm."""
    arm = inputs.arm
    task.start_ns = state.joint.answers.stamp_ns
    if config.stream.on != 0:
        rest_stream(task.stream, vec(arm.position), mat(arm.rotation))
    if config.goals.on != 0:
        rest_at(task.goal, Reference(vec(arm.position), mat(arm.rotation), Spatial(ZERO, ZERO), Spatial(ZERO, ZERO)))
    if config.governor.mode != Governing.OFF:
        start_governor(config.governor, task.governor, state.pad)


@part
def _without_slip(law: LawState) -> None:
    """Begin where no object has slipped."""
    for k in range(MAX_CONTACTS):
        put(law.slips[k].position, ZERO)
        put_mat(law.slips[k].rotation, IDENTITY)
