"""The mode machine: what the controller does and why. Time is an argument.

WAITING_INPUT  no effort: an input has never been seen, or the joint state's source has restarted
HOLD           gravity compensation, damping and posture
ACTIVE         the law
DEGRADED       the law with a fallback, and the reason
FAULT          as HOLD, until a user resets it
"""

from __future__ import annotations

from enum import IntEnum, unique
from typing import NamedTuple

from slip_core.compiled import part
from slip_core.records import Record, Whole, dtype_of
from slip_vic_controller.safety.reasons import (
    Cause,
    Prefix,
    Reason,
    ReasonRecord,
    because,
    of_fault,
    prefixed,
    put_reason,
    read_reason,
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


class ModePolicy(Record):
    """When the law may begin."""

    auto_enable: Whole  # see the parameters
    auto_resume: Whole  # see the parameters
    resume_after_ns: Whole  # how long what spoke against the law must be gone


MODE_POLICY = dtype_of(ModePolicy)


class ModeState(Record):
    """The mode and its history."""

    mode: Whole  # Mode
    since_ns: Whole  # when it was entered
    enabled: Whole  # whether the law is wanted
    good_since_ns: Whole  # since when nothing speaks against the law, NEVER = something does
    reason: ReasonRecord


MODE = dtype_of(ModeState)

NOTHING = Reason(0, 0, 0, 0.0, 0.0)


class TransitionReasons(NamedTuple):
    """What speaks against the law in a cycle, NOTHING where nothing does.

    missing: no effort can be given; fault: latch; hold: no law now; degraded: law with a fallback.
    """

    missing: Reason
    fault: Reason
    hold: Reason
    degraded: Reason


@part
def follows(mode: int) -> bool:
    """Return whether the law is at work in a mode."""
    return bool(mode == Mode.ACTIVE or mode == Mode.DEGRADED)


@part
def since_when(since_ns: int, so: bool, now_ns: int) -> int:
    """Return since when something is so [ns], NEVER where it is not; since_ns: since when it was so until now."""
    if not so:
        return NEVER
    return now_ns if since_ns == NEVER else since_ns


@part
def holds_for(state: ModeState, of: int, fault: int) -> bool:
    """Return whether a fault of an input is why the law does not work.

    A sensor that is frozen shows it while the arm moves only, so it stays frozen until it reads something else.
    """
    reason, wanted = state.reason, of_fault(Cause.INPUT, of, fault)
    over = reason.prefix & (Prefix.RESUMES_AFTER | Prefix.AFTER_RESET)
    return bool(not over and reason.cause == wanted.cause and reason.detail == wanted.detail)


@part
def begin_modes(policy: ModePolicy, state: ModeState, now_ns: int) -> None:
    """Begin: no effort before every input was seen and is plausible."""
    state.mode, state.since_ns = Mode.WAITING_INPUT, now_ns
    state.enabled, state.good_since_ns = policy.auto_enable, NEVER
    put_reason(state.reason, because(Cause.NO_INPUT_YET, 0))


@part
def next_mode(policy: ModePolicy, state: ModeState, reasons: TransitionReasons, request: int, now_ns: int) -> None:
    """Go to the mode of this cycle.

    A fault wins over all, and latches; a request to hold wins over one to continue; what inputs caused ends with its
    cause, what a user or a fault caused ends by a user.
    """
    missing, hold = reasons.missing.cause != Cause.NONE, reasons.hold.cause != Cause.NONE
    reason = read_reason(state.reason)
    enabled = request == Request.ENABLE or (state.enabled != 0 and request != Request.HOLD)
    good_since = since_when(state.good_since_ns, not missing and not hold, now_ns)
    if state.mode == Mode.FAULT and request != Request.RESET_FAULT:
        state.enabled, state.good_since_ns = 0, good_since
    elif request == Request.FAILED:
        _go(state, Mode.FAULT, because(Cause.INTERNAL.value, 0), now_ns, False, good_since)
    elif reasons.fault.cause != Cause.NONE:
        _go(state, Mode.FAULT, reasons.fault, now_ns, False, good_since)
    else:
        if state.mode == Mode.FAULT:
            reason = prefixed(reason, Prefix.AFTER_RESET.value)
            state.mode, state.since_ns = Mode.HOLD, now_ns
            enabled = False
        if missing:
            _go(state, Mode.WAITING_INPUT, reasons.missing, now_ns, enabled, NEVER)
        elif hold:
            _hold_for_cause(policy, state, reason, reasons.hold, request, enabled, now_ns)
        elif not enabled:
            if request == Request.HOLD or _asked(reason):
                reason = because(Cause.ASKED, 0)
            elif state.mode != Mode.HOLD:
                reason = because(Cause.NOT_ENABLED, 0)
            _go(state, Mode.HOLD, reason, now_ns, False, good_since)
        elif (
            state.mode == Mode.HOLD
            and request != Request.ENABLE
            and (good_since == NEVER or now_ns - good_since < policy.resume_after_ns)
        ):
            reason = prefixed(reason, Prefix.RESUMES_AFTER.value)
            _go(state, Mode.HOLD, reason, now_ns, True, good_since)
        elif reasons.degraded.cause != Cause.NONE:
            _go(state, Mode.DEGRADED, reasons.degraded, now_ns, True, good_since)
        else:
            _go(state, Mode.ACTIVE, NOTHING, now_ns, True, good_since)


@part
def _hold_for_cause(
    policy: ModePolicy, state: ModeState, before: Reason, cause: Reason, request: int, enabled: bool, now_ns: int
) -> None:
    resumes = policy.auto_resume != 0 or not follows(state.mode)
    if request == Request.HOLD or (_asked(before) and not enabled):
        cause = prefixed(cause, Prefix.ASKED_AND.value)
    _go(state, Mode.HOLD, cause, now_ns, enabled and resumes, NEVER)


@part
def _asked(reason: Reason) -> bool:
    """Return whether a user's wish to hold is what the reason begins with."""
    if reason.prefix & (Prefix.RESUMES_AFTER | Prefix.AFTER_RESET):
        return False
    return bool(reason.prefix & Prefix.ASKED_AND != 0 or reason.cause == Cause.ASKED or reason.cause == Cause.STOPPING)


@part
def _go(state: ModeState, mode: int, reason: Reason, now_ns: int, enabled: bool, good_since_ns: int) -> None:
    if state.mode != mode:
        state.since_ns = now_ns
    state.mode, state.enabled, state.good_since_ns = 0 + mode, 1 if enabled else 0, good_since_ns
    put_reason(state.reason, reason)
