"""The controller between ticks: collected inputs, the law's memory, and one cycle after the other.

The node, the in-process loop and bag replay all run this same class.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slip_msgs_py.arrays import readonly
from slip_msgs_py.stamps import split_ns
from slip_msgs_py.types import CartesianReference, EffortCommand, JointSample
from slip_vic_controller.core.controller import VicController
from slip_vic_controller.core.diagnostics import TickDiagnostics
from slip_vic_controller.core.inputs import InputBuffer
from slip_vic_controller.core.state import ControllerState

NO_EFFORT = readonly(np.zeros(0))
NO_STAMP = (0, 0)


@dataclass(frozen=True, slots=True)
class CycleResult:
    """One answered cycle; an empty effort means "no command": an input has never been seen.

    ledger: [cycle, state sec, nanosec, then per contact the newest wrench's and slip's sec, nanosec].
    """

    cycle: int
    joint: JointSample
    command: EffortCommand
    ledger: tuple[int, ...]
    diagnostics: TickDiagnostics | None


class ControllerSession:
    """Runs the law whenever a set of inputs is complete.

    Args:
        controller: the law with its parameters.
        lockstep: whether to wait for exactly the samples the bridge lists.
    """

    def __init__(self, controller: VicController, *, lockstep: bool) -> None:
        self._controller = controller
        self.contacts = len(controller.contacts)
        self.inputs = InputBuffer(self.contacts, lockstep=lockstep)
        self.state: ControllerState | None = None
        self.cycles = 0
        self._reference: CartesianReference | None = None

    @property
    def reference_from_topic(self) -> bool:
        """Whether the reference comes from outside instead of the built-in trajectory."""
        return self._controller.params.trajectory.kind == "topic"

    def set_reference(self, reference: CartesianReference) -> None:
        """Use this reference from the next cycle on.

        Implements: ours: reference by topic.
        """
        self._reference = reference

    def cycle(self) -> CycleResult | None:
        """Answer the collected inputs, or return None where the set is not complete yet.

        Implements: ours: one output per joint state.
        """
        if not self.inputs.complete():
            return None
        joint = self.inputs.newest_joint
        inputs = self.inputs.take()
        cycle = self.cycles
        self.cycles += 1
        if inputs is None:
            ledger = (cycle, *split_ns(joint.stamp_ns), *(NO_STAMP * 2 * self.contacts))
            return CycleResult(cycle, joint, EffortCommand(joint.stamp_ns, NO_EFFORT), ledger, None)
        if self.state is None:
            self.state = self._controller.initial_state(joint)
        result = self._controller.step(self.state, joint, inputs.wrenches, inputs.slips, self._reference)
        self.state = result.state
        used = [
            number
            for wrench, slip in zip(inputs.wrenches, inputs.slips, strict=True)
            for number in (*split_ns(wrench.stamp_ns), *split_ns(slip.stamp_ns))
        ]
        ledger = (cycle, *split_ns(joint.stamp_ns), *used)
        return CycleResult(cycle, joint, result.command, ledger, result.diagnostics)
