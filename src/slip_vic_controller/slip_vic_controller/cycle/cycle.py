"""The control cycle of all arms that hold one object: records in, records out, one compiled function.

    cycle(configs, state, exchange)

One arm is the ordinary number. The state is the task once (where the object's path is, how fast, goal, stream,
friction), then a row per arm (inputs, mode, law, observer, HOLD, limiter). The law works for all arms or for none, on
one path, at the speed of the slowest, with the friction of the weakest pad.

`state` is advanced in place: copy it to keep it; its bytes are a snapshot, and equal states evolve identically. Nothing
here raises, waits, reads a clock or keeps anything elsewhere. The steps, in the order of a cycle:

    deciding.py     inputs, the tare, what speaks against the law, the mode
    sensing.py      samples, wrench, contact estimate, gains and slip velocity
    governing.py    plan: the path, as fast as friction admits
    modes.py        what each mode does: no command, HOLD, or desired motion and law
    limit.py        limit avoidance, effort limiter, and the command that the drives take; all efforts pass here
"""

from __future__ import annotations

from slip_core.arrays import Array
from slip_core.compiled import IN1, INT, OUT1, kernel, part
from slip_core.records import record, records
from slip_vic_controller.contact.observer import ROW_SIZE
from slip_vic_controller.cycle.deciding import decide, put_time, slows
from slip_vic_controller.cycle.governing import put_governed, screen, step_on_path
from slip_vic_controller.cycle.modes import fail, follow, hold, leave_hold
from slip_vic_controller.cycle.sensing import agree_on_friction, sense
from slip_vic_controller.governor.plan import Governing
from slip_vic_controller.path.paths import advance, lost_ns, relative
from slip_vic_controller.safety.conditions import Reason, Request, because, follows, next_mode
from slip_vic_controller.sizes import NEVER
from slip_vic_controller.state import (
    ARM_SIZE,
    ARM_STATE,
    CONFIG,
    INPUTS,
    INPUTS_SIZE,
    OUTPUTS,
    TASK_SIZE,
    TASK_STATE,
    ArmCycle,
    Arms,
    ArmState,
    CycleOutputs,
)

# -- how the arms agree: the law works for all or for none, on one path, at the speed of the slowest ----


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
    """Let the law run for all arms or for none; store how they hold the object when it starts for all.

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
                mode.enabled, why = 1, because(Reason.INPUTS.value, Reason.OTHER_ARM.value)
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


# -- the cycle ----------------------------------------------------------------------------------------


@part
def end_cycle(c: ArmCycle) -> None:
    """Write mode, the governor's published numbers, and the ledger."""
    config, task, state, inputs, outputs = c.config, c.task, c.state, c.inputs, c.outputs
    outputs.mode, outputs.path_scale, outputs.grip = state.mode, task.path.scale, state.grip.command
    put_governed(c)
    ledger, health, at = outputs.ledger, outputs.health, 3 + 4 * config.law.contacts
    ledger[0] = state.cycles
    state.cycles += 1
    put_time(ledger, 1, state.joint.answers.stamp_ns)
    put_time(ledger, at, inputs.now_ns)
    ledger[at + 2], ledger[at + 4], ledger[at + 5] = state.mode.mode, inputs.request, task.taken
    ledger[at + 3] = health.joint | health.wrench << 8 | health.slip << 16 | health.outside << 24


@kernel(INT, IN1, OUT1, OUT1)
def cycle(config_buffer: Array, state_buffer: Array, exchange: Array) -> int:
    """Answer the joint states that wait for it; return which arms have a command: 1 for the first, 2, 4, ...

    Args:
        config_buffer: CONFIG of every arm.
        state_buffer: TASK_STATE, ARM_STATE of every arm, and the histories of their observers; changed.
        exchange: INPUTS of every arm, then OUTPUTS of every arm; these are written.
    """
    configs = records(config_buffer, CONFIG)
    n = len(configs)
    given, end = n * INPUTS_SIZE, TASK_SIZE + n * ARM_SIZE
    inputs, outputs = records(exchange[:given], INPUTS), records(exchange[given:], OUTPUTS)
    task, states = record(state_buffer[:TASK_SIZE], TASK_STATE), records(state_buffer[TASK_SIZE:end], ARM_STATE)
    history = state_buffer[end:].reshape(-1, ROW_SIZE)
    rows = history.shape[0] // n
    arms = Arms(configs, task, states, inputs, outputs)
    first = ArmCycle(configs[0], task, states[0], inputs[0], outputs[0], True)
    alone = begin_together(arms)
    for k in range(n):
        if inputs[k].present != 0:
            decide(ArmCycle(configs[k], task, states[k], inputs[k], outputs[k], k == 0), arms, alone)
    agree(arms, alone)
    for k in range(n):
        c = ArmCycle(configs[k], task, states[k], inputs[k], outputs[k], k == 0)
        if outputs[k].decided != 0 and not follows(states[k].mode.mode):
            hold(c)
        elif at_work(states[k], outputs[k]) and not follows(outputs[k].before.mode):
            leave_hold(c)
    path_speed = common_path_speed(arms)
    if at_work(states[0], outputs[0]):
        advance_path(first, path_speed)
    for k in range(n):
        if at_work(states[k], outputs[k]):
            c = ArmCycle(configs[k], task, states[k], inputs[k], outputs[k], k == 0)
            cause = sense(c, history[k * rows : (k + 1) * rows])
            if cause != Reason.NONE:
                fail(c, cause)
    agree_on_friction(task, states)
    if configs[0].governor.mode != Governing.OFF and at_work(states[0], outputs[0]):
        step_on_path(first, path_speed)
    answered, holds = 0, False
    for k in range(n):
        c = ArmCycle(configs[k], task, states[k], inputs[k], outputs[k], k == 0)
        if at_work(states[k], outputs[k]):
            follow(c)
        if inputs[k].present != 0:
            states[k].queue.count = 0
            end_cycle(c)
            holds = holds or not follows(states[k].mode.mode)
            answered |= outputs[k].answered << k
    if holds:
        screen(configs[0], task, False)
    return answered
