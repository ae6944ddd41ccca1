"""The result of a cycle for one arm: its command, its mode and reason, its ledger, and the numbers worth plotting.

The incidents of a run are found in its results, each kind once.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np

from slip_core.arrays import Array, readonly
from slip_core.records import new, place, record
from slip_core.types import Incident, JointCommand, JointSample
from slip_vic_controller.config.controller import ArmController
from slip_vic_controller.law.symbols import SYMBOLS, published
from slip_vic_controller.safety.conditions import Mode, Reason
from slip_vic_controller.session.symbols import fill_symbols
from slip_vic_controller.session.words import describe, reason_fields
from slip_vic_controller.state import GOVERNED, INPUTS, OUTPUTS

_LEDGER = place(OUTPUTS, "ledger")
_EFFORT = place(OUTPUTS, "effort")
_CAUSE = place(OUTPUTS, "mode.reason").start
_REASON = slice(_CAUSE, _CAUSE + 4)
_GOVERNED, _GOVERNED_NAMES = place(OUTPUTS, "governor"), GOVERNED.names or ()
_GRIP = place(OUTPUTS, "grip").start

NO_NUMBERS = readonly(np.zeros(0))

UNREACHABLE_S: Final = 2.0
"""How long the path may wait for the arm, or for friction, before its end is reported as not reached."""


class Health(NamedTuple):
    """The fault of each input in one cycle; NONE = good. `slip` and `wrench` are the worst of all contacts."""

    joint: Reason = Reason.NONE
    wrench: Reason = Reason.NONE
    slip: Reason = Reason.NONE
    outside: Reason = Reason.NONE

    @staticmethod
    def from_code(code: int) -> Health:
        """Read the number in the ledger: a replay uses what the run found, whose arrival times no bag has."""
        return Health(*(Reason(code >> shift & 0xFF) for shift in (0, 8, 16, 24)))


class CycleResult:
    """One answered cycle; an empty command means "no command": an input has never been seen.

    joint: the joint state; numbers: what is commanded, as `command.interface` has it, (n,) [N m], [rad/s] or [rad];
    mode; inputs, outputs: records of the arm.
    """

    __slots__ = ("_controller", "inputs", "joint", "mode", "numbers", "outputs")

    def __init__(
        self, controller: ArmController, joint: JointSample, mode: Mode, numbers: Array, inputs: Array, outputs: Array
    ) -> None:
        self._controller, self.joint, self.mode, self.numbers = controller, joint, mode, numbers
        self.inputs, self.outputs = inputs, outputs

    @property
    def command(self) -> JointCommand:
        """The command that answers the joint state."""
        return self._controller.make_command(self.joint.stamp_ns, self.numbers)

    @property
    def effort(self) -> Array:
        """Effort of the law or of what stands in for it; (n,) [N m], empty where there is no command.

        Drives that take velocities or positions are commanded the motion that it gives the arm.
        """
        return self.outputs[_EFFORT][: len(self.numbers)]

    @property
    def ledger(self) -> tuple[int, ...]:
        """What it used: the cycle, and the stamps (sec, nanosec) of joint state, wrench and slip of each contact."""
        return tuple(self._numbers(0, 3 + 4 * self._controller.contacts))

    @property
    def decision(self) -> tuple[int, ...]:
        """On what it decided, behind the ledger; where references or goals come by topic, also how many were taken."""
        begin = 3 + 4 * self._controller.contacts
        return tuple(self._numbers(begin, begin + 5 + self._controller.external))

    def _numbers(self, begin: int, end: int) -> list[int]:
        return self.outputs[_LEDGER][begin:end].view(np.int64).tolist()

    @property
    def grip(self) -> float:
        """Grip force that is commanded [N]."""
        return float(self.outputs[_GRIP])

    @property
    def reason_key(self) -> tuple[int, ...]:
        """What is different where the words of the reason are, but for their numbers."""
        return tuple(self.outputs.view(np.int64)[_REASON].tolist())

    @property
    def arm(self) -> Any:
        """The arm's terms by name; zeros where the joint state was not good."""
        return record(self.inputs, INPUTS).arm

    @property
    def record(self) -> Any:
        """The outputs by name."""
        return record(self.outputs, OUTPUTS)

    @property
    def reason(self) -> str:
        """Why the controller is in its mode, in words."""
        return describe(self.record.mode.reason, self._controller.robot.joint_names)

    @property
    def reason_fields(self) -> dict[str, object]:
        """The reason as fields: name and number, what is wrong with an input, joint or place, value and limit."""
        return reason_fields(self.record.mode.reason, self._controller.robot.joint_names)

    @property
    def symbol_names(self) -> tuple[str, ...]:
        """Names of `symbols`, the same in every cycle of a controller."""
        names = published(len(self._controller.robot.joint_names))[0]
        return (*names, *_GOVERNED_NAMES) if self._governed else names

    def symbols(self) -> Array:
        """Return the numbers worth plotting, in the order of `symbol_names`; NaN where there is none."""
        symbols = new(SYMBOLS)
        fill_symbols(self._controller.config, self.inputs, self.outputs, symbols)
        numbers = symbols[published(len(self._controller.robot.joint_names))[1]]
        return np.concatenate((numbers, self.outputs[_GOVERNED])) if self._governed else numbers

    def scalars(self) -> dict[str, float]:
        """Return `symbols` by name."""
        return dict(zip(self.symbol_names, self.symbols().tolist(), strict=True))

    @property
    def _governed(self) -> bool:
        params = self._controller.params
        return params.governor.mode != "off" or params.trajectory.kind == "goal"


class IncidentWatch:
    """Looks at one result after the other; those in which the law follows its path as planned need not be shown."""

    def __init__(self) -> None:
        self._told: set[str] = set()
        self._began_ns: int | None = None
        self._waits_ns: int | None = None

    def see(self, result: CycleResult) -> Incident | None:
        """Return what went wrong and was not reported yet."""
        now_ns = result.joint.stamp_ns
        if self._began_ns is None:
            self._began_ns = now_ns
        if result.mode is Mode.ACTIVE:
            self._waits_ns = None
            return None
        cause = result.reason_key[0]
        if cause != Reason.PATH_WAITS:
            self._waits_ns = None
        elif self._waits_ns is None:
            self._waits_ns = now_ns
        kind = self._kind(result.mode, cause, now_ns)
        if not kind or kind in self._told:
            return None
        self._told.add(kind)
        return Incident(kind, 1e-9 * (now_ns - self._began_ns), result.reason)

    def _kind(self, mode: Mode, cause: int, now_ns: int) -> str:
        if mode is Mode.FAULT:
            return "fault"
        if cause == Reason.SATURATED:
            return "saturated"
        waited_ns = 0 if self._waits_ns is None else now_ns - self._waits_ns
        return "unreachable" if cause == Reason.PATH_TOO_HEAVY or waited_ns > 1e9 * UNREACHABLE_S else ""
