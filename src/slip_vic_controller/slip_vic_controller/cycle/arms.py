"""How the arms agree: the law works for all of them or for none, on one path, at the speed of the slowest."""

from __future__ import annotations

from slip_core.compiled import part
from slip_vic_controller.cycle.governing import screen
from slip_vic_controller.cycle.judging import slows
from slip_vic_controller.governor.plan import Governing
from slip_vic_controller.path.path_scaling import advance, lost_ns
from slip_vic_controller.path.paths import relative
from slip_vic_controller.safety.conditions import Reason, of_fault
from slip_vic_controller.safety.modes import Request, follows, next_mode
from slip_vic_controller.sizes import NEVER
from slip_vic_controller.state import ArmCycle, Arms, ArmState, CycleOutputs


@part
def begin_together(arms: Arms) -> bool:
    """Let the law of all arms begin in the same cycle, on one path; return whether an arm is not answered in this one.

    An arm that begins without the others holds until they begin with it.
    """
    task, states, inputs = arms.task, arms.states, arms.inputs
    alone, begins = False, task.begun == 0
    for k in range(len(states)):
        alone, begins = alone or inputs[k].present == 0, begins or states[k].law.known == 0
    if begins:
        task.begun = 0
        for k in range(len(states)):
            states[k].law.known = states[k].law.known if alone else 0
    return alone


@part
def at_work(state: ArmState, outputs: CycleOutputs) -> bool:
    """Return whether the law is to be evaluated in this cycle."""
    return bool(outputs.decided != 0 and follows(state.mode.mode))


@part
def agree(arms: Arms, alone: bool) -> None:
    """Let the law work for all arms or for none; take down how they hold the object where it begins for all.

    Arms that hold because another one does count again until they may resume, so that they resume together.
    """
    configs, task, states, inputs, outputs = arms.configs, arms.task, arms.states, arms.inputs, arms.outputs
    n, begun, any_works, all_work = len(states), not alone, False, not alone
    for k in range(n):
        works, begun = at_work(states[k], outputs[k]), begun and states[k].law.known != 0
        any_works, all_work = any_works or works, all_work and (works or inputs[k].present == 0)
    if task.begun == 0 and begun:
        task.begun = 1
        for k in range(n):
            relative(states[0].law, states[k].law, states[k].grasp)
    if any_works and not all_work:
        for k in range(n):
            mode = states[k].mode
            if at_work(states[k], outputs[k]):
                states[k].mode = outputs[k].before
                mode.enabled, why = 1, of_fault(Reason.INPUTS.value, Reason.OTHER_ARM.value)
                next_mode(configs[k].conditions, mode, why, Request.NONE.value, inputs[k].now_ns)
                if outputs[k].health.outside == Reason.NONE:
                    outputs[k].health.outside = Reason.OTHER_ARM.value
            if inputs[k].present != 0:
                mode.good_since_ns = NEVER


@part
def common_path_speed(arms: Arms) -> float:
    """Return how fast the path may be run through for other reasons than friction: as the slowest arm can follow it."""
    states = arms.states
    speed = states[0].observed.path_speed
    for k in range(len(states)):
        speed = min(speed, states[k].observed.path_speed)
        if at_work(states[k], arms.outputs[k]) and slows(arms.configs[k], states[k], arms.inputs[k].now_ns):
            speed = 0.0
    return float(speed)


@part
def advance_path(c: ArmCycle, path_speed: float) -> None:
    """Move on along the path, in the time of the first arm's joint states; c: of the first arm."""
    config, task, state = c.config, c.task, c.state
    dt_ns = max(state.joint.answers.stamp_ns - state.law.stamp_ns, 0)
    screen(config, task, True)
    governed = config.governor.mode != Governing.OFF
    if not governed and (path_speed < 1.0 or task.path.scale != 1.0 or task.path.rate != 0.0):
        advance(task.path, path_speed, dt_ns * 1e-9, config.slow_down_s)
    if governed:
        task.path.scale, task.path.rate = 1.0, 0.0  # the governor brings the path to rest, as friction admits
    task.start_ns += lost_ns(task.path, dt_ns)
