"""The control cycle of all arms that hold one object: records in, records out, one compiled function.

    cycle(configs, state, exchange)

One arm is the ordinary number. The state is the task once (where the object's path is, how fast, goal, stream,
friction), then a row per arm (inputs, mode, law, observer, HOLD, limiter). A cycle decides for every arm, lets the arms
agree, and acts for every arm: the law works for all of them or for none, on one path, at the speed of the slowest, with
the friction of the weakest pad. One arm always agrees with itself.

`state` is advanced in place: copy it to keep it; its bytes are a snapshot, and equal states evolve identically. Nothing
here raises, waits, reads a clock or keeps anything elsewhere. On its way a joint state passes input validation (when it
arrives), arbitration and modes, then the law (or HOLD), limit avoidance and the effort limiter; every command comes out
of `finish`.

The steps, in the order of a cycle:

    agreeing.py     the law begins for all arms, works for all or for none, on one path, at one speed
    beginning.py    a cycle of an arm begins, and the law does, where the arm is
    deciding.py     faults of the inputs, what speaks against the law, the mode
    taring.py       sensors read at rest, and what of that is a bias
    holding.py      instead of the law: HOLD, the bridge over a gap, no command
    sensing.py      samples, gains, slip velocity and load
    commanding.py   desired motion and law
    finishing.py    limit avoidance, effort limiter, and the command that the drives take

What several steps read: wrench.py (on the pad, measured or of the model), gains.py (in effect), ledger.py.
"""

from __future__ import annotations

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import IN1, INT, OUT1, VOID, kernel
from slip_core.records import record, records
from slip_vic_controller.contact.layouts import ROW_SIZE
from slip_vic_controller.cycle.agreeing import (
    advance_path,
    agree,
    begin_together,
    common_path_speed,
    evaluates_law,
    share_path_speed,
)
from slip_vic_controller.cycle.beginning import begin_cycle
from slip_vic_controller.cycle.commanding import follow
from slip_vic_controller.cycle.contact import agree_on_friction
from slip_vic_controller.cycle.deciding import decide_mode
from slip_vic_controller.cycle.finishing import finish
from slip_vic_controller.cycle.governing import screen, step_on_path
from slip_vic_controller.cycle.holding import leave_to_drives, prepare
from slip_vic_controller.cycle.ledger import end_cycle
from slip_vic_controller.cycle.sensing import sense_all
from slip_vic_controller.cycle.taring import all_at_rest
from slip_vic_controller.governor.plan import Governing
from slip_vic_controller.law.symbols import SYMBOLS, no_symbols, symbols
from slip_vic_controller.safety.conditions import Reason, of_fault, read_why, same_words
from slip_vic_controller.safety.effort_limiter import go_on
from slip_vic_controller.safety.modes import follows, next_mode
from slip_vic_controller.sizes import MAX_JOINTS
from slip_vic_controller.state import ARM_SIZE, ARM_STATE, CONFIG, INPUTS, INPUTS_SIZE, OUTPUTS, TASK_SIZE, TASK_STATE

