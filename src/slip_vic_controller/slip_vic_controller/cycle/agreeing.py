"""How the arms agree: the law works for all of them or for none, on one path, at the speed of the slowest."""

from __future__ import annotations

from slip_core.compiled import part
from slip_core.records import Records
from slip_vic_controller.cycle.governing import screen
from slip_vic_controller.cycle.holding import bridges_gap
from slip_vic_controller.governor.plan import Governing
from slip_vic_controller.path.path_scaling import advance, lost_ns
from slip_vic_controller.path.paths import relative
from slip_vic_controller.safety.conditions import SEVERITIES, Reason, Severity, of_fault, read_why
from slip_vic_controller.safety.modes import follows, next_mode
from slip_vic_controller.sizes import NEVER
from slip_vic_controller.state import ArmState, ControllerConfig, CycleInputs, CycleOutputs, Step, TaskState


@part
def begin_together(task: TaskState, states: Records[ArmState], inputs: Records[CycleInputs]) -> bool:
    """Let the law of all arms begin in the same cycle, on one path; return whether an arm is not answered in this one.

    An arm that begins without the others holds until they begin with it.
    """
    alone, begins = False, task.begun == 0
    for k in range(len(states)):
        alone = alone or inputs[k].present == 0
        begins = begins or states[k].law.known == 0 or (inputs[k].present != 0 and _restarts(states[k], inputs[k]))
    if len(states) > 1 and not alone:
        for k in range(len(states)):
            if begins and not _restarts(states[k], inputs[k]):
                states[k].law.known = 0
    if begins:
        task.begun = 0
    return alone


@part
def _restarts(state: ArmState, inputs: CycleInputs) -> bool:
    """Return whether the source of an arm's joint states has restarted."""
    fault = inputs.health.joint if inputs.health_given != 0 else state.joint.pending_fault
    return bool(fault == Reason.RESTARTED)


@part
def agree(
    configs: Records[ControllerConfig],
    task: TaskState,
    states: Records[ArmState],
    inputs: Records[CycleInputs],
    outputs: Records[CycleOutputs],
    alone: bool,
) -> None:
    """Let the law work for all arms or for none; take down how they hold the object where it begins for all."""
    n = len(states)
    begun, any_works, all_work = not alone, False, not alone
    for k in range(n):
        if inputs[k].present != 0:
            works = _works(configs[k], states[k], inputs[k], outputs[k])
            outputs[k].decision.works = 1 if works else 0
            any_works, all_work = any_works or works, all_work and works
        begun = begun and states[k].law.known != 0
    if task.begun == 0 and begun:
        task.begun = 1
        for k in range(n):
            relative(states[0].law, states[k].law, states[k].grasp)
    if any_works and not all_work:
        for k in range(n):
            if inputs[k].present != 0:
                hold_with_the_others(configs[k], states[k], inputs[k], outputs[k])


@part
def _works(config: ControllerConfig, state: ArmState, inputs: CycleInputs, outputs: CycleOutputs) -> bool:
    """Return whether the law works in this cycle, or its last effort is repeated."""
    step = outputs.decision.step
    if step == Step.BRIDGE and not bridges_gap(config, state, inputs.now_ns):
        return False
    return step != Step.NONE and follows(state.mode.mode)


@part
def hold_with_the_others(config: ControllerConfig, state: ArmState, inputs: CycleInputs, outputs: CycleOutputs) -> None:
    """Hold because another arm does; all count again from here until they may resume, so they resume together."""
    decision = outputs.decision
    if decision.works != 0:
        state.mode = decision.before
        why = read_why(decision.why)
        if SEVERITIES[why.reason] != Severity.FAULT:
            why = of_fault(Reason.INPUTS.value, Reason.OTHER_ARM.value)
        next_mode(config.modes, state.mode, why, decision.request, inputs.now_ns)
        if outputs.health.outside == Reason.NONE:
            outputs.health.outside = Reason.OTHER_ARM.value
    state.mode.good_since_ns = NEVER


@part
def evaluates_law(state: ArmState, outputs: CycleOutputs) -> bool:
    """Return whether the law is to be evaluated in this cycle."""
    return bool(outputs.decision.step == Step.ANSWER and follows(state.mode.mode))


@part
def common_path_speed(states: Records[ArmState], outputs: Records[CycleOutputs]) -> float:
    """Return how fast the path may be run through for other reasons than friction: as the slowest arm can follow it."""
    speed = states[0].observed.path_speed
    for k in range(len(states)):
        speed = min(speed, states[k].observed.path_speed)
    for k in range(len(states)):
        if evaluates_law(states[k], outputs[k]) and outputs[k].decision.slows != 0:
            speed = 0.0
    return float(speed)


@part
def advance_path(config: ControllerConfig, task: TaskState, state: ArmState, path_speed: float) -> None:
    """Move on along the path, in the time of the first arm's joint states; state: of the first arm."""
    dt_ns = max(state.joint.answers.stamp_ns - state.law.stamp_ns, 0)
    screen(config, task, True)
    governed = config.governor.mode != Governing.OFF
    if not governed and (path_speed < 1.0 or task.path.scale != 1.0 or task.path.rate != 0.0):
        advance(task.path, path_speed, dt_ns * 1e-9, config.cycle.slow_down_s)
    if governed:
        task.path.scale, task.path.rate = 1.0, 0.0  # the governor brings the path to rest, as friction admits
    task.start_ns += lost_ns(task.path, dt_ns)


@part
def share_path_speed(states: Records[ArmState], outputs: Records[CycleOutputs]) -> None:
    """Let all arms count as the one that follows worst, where the law has worked for all."""
    speed, n = states[0].observed.path_speed, len(states)
    for k in range(n):
        if outputs[k].decision.works == 0:
            return
        speed = min(speed, states[k].observed.path_speed)
    for k in range(n):
        states[k].observed.path_speed = speed
