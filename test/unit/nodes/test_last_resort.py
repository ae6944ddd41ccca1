"""The controller after a failure of its own, and with the stamps at the ends of what a message can hold."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from slip_core.types import JointSample, SlipSample, WrenchSample
from slip_vic.scenarios.scenario import load_scenario
from slip_vic_controller.safety.modes import Mode, Request
from slip_vic_controller.session.controller import Controller
from test.support.one_arm import OneArm, one_arm

MS = 1_000_000
LARGEST_NS, SMALLEST_NS = (2**31 - 1) * 1_000_000_000 + 999_999_999, -(2**31) * 1_000_000_000


@pytest.fixture(scope="module")
def controller() -> Controller:
    scenario = load_scenario("paper_planar", mode="realtime")
    return one_arm(scenario.controller, scenario.urdf, lockstep=False)


HOME = np.array(load_scenario("paper_planar").bridge.initial_position)


def feed(session: OneArm, stamp_ns: int, now_ns: int) -> Any:
    """Give one set of inputs of a resting arm; return the answer."""
    rest = np.zeros(7)
    session.add_wrench(0, WrenchSample(stamp_ns, np.array([1e-3 * (stamp_ns % 7), 0.0, 4.9, 0.0, 0.0, 0.0])), now_ns)
    session.add_slip(0, SlipSample(stamp_ns, np.zeros(6), valid=True), now_ns)
    session.add_joint(JointSample(stamp_ns, HOME, rest, rest), now_ns)
    return session.cycle(now_ns)


def test_failure_is_a_resettable_fault(controller: Controller) -> None:
    session = OneArm(controller)
    for k in range(1, 50):
        before = feed(session, k * MS, k * MS)
    assert session.mode == Mode.ACTIVE
    result = session.failed(50 * MS)
    assert result is not None
    assert result.mode == Mode.FAULT
    assert "internal error" in result.reason
    assert result.decision[4] == Request.FAILED  # in the ledger, so that a replay does the same
    step = controller.first.params.safety.limits.effort_rate * 1e-3
    assert np.abs(result.command.numbers - before.command.numbers).max() <= step + 1e-12
    after = feed(session, 51 * MS, 51 * MS)
    assert after.mode == Mode.FAULT
    assert len(after.command.numbers) == 7
    session.request(Request.RESET_FAULT)
    assert feed(session, 52 * MS, 52 * MS).mode == Mode.HOLD
    session.request(Request.ENABLE)
    assert feed(session, 53 * MS, 53 * MS).mode.follows


def test_extreme_stamps_keep_efforts_finite(controller: Controller) -> None:
    """In real time and in lockstep, where every jump of the clock is taken at once."""
    stamps = (LARGEST_NS - 2 * MS, LARGEST_NS, SMALLEST_NS, SMALLEST_NS + 1, 0, LARGEST_NS, -1, 1, LARGEST_NS - 1)
    lockstep = one_arm(controller.first.params, load_scenario("paper_planar").urdf, lockstep=True)
    for of in (controller, lockstep):
        session, now_ns = OneArm(of), 0
        for stamp_ns in stamps * 3:
            for k in range(7):  # more than `accept_after`
                now_ns += MS
                session.add_manifest(_Any())  # type: ignore[arg-type]
                result = feed(session, min(stamp_ns + k, LARGEST_NS), now_ns)
                assert result is None or np.isfinite(result.command.numbers).all()


class _Any:
    """A manifest that every set of samples fits."""

    def __getattr__(self, _name: str) -> Any:
        return _Equal()


class _Equal:
    __hash__ = None  # type: ignore[assignment]

    def __eq__(self, _other: object) -> bool:
        return True
