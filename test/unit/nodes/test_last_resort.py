"""The controller after a failure of its own, and with the stamps at the ends of what a message can hold."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from slip_vic_controller.safety.conditions import Mode, Request
from test.support.made_up import CALM, MS, MadeUp, law_at_work

LARGEST_NS, SMALLEST_NS = (2**31 - 1) * 1_000_000_000 + 999_999_999, -(2**31) * 1_000_000_000


def test_failure_before_the_law_begins_gives_no_command() -> None:
    waiting = MadeUp()
    waiting.session.add_joint(waiting.joint(), waiting.now_ns)
    assert waiting.session.newest_joint is not None
    assert waiting.session.failed(waiting.now_ns) is None


def test_failure_is_a_resettable_fault() -> None:
    made_up, still = law_at_work(**CALM), {"joint": {"velocity": np.zeros(7)}, "slip": np.zeros(6)}
    before = made_up.run(50, **still)
    made_up.pass_time()
    result = made_up.session.failed(made_up.now_ns)
    assert result is not None
    assert result.mode == Mode.FAULT
    assert "internal error" in result.reason
    assert result.decision[4] == Request.FAILED  # in the ledger, so that a replay does the same
    step = made_up.controller.first.params.safety.limits.effort_rate * 1e-3
    assert np.abs(result.command.numbers - before.command.numbers).max() <= step + 1e-12
    after = made_up.run(1, **still)
    assert after.mode == Mode.FAULT
    assert len(after.command.numbers) == 7
    made_up.session.request(Request.RESET_FAULT)
    assert made_up.run(1, **still).mode == Mode.HOLD
    made_up.session.request(Request.ENABLE)
    assert made_up.run(1, **still).mode.follows


@pytest.mark.parametrize("lockstep", [False, True])
def test_extreme_stamps_keep_efforts_finite(lockstep: bool) -> None:
    """In real time and in lockstep, where every jump of the clock is taken at once."""
    stamps = (LARGEST_NS - 2 * MS, LARGEST_NS, SMALLEST_NS, SMALLEST_NS + 1, 0, LARGEST_NS, -1, 1, LARGEST_NS - 1)
    made_up, efforts = MadeUp(lockstep), 0
    for stamp_ns in stamps * 3:
        for k in range(7):  # more than `accept_after`
            made_up.pass_time()
            made_up.stamp_ns = min(stamp_ns + k, LARGEST_NS)
            made_up.deliver(slip=np.zeros(6))
            made_up.session.add_manifest(_Any())  # type: ignore[arg-type]
            made_up.session.add_joint(made_up.joint(velocity=np.zeros(7)), made_up.now_ns)
            result = made_up.session.cycle(made_up.now_ns)
            efforts += result is not None and len(result.command.numbers) > 0
            assert result is None or np.isfinite(result.command.numbers).all()
    assert efforts > 20


class _Any:
    """A manifest that every set of samples fits."""

    def __getattr__(self, _name: str) -> Any:
        return _Equal()


class _Equal:
    __hash__ = None  # type: ignore[assignment]

    def __eq__(self, _other: object) -> bool:
        return True
