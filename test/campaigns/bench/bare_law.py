"""The law alone, to see what the rest of a cycle costs: no input validation, modes, limits or fallbacks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import IN1, INT, OUT1, VOID, kernel
from slip_core.records import new, place, record
from slip_core.types import EffortCommand, JointSample, SlipSample, WrenchSample
from slip_vic_controller.contact.layouts import ROW_SIZE
from slip_vic_controller.cycle.beginning import begin_law
from slip_vic_controller.cycle.commanding import command, keep_law
from slip_vic_controller.cycle.sensing import sense
from slip_vic_controller.safety.validation import await_answer, queue_slip
from slip_vic_controller.session.controller import Controller
from slip_vic_controller.state import ARM_SIZE, ARM_STATE, CONFIG, INPUTS, OUTPUTS, TASK_SIZE, TASK_STATE


@kernel(VOID(IN1, OUT1, IN1, OUT1, INT, IN1, IN1, IN1, INT, IN1))
def law_alone(
    config: Array, state: Array, inputs: Array, outputs: Array, stamp_ns: int, q: Array, qd: Array, wrench: Array,
    slip_ns: int, twist: Array,
) -> None:  # fmt: skip
    """Evaluate the law on one joint state, wrench and slip velocity; records as of `cycle`."""
    c, task = record(config, CONFIG), record(state[:TASK_SIZE], TASK_STATE)
    s = record(state[TASK_SIZE : TASK_SIZE + ARM_SIZE], ARM_STATE)
    i, o = record(inputs, INPUTS), record(outputs, OUTPUTS)
    history = state[TASK_SIZE + ARM_SIZE :].reshape(-1, ROW_SIZE)
    await_answer(s.joint, stamp_ns, q, qd, qd, 0)
    task.path.scale, s.wrench_inputs[0].values[:], s.slip_inputs[0].values[:] = 1.0, wrench, twist
    queue_slip(s.queue, slip_ns, twist)
    if s.law.known == 0:
        begin_law(c, task, s, i, o, True)
    sense(c, task, s, history, i, o, False)
    command(c, task, s, i, o, True)
    keep_law(c, s, i, o)
    s.queue.count = 0


class BareLaw:
    """A controller that is nothing but the law.

    Args:
        controller: its configuration; one contact.
    """

    def __init__(self, controller: Controller) -> None:
        self._controller, self._state = controller, controller.new_state()
        self._arm, self._effort = place(INPUTS, "arm"), place(OUTPUTS, "law.effort")

    def answer(self, joint: JointSample, wrench: WrenchSample, slips: Sequence[SlipSample]) -> EffortCommand:
        """Return the command for a joint state, the newest wrench, and the slip samples since the last call."""
        inputs, outputs, slip = new(INPUTS), new(OUTPUTS), slips[-1]
        self._controller.first.robot.terms(joint.position, joint.velocity, inputs[self._arm])
        law_alone(
            self._controller.config, self._state, inputs, outputs, joint.stamp_ns, joint.position, joint.velocity,
            wrench.wrench, slip.stamp_ns, slip.twist,
        )  # fmt: skip
        effort = outputs[self._effort][: len(joint.position)]
        return EffortCommand(joint.stamp_ns, np.ascontiguousarray(effort))
