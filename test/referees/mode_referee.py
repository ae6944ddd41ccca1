"""The mode machine in plain form: reasons are texts, states are values; compared with what runs."""

from __future__ import annotations

from typing import NamedTuple

from slip_vic_controller.safety.modes import Mode, Request

ASKED = "hold requested"
RESUMES = "resumes after: "


class Found(NamedTuple):
    """What speaks against the law; empty texts where nothing does."""

    missing: str = ""
    fault: str = ""
    hold: str = ""
    degraded: str = ""


class Policy(NamedTuple):
    auto_enable: bool
    auto_resume: bool
    resume_after_ns: int


class ModeState(NamedTuple):
    mode: Mode
    reason: str
    since_ns: int
    enabled: bool
    good_since_ns: int | None


def begin(policy: Policy, now_ns: int) -> ModeState:
    return ModeState(Mode.WAITING_INPUT, "no input yet", now_ns, policy.auto_enable, None)


FAILURE = "internal error, see the log: this is a bug, please report it"


def next_mode(state: ModeState, found: Found, request: Request, now_ns: int, policy: Policy) -> ModeState:
    """Return the mode of this cycle."""
    enabled = request == Request.ENABLE or (state.enabled and request != Request.HOLD)
    good_since = now_ns if state.good_since_ns is None else state.good_since_ns
    if found.missing or found.hold:
        good_since = None
    if state.mode == Mode.FAULT and request != Request.RESET_FAULT:
        return state._replace(enabled=False, good_since_ns=good_since)
    if request == Request.FAILED:
        return _to(state, Mode.FAULT, FAILURE, now_ns, False, good_since)
    if found.fault:
        return _to(state, Mode.FAULT, found.fault, now_ns, False, good_since)
    if state.mode == Mode.FAULT:
        reason = f"not enabled, after a reset of: {state.reason}"
        state, enabled = state._replace(mode=Mode.HOLD, reason=reason, since_ns=now_ns), False
    if found.missing:
        return _to(state, Mode.WAITING_INPUT, found.missing, now_ns, enabled, None)
    if found.hold:
        resumes = policy.auto_resume or state.mode not in (Mode.ACTIVE, Mode.DEGRADED)
        asked = request == Request.HOLD or (state.reason.startswith(ASKED) and not enabled)
        reason = f"{ASKED}; {found.hold}" if asked else found.hold
        return _to(state, Mode.HOLD, reason, now_ns, enabled and resumes, None)
    if not enabled:
        asked = request == Request.HOLD or state.reason.startswith(ASKED)
        reason = ASKED if asked else state.reason if state.mode == Mode.HOLD else "not enabled"
        return _to(state, Mode.HOLD, reason, now_ns, False, good_since)
    settled = good_since is not None and now_ns - good_since >= policy.resume_after_ns
    if state.mode == Mode.HOLD and not settled and request != Request.ENABLE:
        return _to(state, Mode.HOLD, RESUMES + state.reason.removeprefix(RESUMES), now_ns, True, good_since)
    if found.degraded:
        return _to(state, Mode.DEGRADED, found.degraded, now_ns, True, good_since)
    return _to(state, Mode.ACTIVE, "", now_ns, True, good_since)


def _to(state: ModeState, mode: Mode, reason: str, now_ns: int, enabled: bool, good_since: int | None) -> ModeState:
    since = state.since_ns if mode == state.mode else now_ns
    return ModeState(mode, reason, since, enabled, good_since)
