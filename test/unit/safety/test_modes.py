"""The mode machine: rules that hold for every transition, and what each request and finding leads to."""

from __future__ import annotations

import itertools
from typing import NamedTuple

from slip_core.records import dtype_of, new, record
from slip_vic_controller.safety.conditions import (
    NOTHING,
    Mode,
    Reason,
    Request,
    Why,
    because,
    holds_for,
    next_mode,
    put_why,
    read_why,
)
from slip_vic_controller.safety.conditions import ModeState as ModeRecord
from slip_vic_controller.session.words import describe
from slip_vic_controller.sizes import NEVER
from slip_vic_controller.state import CONFIG
from test.support.call import blank, call


class Policy(NamedTuple):
    auto_enable: bool
    resume_after_ns: int


class ModeState(NamedTuple):
    mode: Mode
    reason: str
    enabled: bool
    good_since_ns: int | None


POLICY = Policy(auto_enable=True, resume_after_ns=100)
MANUAL = Policy(auto_enable=False, resume_after_ns=100)
GOOD, MISSING = NOTHING, Why(Reason.WAITS.value, 0, 0, 8, 0.0, 0.0)
FAULTY = Why(Reason.FALLS.value, 0, 0, 0, 0.5, 0.0)
BAD, TARE, DEGRADED = because(Reason.WRENCH, Reason.SILENT), because(Reason.TARE, 0), because(Reason.PATH_WAITS, 0)
FOUND = (GOOD, BAD, FAULTY, MISSING, DEGRADED)
H, F = describe(BAD, ()), describe(FAULTY, ())
USERS = tuple(because(reason, 0) for reason in (Reason.ASKED, Reason.STOPPING, Reason.NOT_ENABLED))
REASONS = [why._replace(over=over) for why in (*FOUND[1:], *USERS) for over in (0, 1)]


class Machine:
    """What runs, with texts for its reasons."""

    def __init__(self, policy: Policy) -> None:
        self.config, self.buffer = record(new(CONFIG), CONFIG).conditions, new(dtype_of(ModeRecord))
        self.config.auto_enable, self.config.resume_after_ns = policy
        self.record, self.now_ns = record(self.buffer, dtype_of(ModeRecord)), 0
        self.record.enabled, self.record.good_since_ns = policy.auto_enable, NEVER

    def put(self, state: ModeState, why: Why) -> None:
        self.record.mode, self.record.enabled = state.mode, state.enabled
        self.record.good_since_ns = NEVER if state.good_since_ns is None else state.good_since_ns
        put_why(self.record.reason, why)

    def step(self, found: Why, request: Request, now_ns: int) -> ModeState:
        call(next_mode, self.config, self.buffer, found, request, now_ns)
        return self.state

    @property
    def state(self) -> ModeState:
        r = self.record
        good = None if r.good_since_ns == NEVER else int(r.good_since_ns)
        return ModeState(Mode(r.mode), describe(read_why(r.reason), ()), bool(r.enabled), good)


def run(policy: Policy, *steps: tuple[Why, Request, int]) -> ModeState:
    """Return the state after steps, each some time after the one before."""
    machine, now_ns = Machine(policy), 0
    for found, request, passed in steps:
        now_ns += passed
        machine.step(found, request, now_ns)
    return machine.state


ALL = list(itertools.product(Mode, FOUND, Request, (True, False), (None, 0), (POLICY, MANUAL), (50, 100), (0, 6, 13)))