ANSWERED, CHANGED = 1, 2
"""What the watchdog returns."""


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
    given = n * INPUTS_SIZE
    inputs, outputs = records(exchange[:given], INPUTS), records(exchange[given:], OUTPUTS)
    end = TASK_SIZE + n * ARM_SIZE
    task, states = record(state_buffer[:TASK_SIZE], TASK_STATE), records(state_buffer[TASK_SIZE:end], ARM_STATE)
    history = state_buffer[end:].reshape(-1, ROW_SIZE)
    alone = begin_together(task, states, inputs)
    together = all_at_rest(configs, states, inputs)
    for k in range(n):
        if inputs[k].present != 0:
            decide_mode(configs[k], task, states[k], inputs[k], outputs[k], k == 0, alone, together)
    agree(configs, task, states, inputs, outputs, alone)
    for k in range(n):
        if inputs[k].present != 0:
            prepare(configs[k], task, states[k], inputs[k], outputs[k], k == 0)
    path_speed = common_path_speed(states, outputs)
    if evaluates_law(states[0], outputs[0]):
        advance_path(configs[0], task, states[0], path_speed)
    sense_all(configs, task, states, history, inputs, outputs)
    if configs[0].governor.mode != Governing.OFF and evaluates_law(states[0], outputs[0]):
        agree_on_friction(configs[0], task, states)
        step_on_path(configs[0], task, states[0], inputs[0].arm, outputs[0], path_speed)
    answered, holds = 0, False
    for k in range(n):
        if evaluates_law(states[k], outputs[k]):
            follow(configs[k], task, states[k], inputs[k], outputs[k], k == 0)
    share_path_speed(states, outputs)
    for k in range(n):
        if inputs[k].present != 0:
            if outputs[k].decision.never_seen == 0:
                states[k].queue.count = 0
            end_cycle(configs[k], task, states[k], inputs[k], outputs[k])
            holds = holds or not follows(states[k].mode.mode)
            answered |= outputs[k].answered << k
    if holds:
        screen(configs[0], task, False)
    return answered


@kernel(INT(IN1, OUT1, OUT1, INT, INT, INT))
def watchdog(config_buffer: Array, state_buffer: Array, exchange: Array, arm: int, now_ns: int, request: int) -> int:
    """Answer that joint states of an arm stay away: HOLD, efforts go to gravity compensation where the arm was.

    Where no command was given before, there is none now.

    Args:
        config_buffer, state_buffer, exchange: as in `cycle`; INPUTS are written, too.
        arm: number of the arm.
        now_ns: the controller's clock.
        request: as in CycleInputs.

    Returns:
        ANSWERED where there is a command, CHANGED where effort or mode have changed by it, or both.
    """
    configs, task = records(config_buffer, CONFIG), record(state_buffer[:TASK_SIZE], TASK_STATE)
    given = len(configs) * INPUTS_SIZE
    config, inputs = configs[arm], records(exchange[:given], INPUTS)[arm]
    outputs = records(exchange[given:], OUTPUTS)[arm]
    begin = TASK_SIZE + arm * ARM_SIZE
    state = record(state_buffer[begin : begin + ARM_SIZE], ARM_STATE)
    n = config.law.joints
    inputs.present, inputs.now_ns, inputs.request = 1, now_ns, request
    begin_cycle(config, task, state, inputs, outputs, state.law.stamp_ns, arm == 0)
    outputs.health.joint = Reason.SILENT.value
    mode, since, enabled = state.mode.mode, state.mode.good_since_ns, state.mode.enabled
    before = read_why(state.mode.reason)
    effort, velocity = state.limiter.effort.copy(), state.motion.velocity.copy()
    silent = of_fault(Reason.JOINT_STATE.value, Reason.SILENT.value)
    next_mode(config.modes, state.mode, silent, inputs.request, inputs.now_ns)
    task.path.scale, task.path.rate, state.hold.known = 0.0, 0.0, 0
    outputs.wanted[:n] = state.law.gravity[:n]
    if state.limiter.started != 0:
        go_on(config.motion.drive, state.limiter, inputs.now_ns)
        rest = np.zeros(MAX_JOINTS)
        finish(config, state, inputs, outputs, state.law.position, rest, False)
    else:
        leave_to_drives(config, state, inputs)  # as before
    end_cycle(config, task, state, inputs, outputs)
    if not follows(state.mode.mode):
        screen(configs[0], task, False)
    same_mode = state.mode.mode == mode and state.mode.good_since_ns == since and state.mode.enabled == enabled
    same = same_mode and same_words(before, read_why(state.mode.reason))
    for j in range(n):
        same = same and state.limiter.effort[j] == effort[j] and state.motion.velocity[j] == velocity[j]
    return (ANSWERED if outputs.answered != 0 else 0) | (0 if same else CHANGED)


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
