"""What went wrong in a run, seen from the controller's modes: each kind said once."""

from __future__ import annotations

from typing import Final

from slip_core.incidents import Incident
from slip_vic_controller.safety.conditions import Reason
from slip_vic_controller.safety.modes import Mode
from slip_vic_controller.session.cycle_result import CycleResult

UNREACHABLE_S: Final = 2.0
"""How long the path may wait for the arm, or for friction, before its end is said not to be reached."""


class IncidentWatch:
    """Looks at one result after the other; those in which the law follows its path as planned need not be shown."""

    def __init__(self) -> None:
        self._told: set[str] = set()
        self._began_ns: int | None = None
        self._waits_ns: int | None = None

    def see(self, result: CycleResult) -> Incident | None:
        """Return what has gone wrong by now, where it was not said yet."""
        now_ns = result.joint.stamp_ns
        if self._began_ns is None:
            self._began_ns = now_ns
        if result.mode is Mode.ACTIVE:
            self._waits_ns = None
            return None
        cause = result.reason_key[0]
        if cause not in (Reason.PATH_WAITS, Reason.RANGE_END):
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
