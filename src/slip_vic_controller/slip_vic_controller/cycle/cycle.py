"""The control cycle of all arms that hold one object: records in, records out, one compiled function.

    cycle(configs, state, exchange)

One arm is the ordinary number. The state is the task once (where the object's path is, how fast, goal, stream,
friction), then a row per arm (inputs, mode, law, observer, HOLD, limiter). The law works for all arms or for none, on
one path, at the speed of the slowest, with the friction of the weakest pad.

`state` is advanced in place: copy it to keep it; its bytes are a snapshot, and equal states evolve identically. Nothing
here raises, waits, reads a clock or keeps anything elsewhere. The steps, in the order of a cycle:

    deciding.py     inputs, the tare (taring.py), what speaks against the law (judging.py), the mode
    arms.py         the law begins for all arms, and works for all or for none
    holding.py      without the law: HOLD, no command where nothing tells where the arm is, and back to the law
    sensing.py      samples, gains, slip velocity and load (contact.py)
    governing.py    plan: the path, as fast as friction admits
    law.py          desired motion and law
    limit.py        limit avoidance, effort limiter, and the command that the drives take; all efforts pass here

wrench.py has the wrench on the pad, measured or of the model, which several of them read.
"""

from __future__ import annotations

from slip_core.arrays import Array
from slip_core.compiled import IN1, INT, OUT1, VOID, kernel, part
from slip_core.records import record, records
from slip_vic_controller.contact.layouts import ROW_SIZE
from slip_vic_controller.cycle.arms import advance_path, agree, at_work, begin_together, common_path_speed
from slip_vic_controller.cycle.contact import agree_on_friction
from slip_vic_controller.cycle.deciding import decide, put_time
from slip_vic_controller.cycle.governing import put_governed, screen, step_on_path
from slip_vic_controller.cycle.holding import fail, hold, leave_hold
from slip_vic_controller.cycle.law import follow
from slip_vic_controller.cycle.sensing import sense
from slip_vic_controller.cycle.taring import all_at_rest
from slip_vic_controller.governor.plan import Governing
from slip_vic_controller.law.symbols import SYMBOLS, no_symbols, symbols
from slip_vic_controller.safety.conditions import Reason
from slip_vic_controller.safety.modes import follows
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
)


@part
def end_cycle(c: ArmCycle) -> None:
    """Write mode, what is published of the governor, and the ledger."""
    config, task, state, inputs, outputs = c.config, c.task, c.state, c.inputs, c.outputs
    outputs.mode, outputs.path_scale, outputs.grip = state.mode, task.path.scale, state.grip.command
    put_governed(config, task, state, outputs.governor)
    ledger, health, at = outputs.ledger, outputs.health, 3 + 4 * config.law.contacts
    ledger[0] = state.cycles
    state.cycles += 1
    put_time(ledger, 1, state.joint.answers.stamp_ns)
    put_time(ledger, at, inputs.now_ns)
    ledger[at + 2], ledger[at + 4], ledger[at + 5] = state.mode.mode, inputs.request, task.taken
    ledger[at + 3] = health.joint | health.wrench << 8 | health.slip << 16 | health.outside << 24


@kernel(INT(IN1, OUT1, OUT1))
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
    alone, together = begin_together(arms), all_at_rest(arms)
    for k in range(n):
        if inputs[k].present != 0:
            decide(ArmCycle(configs[k], task, states[k], inputs[k], outputs[k], k == 0), alone, together)
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
    if configs[0].governor.mode != Governing.OFF and at_work(states[0], outputs[0]):
        agree_on_friction(configs[0], task, states)
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


@kernel(VOID(IN1, IN1, IN1, OUT1))
def describe(config_buffer: Array, inputs_buffer: Array, outputs_buffer: Array, symbols_buffer: Array) -> None:
    """Fill the SYMBOLS of an arm's cycle, when something looks at them.

    Args:
        config_buffer, inputs_buffer, outputs_buffer: CONFIG, INPUTS, OUTPUTS of the arm, after `cycle`.
        symbols_buffer: SYMBOLS.
    """
    config, out = record(config_buffer, CONFIG), record(symbols_buffer, SYMBOLS)
    inputs, outputs = record(inputs_buffer, INPUTS), record(outputs_buffer, OUTPUTS)
    no_symbols(outputs.effort, outputs.saturated, symbols_buffer)
    if outputs.ok != 0:
        law, estimate = outputs.law, outputs.estimate
        symbols(config.law, outputs.gains, inputs.arm, outputs.slips, outputs.reference, law, estimate, out)
        for j in range(config.law.joints):
            out.effort[j], out.saturated[j] = outputs.effort[j], outputs.saturated[j]
