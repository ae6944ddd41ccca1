"""The controller between ticks: collected inputs, the memories of law and supervision, one cycle after the other.

The node, the in-process loop and bag replay all run this same class.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from slip_core.arrays import readonly
from slip_core.errors import InputError
from slip_core.params import flatten
from slip_core.stamps import split_ns
from slip_core.types import CartesianReference, EffortCommand, JointSample
from slip_vic_controller.core.controller import VicController
from slip_vic_controller.core.diagnostics import TickDiagnostics
from slip_vic_controller.core.input_monitor import GOOD, USABLE, Health, InputMonitor
from slip_vic_controller.core.inputs import InputBuffer, TickInputs
from slip_vic_controller.core.modes import Mode, ModeState, Request
from slip_vic_controller.core.params import ControllerParams
from slip_vic_controller.core.state import ControllerState
from slip_vic_controller.core.supervision import Supervisor
from slip_vic_controller.core.supervisor_state import Supervised, SupervisorState
from slip_vic_controller.core.trouble import Trouble, say
from slip_vic_controller.core.tuning import gain_report, make_tuning

RETUNABLE = ("gains.", "object.", "contacts.position")
"""Parameters that ramp while the law runs."""

NO_EFFORT = readonly(np.zeros(0))
NO_STAMP = (0, 0)


class CycleResult(NamedTuple):
    """One answered cycle; an empty effort means "no command": an input has never been seen.

    ledger: [cycle, state sec, nanosec, then per contact the newest wrench's and slip's sec, nanosec].
    decision: [controller's clock sec, nanosec, mode, worth of the inputs, request]: with the ledger all that a cycle
    depends on. path_speed: 1 = the trajectory as planned.
    """

    cycle: int
    joint: JointSample
    command: EffortCommand
    ledger: tuple[int, ...]
    diagnostics: TickDiagnostics | None
    mode: ModeState
    decision: tuple[int, ...]
    path_speed: float = 1.0


class ControllerSession:
    """Runs the law, under supervision, whenever a set of inputs is complete.

    Args:
        controller: the law with its parameters.
        lockstep: whether to wait for exactly the samples the bridge lists, and to take its stamps as the clock.
    """

    def __init__(self, controller: VicController, *, lockstep: bool) -> None:
        params = controller.params
        self._controller = controller
        self.contacts = len(controller.contacts)
        self.monitor = InputMonitor(controller.arm, params.safety.inputs, self.contacts, lockstep=lockstep)
        self.inputs = InputBuffer(
            self.contacts, lockstep=lockstep, monitor=self.monitor, slip_needed=params.controller == "vic"
        )
        self.supervisor = Supervisor(controller)
        self.state: ControllerState | None = None
        self.safety: SupervisorState | None = None
        self.cycles = 0
        self.active = True
        self._lockstep = lockstep
        self._reference: CartesianReference | None = None
        self._request = Request.NONE
        self._tuned: ControllerParams | None = None

    @property
    def reference_from_topic(self) -> bool:
        """Whether the reference comes from outside instead of the built-in trajectory."""
        return self._controller.params.trajectory.kind == "topic"

    @property
    def mode(self) -> Mode:
        """The mode of the last cycle."""
        return Mode.WAITING_INPUT if self.safety is None else self.safety.mode.mode

    def set_reference(self, reference: CartesianReference) -> None:
        """Use this reference from the next cycle on.

        Implements: ours: reference by topic.
        """
        self._reference = reference

    def retune(self, params: ControllerParams) -> None:
        """Let gains and payload ramp to those of `params`, from the next cycle on.

        Raises:
            InputError: the values are refused as a whole, or something else has changed; nothing has happened then.

        Implements: ours: gains change without a kick.
        """
        now, wanted = flatten(self._tuned or self._controller.params), flatten(params)
        for name, value in wanted.items():
            if value != now[name] and not name.startswith(RETUNABLE):
                raise InputError(
                    f"parameter {name}", got=value, expected=f"{now[name]!r} while the law runs", fix="restart the node"
                )
        if self.state is None:
            make_tuning(params, gain_report(params).used)
        else:
            self.state = self._controller.retune(self.state, params)
        self._tuned = params

    def snapshot(self) -> tuple[Any, ...]:
        """Return the whole memory with which the next cycle begins, as values; `snapshot.to_text` writes it.

        Implements: ours: a replay can begin at any of them.
        """
        return self.cycles, self.state, self.safety, self.monitor.joint.memory()

    def restore(self, memory: tuple[Any, ...]) -> None:
        """Go on from a snapshot."""
        self.cycles, self.state, self.safety, joint = memory
        self.monitor.joint.recall(joint)

    def know(self, params: ControllerParams) -> None:
        """Take parameters that were set before the state which `restore` was given: their ramp is part of it."""
        self._tuned = params

    def set_active(self, active: bool) -> None:
        """Start anew, or answer without effort until then; a fault stays."""
        self.active, self.state = active, None

    def request(self, request: Request) -> None:
        """Ask for a mode; the next cycle decides."""
        self._request = request

    def cycle(self, now_ns: int | None = None, health: Health | None = None) -> CycleResult | None:
        """Answer the collected inputs, or return None where the set is not complete yet.

        Args:
            now_ns: steady time; None, and lockstep, take the joint state's stamp.
            health: what the inputs are worth; None asks the monitor, replay gives what the run's monitor said.

        Implements: ours: one output per joint state.
        """
        if not self.inputs.complete():
            return None
        joint, trouble = self.inputs.newest_joint, self.inputs.joint_trouble
        missing = self.inputs.missing()
        inputs = self.inputs.take()
        now = joint.stamp_ns if now_ns is None or self._lockstep else now_ns
        request, self._request = self._request, Request.NONE
        safety = self.supervisor.initial_state(now) if self.safety is None else self.safety
        if trouble == Trouble.RESTARTED and self.state is not None:
            self.state = None
            # The gate goes on from the last command, where that is recent: the joints feel it still.
            safety = self.supervisor.waiting(safety, say("joint state", trouble), request, now)._replace(
                gate=safety.gate
            )
        if self.state is None and trouble not in USABLE:
            missing.insert(0, "a good joint state")
        if not self.active:
            missing.insert(0, "activation")
        if inputs is None or missing:
            self.safety = self.supervisor.waiting(safety, f"waits for {', '.join(missing)}", request, now)
            return self._waiting(joint, now, GOOD if health is None else health, request)
        if health is None:
            health = self.monitor.health(trouble, joint.stamp_ns, now)
        if self.state is None:
            self.state = self._controller.initial_state(joint)
            if self._tuned is not None:
                self.state = self._controller.retune(self.state, self._tuned)
        done = self.supervisor.step(
            safety, self.state, now, joint, inputs.wrenches, inputs.slips, health, self.monitor.joint.frozen(now),
            request, self._reference, inputs.new_slips[0],
        )  # fmt: skip
        return self._done(done, joint, self._used(joint, inputs), now, health, request)

    def watchdog(self, now_ns: int) -> CycleResult | None:
        """Return a command where joint states have stayed away for too long, None where all is well.

        It repeats until the effort has come down to gravity compensation; the bridge's command timeout does the rest.

        Implements: ours: a watchdog on the steady clock, so that it bites when every other clock stands still.
        """
        if (
            not self.active
            or self._lockstep
            or self.state is None
            or self.safety is None
            or not self.monitor.joint.silent(now_ns)
        ):
            return None
        newest = self.monitor.joint.newest
        if newest is None or self.safety.mode.mode == Mode.WAITING_INPUT:
            return None
        health = Health(joint=Trouble.SILENT)
        request, self._request = self._request, Request.NONE
        before = self.safety
        done = self.supervisor.without_joint_state(before, self.state, now_ns, request)
        settled = before.gate is not None and (before.gate.effort == done.command.effort).all()
        if settled and before.mode == done.state.mode:
            return None
        ledger = (self.cycles, *split_ns(newest.stamp_ns), *(NO_STAMP * 2 * self.contacts))
        return self._done(done, newest, ledger, now_ns, health, request)

    def _used(self, joint: JointSample, inputs: TickInputs) -> tuple[int, ...]:
        used = [
            number
            for wrench, slip in zip(inputs.wrenches, inputs.slips, strict=True)
            for number in (*split_ns(wrench.stamp_ns), *split_ns(slip.stamp_ns))
        ]
        return (self.cycles, *split_ns(joint.stamp_ns), *used)

    def _done(
        self, done: Supervised, joint: JointSample, ledger: tuple[int, ...], now: int, health: Health, request: Request
    ) -> CycleResult:
        self.state, self.safety = done.control, done.state
        cycle = self.cycles
        self.cycles += 1
        mode = done.state.mode
        decision = (*split_ns(now), int(mode.mode), health.code(), int(request))
        return CycleResult(cycle, joint, done.command, ledger, done.diagnostics, mode, decision, done.state.path.scale)

    def _waiting(self, joint: JointSample, now: int, health: Health, request: Request) -> CycleResult:
        assert self.safety is not None
        cycle = self.cycles
        self.cycles += 1
        mode = self.safety.mode
        ledger = (cycle, *split_ns(joint.stamp_ns), *(NO_STAMP * 2 * self.contacts))
        decision = (*split_ns(now), int(mode.mode), health.code(), int(request))
        return CycleResult(cycle, joint, EffortCommand(joint.stamp_ns, NO_EFFORT), ledger, None, mode, decision)
