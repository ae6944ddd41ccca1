"""The mode machine: what the controller does and why. Time is an argument.

WAITING_INPUT  no effort: an input has never been seen, or the joint state's source has restarted
HOLD           gravity compensation, damping and posture
ACTIVE         the law
DEGRADED       the law with a fallback, and the reason
FAULT          as HOLD, until a user resets it
"""

from __future__ import annotations

from enum import IntEnum, unique

from slip_core.compiled import part
from slip_core.records import Record, Whole
from slip_vic_controller.safety.conditions import (
    NOTHING,
    SEVERITIES,
    ConditionsConfig,
    Prefix,
    Reason,
    Severity,
    Why,
    WhyRecord,
    because,
    prefixed,
    put_why,
    read_why,
    since_when,
)
from slip_vic_controller.sizes import NEVER


@unique
class Mode(IntEnum):
    """Modes in the order of their numbers on the topics."""

    WAITING_INPUT = 0
    HOLD = 1
    ACTIVE = 2
    DEGRADED = 3
    FAULT = 4

    @property
    def follows(self) -> bool:
        """Whether the law is at work."""
        return self in (Mode.ACTIVE, Mode.DEGRADED)


@unique
class Request(IntEnum):
    """What was asked for since the last cycle, by a user if nothing else is said."""

    NONE = 0
    ENABLE = 1
    HOLD = 2
    RESET_FAULT = 3
    TARE = 5  # read the sensors at rest again; not while the law is at work
    FAILED = 4  # the node itself requests FAULT: one of its callbacks has failed


class ModeState(Record):
    """The mode and its history."""

    mode: Whole  # Mode
    enabled: Whole  # whether the law is wanted
    good_since_ns: Whole  # since when nothing speaks against the law, NEVER = something does
    reason: WhyRecord


@part
def follows(mode: int) -> bool:
    """Return whether the law is at work in a mode."""
    return bool(mode == Mode.ACTIVE or mode == Mode.DEGRADED)


@part
def holds_for(state: ModeState, reason: int, fault: int) -> bool:
    """Return whether a fault of an input is why the law does not work; reason: the row of the input.

    A sensor that is frozen shows it while the arm moves only, so it stays frozen until it reads something else.
    """
    over = state.reason.prefix & (Prefix.RESUMES_AFTER | Prefix.AFTER_RESET)
    return bool(not over and state.reason.reason == reason and state.reason.fault == fault)


@part
def next_mode(config: ConditionsConfig, state: ModeState, why: Why, request: int, now_ns: int) -> None:
    """Go to the mode of this cycle; why: what speaks against the law, NOTHING where nothing does.

    A fault latches; a request to hold wins over one to continue; what inputs caused ends with its cause, what a user or
    a fault caused ends by a user.
    """
    severity, before = SEVERITIES[why.reason], read_why(state.reason)
    stops = severity == Severity.WAITING_INPUT or severity == Severity.HOLD
    enabled = request == Request.ENABLE or (state.enabled != 0 and request != Request.HOLD)
    good_since = since_when(state.good_since_ns, not stops, now_ns)
    if state.mode == Mode.FAULT and request != Request.RESET_FAULT:
        state.enabled, state.good_since_ns = 0, good_since
        return
    if request == Request.FAILED or severity == Severity.FAULT:
        if request == Request.FAILED:
            why = because(Reason.INTERNAL.value, 0)
        _go(state, Mode.FAULT, why, False, good_since)
        return
    if state.mode == Mode.FAULT:
        before = prefixed(before, Prefix.AFTER_RESET.value)
        state.mode, enabled = Mode.HOLD, False
    if severity == Severity.WAITING_INPUT:
        _go(state, Mode.WAITING_INPUT, why, enabled, NEVER)
    elif severity == Severity.HOLD:
        if request == Request.HOLD or (_asked(before) and not enabled):
            why = prefixed(why, Prefix.ASKED_AND.value)
        _go(state, Mode.HOLD, why, enabled, NEVER)
    elif not enabled:
        if request == Request.HOLD or _asked(before):
            before = because(Reason.ASKED.value, 0)
        elif state.mode != Mode.HOLD:
            before = because(Reason.NOT_ENABLED.value, 0)
        _go(state, Mode.HOLD, before, False, good_since)
    elif (
        state.mode == Mode.HOLD
        and request != Request.ENABLE
        and (good_since == NEVER or now_ns - good_since < config.resume_after_ns)
    ):
        _go(state, Mode.HOLD, prefixed(before, Prefix.RESUMES_AFTER.value), True, good_since)
    elif severity == Severity.DEGRADED:
        _go(state, Mode.DEGRADED, why, True, good_since)
    else:
        _go(state, Mode.ACTIVE, NOTHING, True, good_since)


@part
def _asked(why: Why) -> bool:
    """Return whether a user's wish to hold is what the reason begins with."""
    if why.prefix & (Prefix.RESUMES_AFTER | Prefix.AFTER_RESET):
        return False
    asked = why.prefix & Prefix.ASKED_AND != 0
    return bool(asked or why.reason == Reason.ASKED or why.reason == Reason.STOPPING)


@part
def _go(state: ModeState, mode: int, why: Why, enabled: bool, good_since_ns: int) -> None:
    state.mode, state.enabled, state.good_since_ns = 0 + mode, 1 if enabled else 0, good_since_ns
    put_why(state.reason, why)
