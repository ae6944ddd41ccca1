"""The last gate: whatever is wanted, what leaves it is finite, inside the limits and no steeper than the slope."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from slip_vic_controller.core.output_gate import GateLimits, GateState, needs_restart, pass_gate, start_gate

LIMIT = np.array([87.0, 12.0, 1e-3])
LIMITS = GateLimits(LIMIT, 1000.0, 5_000_000, 50_000_000)
ROUNDING = 1e-12  # one addition of numbers below 100
any_float = st.floats(allow_nan=True, allow_infinity=True, width=64)
wants = st.lists(st.tuples(arrays(float, 3, elements=any_float), st.integers(-(10**9), 10**9)), min_size=1, max_size=20)


@given(wants)
@settings(max_examples=200, deadline=None)
def test_any_sequence_stays_finite_inside_and_slow(sequence: list[tuple[np.ndarray, int]]) -> None:
    state, now = GateState(np.zeros(3), 0), 0
    for wanted, passed in sequence:
        now += passed
        before = state
        with np.errstate(all="ignore"):
            result = pass_gate(LIMITS, state, wanted, now)
        state = result.state
        assert np.isfinite(result.effort).all()
        assert (np.abs(result.effort) <= LIMIT).all()
        allowed = 1000.0 * min(max(now - before.now_ns, 0), 5_000_000) * 1e-9
        assert (np.abs(result.effort - before.effort) <= allowed + ROUNDING).all()
        assert state.now_ns >= before.now_ns
        assert result.refused == (not np.isfinite(wanted).all() or bool((np.abs(wanted) > 1e154).any()))


@pytest.mark.parametrize("period_ns", [250_000, 1_000_000, 4_000_000])
def test_slope_does_not_depend_on_the_control_rate(period_ns: int) -> None:
    """A step of 50 N m takes 50 ms, at 4 kHz as at 250 Hz."""
    state, now = GateState(np.zeros(3), 0), 0
    while state.effort[0] < 50.0:
        now += period_ns
        state = pass_gate(LIMITS, state, np.array([50.0, 0.0, 0.0]), now).state
    assert now == pytest.approx(50_000_000, abs=period_ns)


def test_what_needs_no_limit_passes_to_the_last_bit() -> None:
    wanted = np.array([0.1, -0.2, 1e-4])
    result = pass_gate(LIMITS, GateState(np.zeros(3), 0), wanted, 1_000_000)
    assert result.effort.tobytes() == wanted.tobytes()
    assert not result.clipped.any()
    assert not result.limited.any()


def test_flags_say_which_joint_was_held_back_and_why() -> None:
    result = pass_gate(LIMITS, GateState(np.array([86.5, 0.0, 0.0]), 0), np.array([100.0, 5.0, 0.0]), 1_000_000)
    assert result.clipped.tolist() == [True, False, False]
    assert result.limited.tolist() == [False, True, False]
    np.testing.assert_allclose(result.effort, [87.0, 1.0, 0.0], atol=ROUNDING)


@pytest.mark.parametrize("wanted", [np.full(3, np.nan), np.array([1.0, np.inf, 0.0]), np.zeros(2), np.full(3, 1e200)])
def test_what_is_no_effort_repeats_the_last_one(wanted: np.ndarray) -> None:
    last = np.array([3.0, -2.0, 0.0])
    with np.errstate(all="ignore"):
        result = pass_gate(LIMITS, GateState(last, 0), wanted, 1_000_000)
    assert result.refused
    np.testing.assert_array_equal(result.effort, last)


@pytest.mark.parametrize(
    ("measured", "expected"),
    [
        (np.array([5.0, 1.0, 0.0]), [5.0, 1.0, 0.0]),
        (np.array([500.0, 1.0, 0.0]), [87.0, 1.0, 0.0]),
        (np.array([np.nan, 1.0, 0.0]), [7.0, 8.0, 0.0]),
        (np.zeros(3), [7.0, 8.0, 0.0]),
        (np.zeros(0), [7.0, 8.0, 0.0]),
        (None, [7.0, 8.0, 0.0]),
    ],
    ids=["measured", "too large", "not finite", "all zero", "none", "unknown"],
)
def test_start_is_what_the_joints_feel_or_gravity(measured: np.ndarray | None, expected: list[float]) -> None:
    np.testing.assert_array_equal(start_gate(LIMITS, measured, np.array([7.0, 8.0, 0.0]), 0).effort, expected)


def test_restart_after_a_pause_only() -> None:
    state = GateState(np.zeros(3), 1_000)
    assert needs_restart(LIMITS, None, 0)
    assert not needs_restart(LIMITS, state, 50_001_000)
    assert needs_restart(LIMITS, state, 50_001_001)
