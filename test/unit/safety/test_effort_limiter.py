"""The effort limiter: whatever is wanted, what leaves it is finite, inside the limits and no steeper than the slope."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from slip_core.records import new, record
from slip_vic_controller.arm.command import COMMAND_LIMITS, SENT_COMMAND
from slip_vic_controller.safety import effort_limiter
from slip_vic_controller.safety.effort_limiter import (
    needs_restart,
    start_limiter,
)
from test.support.call import call

N, PERIOD_NS = 3, 4_000_000
LIMIT = np.array([87.0, 12.0, 1e-3])
ROUNDING = 1e-12  # one addition of numbers below 100
any_float = st.floats(allow_nan=True, allow_infinity=True, width=64)
wants = st.lists(st.tuples(arrays(float, N, elements=any_float), st.integers(-(10**9), 10**9)), min_size=1, max_size=20)


def limits_record() -> np.ndarray:
    buffer = new(COMMAND_LIMITS)
    limits = record(buffer, COMMAND_LIMITS)
    limits.effort[:N], limits.effort_rate = LIMIT, 1000.0
    limits.longest_step_ns, limits.restart_after_ns, limits.period_ns = 5_000_000, 50_000_000, PERIOD_NS
    return buffer


LIMITS = limits_record()


class Limiter:
    """What runs, from an effort at a time."""

    def __init__(self, effort=(0.0, 0.0, 0.0), now_ns: int = 0) -> None:
        self.buffer = new(SENT_COMMAND)
        self.record = record(self.buffer, SENT_COMMAND)
        self.record.started, self.record.now_ns, self.record.effort[:N] = 1, now_ns, effort

    @property
    def effort(self) -> np.ndarray:
        return self.record.effort[:N].copy()

    def take(self, wanted: np.ndarray, now_ns: int) -> bool:
        flags = clipped, limited = np.full((2, N), 7)
        finite = call(effort_limiter.limit_effort, LIMITS, self.buffer, N, wanted, now_ns, clipped, limited)
        self.clipped, self.limited = flags == 1
        assert ((flags == 0) | (flags == 1)).all()
        return bool(finite)


@given(wants)
@settings(max_examples=100)
def test_any_sequence_stays_inside_limits(sequence: list[tuple[np.ndarray, int]]) -> None:
    limiter, now = Limiter(), 0
    for wanted, passed in sequence:
        now += passed
        before, before_ns = limiter.effort, int(limiter.record.now_ns)
        finite = limiter.take(wanted, now)
        assert np.isfinite(limiter.effort).all()
        assert (np.abs(limiter.effort) <= LIMIT).all()
        allowed = 1000.0 * min(max(now - before_ns, 0), 5_000_000) * 1e-9
        assert (np.abs(limiter.effort - before) <= allowed + ROUNDING).all()
        assert limiter.record.now_ns == max(before_ns, now)
        assert finite == (np.isfinite(wanted).all() and bool((np.abs(wanted) <= 1e154).all()))


def test_unlimited_effort_passes_exactly() -> None:
    limiter, wanted = Limiter(), np.array([0.1, -0.2, 1e-4])
    assert limiter.take(wanted, 1_000_000)
    assert limiter.effort.tobytes() == wanted.tobytes()
    assert not limiter.clipped.any()
    assert not limiter.limited.any()


def test_flags_name_limited_joints() -> None:
    limiter = Limiter((86.5, 0.0, 0.0))
    limiter.take(np.array([100.0, 5.0, 0.0]), 1_000_000)
    assert limiter.clipped.tolist() == [True, True, False]  # held back at all
    assert limiter.limited.tolist() == [False, True, False]
    np.testing.assert_allclose(limiter.effort, [87.0, 1.0, 0.0], atol=ROUNDING)


@pytest.mark.parametrize("wanted", [np.full(3, np.nan), np.array([1.0, np.inf, 0.0]), np.array([1.0, 0.0, -1e200])])
def test_invalid_effort_repeats_the_last(wanted: np.ndarray) -> None:
    last = np.array([3.0, -2.0, 0.0])
    limiter = Limiter(last)
    assert not limiter.take(wanted, 1_000_000)
    np.testing.assert_array_equal(limiter.effort, last)


def test_backward_clock_allows_no_step() -> None:
    limiter = Limiter(now_ns=10_000_000)
    limiter.take(LIMIT.copy(), 9_000_000)
    np.testing.assert_array_equal(limiter.effort, 0.0)
    limiter.take(LIMIT.copy(), 11_000_000)
    assert limiter.effort[0] == pytest.approx(1.0)


GRAVITY = np.array([7.0, 8.0, 5e-4])


@pytest.mark.parametrize(
    ("measured", "gravity", "expected"),
    [
        (np.array([5.0, 9.0, 4e-4]), GRAVITY, [5.0, 9.0, 4e-4]),
        (np.array([500.0, 1.0, -1.0]), GRAVITY, [24.4, 5.6, 3e-4]),  # a fifth of the limit off gravity: currents
        (np.array([np.nan, 1.0, 0.0]), GRAVITY, GRAVITY),
        (np.zeros(3), GRAVITY, GRAVITY),
        (np.zeros(3), 100.0 * GRAVITY, [87.0, 12.0, 1e-3]),
    ],
)
def test_start_at_measured_effort_or_gravity(measured, gravity, expected) -> None:
    limiter = Limiter()
    limiter.record.started = 0
    assert call(needs_restart, LIMITS, limiter.buffer, 0)
    call(start_limiter, LIMITS, limiter.buffer, N, measured, gravity, 10**9)
    np.testing.assert_allclose(limiter.effort, expected, rtol=0.0, atol=ROUNDING)
    assert limiter.record.now_ns == 10**9 - PERIOD_NS  # the first step counts one control period
    assert limiter.record.started == 1


def test_restart_after_a_pause_only() -> None:
    limiter = Limiter(now_ns=1_000)
    assert not call(needs_restart, LIMITS, limiter.buffer, 50_001_000)
    assert call(needs_restart, LIMITS, limiter.buffer, 50_001_001)