def test_rules_that_hold_for_every_transition() -> None:
    machines = {policy: Machine(policy) for policy in (POLICY, MANUAL)}
    for mode, found, request, enabled, good_since, policy, now, reason in ALL:
        code = REASONS[reason] if mode != Mode.FAULT else FAULTY  # a fault's reason says nothing before it
        before = ModeState(mode, describe(code, ()), enabled, good_since)
        machine = machines[policy]
        machine.put(before, code)
        after = machine.step(found, request, now)
        case = f"{before} {found} {request} {policy}"
        if mode == Mode.FAULT and request != Request.RESET_FAULT:
            assert after.mode == Mode.FAULT, case
        leads_to = Reason(found.reason).mode
        failed = leads_to == Mode.FAULT or request == Request.FAILED
        if failed:
            assert after.mode == Mode.FAULT, case
        if after.mode.follows:
            assert found in (GOOD, DEGRADED), case
            assert after.enabled, case
            assert mode != Mode.FAULT, case
        if leads_to == Mode.WAITING_INPUT and mode != Mode.FAULT and not failed:
            assert after.mode == Mode.WAITING_INPUT, case
        if request == Request.HOLD:
            assert not after.mode.follows, case
        assert (after.reason != "") or after.mode == Mode.ACTIVE, case


def test_input_hold_ends_by_itself() -> None:
    steps = [(GOOD, Request.NONE, 1), (BAD, Request.NONE, 1), (GOOD, Request.NONE, 1)]
    waiting = run(POLICY, *steps)
    assert (waiting.mode, waiting.reason) == (Mode.HOLD, f"resumes after: {H}")
    assert run(POLICY, *steps, (GOOD, Request.NONE, 99)).mode == Mode.HOLD
    assert run(POLICY, *steps, (GOOD, Request.NONE, 100)).mode == Mode.ACTIVE
    assert run(POLICY, *steps, (BAD, Request.NONE, 99), (GOOD, Request.NONE, 50)).mode == Mode.HOLD
    assert run(POLICY, *steps, (TARE, Request.NONE, 99), (GOOD, Request.NONE, 1)).mode == Mode.ACTIVE  # its time counts


def test_requested_hold_stays() -> None:
    steps = [(GOOD, Request.NONE, 1), (GOOD, Request.HOLD, 1), (GOOD, Request.NONE, 10_000)]
    held = run(POLICY, *steps)
    assert (held.mode, held.reason) == (Mode.HOLD, "hold requested")
    assert run(POLICY, *steps, (GOOD, Request.ENABLE, 1)).mode == Mode.ACTIVE
    # Also where an input was bad in between, as what a user asked for ends by a user.
    bad = run(POLICY, *steps, (BAD, Request.NONE, 1))
    assert (bad.enabled, bad.reason) == (False, H)
    assert run(POLICY, *steps, (BAD, Request.NONE, 1), (GOOD, Request.NONE, 10_000)).reason == "not enabled"


def test_fault_latches_and_reset_leads_to_hold() -> None:
    for request in (Request.NONE, Request.ENABLE, Request.HOLD):
        state = run(POLICY, (GOOD, Request.NONE, 1), (FAULTY, Request.NONE, 1), (GOOD, request, 10_000))
        assert (state.mode, state.reason) == (Mode.FAULT, F)
    steps = [(FAULTY, Request.NONE, 1), (GOOD, Request.RESET_FAULT, 1), (GOOD, Request.NONE, 10_000)]
    held = run(POLICY, *steps)
    assert (held.mode, held.reason) == (Mode.HOLD, "not enabled")
    assert run(POLICY, *steps, (GOOD, Request.ENABLE, 1)).mode == Mode.ACTIVE
    assert run(POLICY, (FAULTY, Request.NONE, 1), (FAULTY, Request.RESET_FAULT, 1)).mode == Mode.FAULT


def test_hold_names_its_input() -> None:
    frozen, state = because(Reason.WRENCH, Reason.FROZEN), blank(ModeRecord)
    for why, of, fault, holds in (
        (frozen, Reason.WRENCH, Reason.FROZEN, True),
        (frozen._replace(over=1), Reason.WRENCH, Reason.FROZEN, False),
        (frozen, Reason.JOINT_STATE, Reason.FROZEN, False),
        (frozen, Reason.WRENCH, Reason.SILENT, False),
        (frozen._replace(reason=Reason.WRENCH_SLOWS), Reason.WRENCH, Reason.FROZEN, False),
        (NOTHING, Reason.WRENCH, Reason.FROZEN, False),
    ):
        put_why(state.reason, why)
        assert bool(call(holds_for, state, of, fault)) is holds, why
