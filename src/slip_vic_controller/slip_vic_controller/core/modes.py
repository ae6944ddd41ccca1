"""The mode machine: what the controller does and why. Pure; time is an argument.

WAITING_INPUT  no effort: an input has never been seen, or the joint state's source has started anew
HOLD           gravity compensation, damping and posture
ACTIVE         the law
DEGRADED       the law with a fallback, and the reason
FAULT          as HOLD, until somebody resets it
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple


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


class Request(IntEnum):
    """What a user asked for since the last cycle."""

    NONE = 0
    ENABLE = 1
    HOLD = 2
    RESET_FAULT = 3


class Findings(NamedTuple):
    """What speaks against the law in this cycle; empty texts where nothing does.

    missing: no effort can be given; fault: latch; hold: no law now; degraded: law with a fallback.
    """

    missing: str = ""
    fault: str = ""
    hold: str = ""
    degraded: str = ""


class ModePolicy(NamedTuple):
    """auto_enable, auto_resume: see the parameters; resume_after_ns: how long findings must be gone."""

    auto_enable: bool
    auto_resume: bool
    resume_after_ns: int


class ModeState(NamedTuple):
    """Mode, its reason, since when, whether the law is wanted, and since when nothing speaks against it."""

    mode: Mode
    reason: str
    since_ns: int
    enabled: bool
    good_since_ns: int | None


def initial_mode(policy: ModePolicy, now_ns: int) -> ModeState:
    """Return the mode before the first cycle.

    Implements: ours: no effort before every input was seen and is plausible.
    """
    return ModeState(Mode.WAITING_INPUT, "no input yet", now_ns, policy.auto_enable, None)


def next_mode(state: ModeState, findings: Findings, request: Request, now_ns: int, policy: ModePolicy) -> ModeState:
    """Return the mode of this cycle.

    Implements: ours: a fault wins over all, and latches; a request to hold wins over one to go on; what the inputs
    caused ends with its cause, what a user or a fault caused ends by a user.
    """
    if (
        findings == _NOTHING
        and request == Request.NONE
        and state.mode == Mode.ACTIVE
        and state.enabled
        and state.good_since_ns is not None
    ):
        return state  # nearly always
    enabled = request == Request.ENABLE or (state.enabled and request != Request.HOLD)
    bad = findings.missing or findings.hold
    good_since = None if bad else now_ns if state.good_since_ns is None else state.good_since_ns
    if state.mode == Mode.FAULT and request != Request.RESET_FAULT:
        return state._replace(enabled=False, good_since_ns=good_since)
    if findings.fault:
        return _to(state, Mode.FAULT, findings.fault, now_ns, False, good_since)
    if state.mode == Mode.FAULT:
        reason = f"not enabled, after a reset of: {state.reason}"
        state, enabled = state._replace(mode=Mode.HOLD, reason=reason, since_ns=now_ns), False
    if findings.missing:
        return _to(state, Mode.WAITING_INPUT, findings.missing, now_ns, enabled, None)
    if findings.hold:
        resumes = policy.auto_resume or not state.mode.follows
        asked = request == Request.HOLD or (state.reason.startswith(ASKED) and not enabled)
        reason = f"{ASKED}; {findings.hold}" if asked else findings.hold
        return _to(state, Mode.HOLD, reason, now_ns, enabled and resumes, None)
    if not enabled:
        asked = request == Request.HOLD or state.reason.startswith(ASKED)
        reason = ASKED if asked else state.reason if state.mode == Mode.HOLD else "not enabled"
        return _to(state, Mode.HOLD, reason, now_ns, False, good_since)
    settled = good_since is not None and now_ns - good_since >= policy.resume_after_ns
    if state.mode == Mode.HOLD and not settled and request != Request.ENABLE:
        return _to(state, Mode.HOLD, f"resumes after: {_cause(state.reason)}", now_ns, True, good_since)
    if findings.degraded:
        return _to(state, Mode.DEGRADED, findings.degraded, now_ns, True, good_since)
    return _to(state, Mode.ACTIVE, "", now_ns, True, good_since)


ASKED = "asked to hold"
_NOTHING = Findings()


def _cause(reason: str) -> str:
    return reason.removeprefix("resumes after: ")


def _to(state: ModeState, mode: Mode, reason: str, now_ns: int, enabled: bool, good_since: int | None) -> ModeState:
    since = state.since_ns if mode == state.mode else now_ns
    return ModeState(mode, reason, since, enabled, good_since)
