"""The mode machine: every mode with every finding and request, and the rules that hold for all of them."""

from __future__ import annotations

import itertools

import pytest

from slip_vic_controller.core.modes import Findings, Mode, ModePolicy, ModeState, Request, initial_mode, next_mode

POLICY = ModePolicy(auto_enable=True, auto_resume=True, resume_after_ns=100)
MANUAL = ModePolicy(auto_enable=False, auto_resume=False, resume_after_ns=100)
NOTHING, HOLD, FAULT = Findings(), Findings(hold="h"), Findings(fault="f")
MISSING, DEGRADED = Findings(missing="m"), Findings(degraded="d")
FINDINGS = (NOTHING, HOLD, FAULT, MISSING, DEGRADED, Findings("m", "f", "h", "d"))


def run(policy: ModePolicy, *steps: tuple[Findings, Request, int]) -> ModeState:
    state, now = initial_mode(policy, 0), 0
    for findings, request, passed in steps:
        now += passed
        state = next_mode(state, findings, request, now, policy)
    return state


ALL = list(itertools.product(Mode, FINDINGS, Request, (True, False), (None, 0), (POLICY, MANUAL), (0, 50, 1000)))


def test_rules_that_hold_for_every_transition() -> None:
    for mode, findings, request, enabled, good_since, policy, now in ALL:
        before = ModeState(mode, "r", 0, enabled, good_since)
        after = next_mode(before, findings, request, now, policy)
        case = f"{before} {findings} {request} {policy}"
        if mode == Mode.FAULT and request != Request.RESET_FAULT:
            assert after.mode == Mode.FAULT, case
        if findings.fault:
            assert after.mode == Mode.FAULT, case
        if after.mode.follows:
            assert findings in (NOTHING, DEGRADED), case
            assert after.enabled, case
            assert mode != Mode.FAULT, case
        if findings.missing and mode != Mode.FAULT and not findings.fault:
            assert after.mode == Mode.WAITING_INPUT, case
        if request == Request.HOLD:
            assert not after.mode.follows, case
        assert (after.reason != "") or after.mode == Mode.ACTIVE, case
        assert after.since_ns == (before.since_ns if after.mode == mode else now), case
        assert next_mode(before, findings, request, now, policy) == after, case


def test_good_inputs_lead_straight_to_active() -> None:
    assert run(POLICY, (MISSING, Request.NONE, 1), (NOTHING, Request.NONE, 1)).mode == Mode.ACTIVE


def test_without_auto_enable_a_user_enables() -> None:
    held = run(MANUAL, (NOTHING, Request.NONE, 1))
    assert (held.mode, held.reason) == (Mode.HOLD, "not enabled")
    assert next_mode(held, NOTHING, Request.ENABLE, 2, MANUAL).mode == Mode.ACTIVE


def test_hold_that_an_input_caused_ends_after_a_while() -> None:
    steps = [(NOTHING, Request.NONE, 1), (HOLD, Request.NONE, 1), (NOTHING, Request.NONE, 1)]
    waiting = run(POLICY, *steps)
    assert (waiting.mode, waiting.reason) == (Mode.HOLD, "resumes after: h")
    assert run(POLICY, *steps, (NOTHING, Request.NONE, 99)).mode == Mode.HOLD
    assert run(POLICY, *steps, (NOTHING, Request.NONE, 100)).mode == Mode.ACTIVE
    assert run(POLICY, *steps, (HOLD, Request.NONE, 99), (NOTHING, Request.NONE, 50)).mode == Mode.HOLD


def test_without_auto_resume_a_user_resumes() -> None:
    policy = ModePolicy(auto_enable=True, auto_resume=False, resume_after_ns=100)
    steps = [(NOTHING, Request.NONE, 1), (HOLD, Request.NONE, 1), (NOTHING, Request.NONE, 10_000)]
    assert run(policy, *steps).mode == Mode.HOLD
    assert run(policy, *steps, (NOTHING, Request.ENABLE, 1)).mode == Mode.ACTIVE


def test_hold_that_a_user_asked_for_stays() -> None:
    steps = [(NOTHING, Request.NONE, 1), (NOTHING, Request.HOLD, 1), (NOTHING, Request.NONE, 10_000)]
    held = run(POLICY, *steps)
    assert (held.mode, held.reason) == (Mode.HOLD, "asked to hold")
    assert run(POLICY, *steps, (NOTHING, Request.ENABLE, 1)).mode == Mode.ACTIVE


@pytest.mark.parametrize("request_", [Request.NONE, Request.ENABLE, Request.HOLD])
def test_fault_latches(request_: Request) -> None:
    state = run(POLICY, (NOTHING, Request.NONE, 1), (FAULT, Request.NONE, 1), (NOTHING, request_, 10_000))
    assert (state.mode, state.reason) == (Mode.FAULT, "f")


def test_reset_leads_to_hold_and_not_further() -> None:
    steps = [(FAULT, Request.NONE, 1), (NOTHING, Request.RESET_FAULT, 1), (NOTHING, Request.NONE, 10_000)]
    assert run(POLICY, *steps).mode == Mode.HOLD
    assert run(POLICY, *steps, (NOTHING, Request.ENABLE, 1)).mode == Mode.ACTIVE
    assert run(POLICY, (FAULT, Request.NONE, 1), (FAULT, Request.RESET_FAULT, 1)).mode == Mode.FAULT


def test_degraded_comes_and_goes_with_its_cause() -> None:
    steps = [(NOTHING, Request.NONE, 1), (DEGRADED, Request.NONE, 1)]
    assert run(POLICY, *steps).reason == "d"
    assert run(POLICY, *steps, (NOTHING, Request.NONE, 1)).mode == Mode.ACTIVE
