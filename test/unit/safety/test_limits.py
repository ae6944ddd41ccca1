"""Limit avoidance keeps joints from their stops and limits speeds; what leaves the effort limiter keeps every limit."""

from __future__ import annotations

from collections import deque

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from slip_core.records import record
from slip_vic_controller.arm.command import CommandLimits, SentCommand
from slip_vic_controller.safety.limits import avoid_limits, felt_inertias, limit_effort, needs_restart, start_limiter
from slip_vic_controller.state import CONFIG
from test.support.call import blank, call
from test.support.made_up import N, controller_of

CLOSE = 1e-10  # sums of products up to 1e4
STILL = 1e-9  # N m: a brake that asks for no more has done
CONTROLLER = controller_of()
ROBOT = CONTROLLER.first.robot
LIMITS = record(CONTROLLER.config, CONFIG).command
BUFFER = np.frombuffer(LIMITS.tobytes()).copy()
MIDDLE = (ROBOT.position_upper + ROBOT.position_lower) / 2


HEAVY = 1e6 * np.eye(N)  # joints that no brake turns round


def random_inertia(rng: np.random.Generator) -> np.ndarray:
    root = rng.normal(size=(N, N)) * np.sqrt(10.0 ** rng.uniform(-2.5, 1.0, N))
    return root.T @ root


def torque(q: np.ndarray, qd: np.ndarray, M: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    out = np.array(wanted)
    call(avoid_limits, BUFFER, q, qd, M, out)
    return out


def test_repulsion_reaches_full_effort() -> None:
    rest, zero = np.zeros(N), np.zeros(N)
    assert LIMITS.position_margin > 0.0
    for side, stop in ((1.0, ROBOT.position_lower), (-1.0, ROBOT.position_upper)):
        np.testing.assert_allclose(torque(stop + side * LIMITS.position_margin, rest, HEAVY, zero), 0.0, atol=CLOSE)
        np.testing.assert_allclose(torque(stop, rest, HEAVY, zero), side * ROBOT.effort_limit, atol=CLOSE)
        np.testing.assert_allclose(torque(stop - side, rest, HEAVY, zero), side * ROBOT.effort_limit, atol=CLOSE)
    for sign in (1.0, -1.0):
        fast = sign * ROBOT.velocity_limit
        for part, effort in ((0.9, 0.0), (0.95, -0.5), (1.0, -1.0)):
            found = torque(MIDDLE, part * fast, HEAVY, zero)
            np.testing.assert_allclose(found, effort * sign * ROBOT.effort_limit, atol=CLOSE)


def test_inertia_that_a_joint_feels() -> None:
    M, felt = random_inertia(np.random.default_rng(1)), np.zeros(N)
    call(felt_inertias, M, N, felt)
    np.testing.assert_allclose(felt, 1.0 / np.diag(np.linalg.inv(M)), rtol=1e-6)


def largest_way_back(M: np.ndarray, qd: np.ndarray, late: int = 0) -> float:
    """Brake an arm with inertia M below its velocity limits; return how fast a joint turns back, of its first speed.

    late: periods after which an effort acts.
    """
    T, first, effort, back = 1e-9 * LIMITS.period_ns, qd, np.zeros(N), 0.0
    step, moved, on_the_way = LIMITS.effort_rate * T, qd @ M @ qd / (qd @ qd), deque([np.zeros(N)] * late)
    for _ in range(round((1.0 + 12.0 * moved) / T)):
        effort = effort + np.clip(torque(MIDDLE, qd, M, np.zeros(N)) - effort, -step, step)
        on_the_way.append(effort)
        qd = qd + T * np.linalg.solve(M, on_the_way.popleft())
        back = max(back, float((-qd / first).max()))
        if max(np.abs(waiting).max() for waiting in (effort, *on_the_way)) < STILL:
            break
    assert (np.abs(qd) <= LIMITS.velocity[:N]).all()
    return back


def test_brake_never_reverses_a_joint() -> None:
    """With the full effort, a joint that is light for its motor is thrown from one side to the other for ever."""
    for inertia in (2e-3, 6e-3, 0.03, 0.2, 1.5):
        for speed in (3.0, 12.0, 50.0):
            assert largest_way_back(inertia * np.eye(N), np.full(N, speed)) < CLOSE


# -- effort limiter ------------------------------------------------------------------------------------

JOINTS, PERIOD_NS = 3, 4_000_000
LIMIT = np.array([87.0, 12.0, 1e-3])
ROUNDING = 1e-12  # one addition of numbers below 100
any_float = st.floats(allow_nan=True, allow_infinity=True, width=64)
wants = st.lists(
    st.tuples(arrays(float, JOINTS, elements=any_float), st.integers(-(10**9), 10**9)), min_size=1, max_size=20
)


def limits_record() -> CommandLimits:
    limits = blank(CommandLimits)
    limits.joints, limits.effort[:JOINTS], limits.effort_rate = JOINTS, LIMIT, 1000.0
    limits.longest_step_ns, limits.restart_after_ns, limits.period_ns = 5_000_000, 50_000_000, PERIOD_NS
    return limits


LIMITER = limits_record()


class Limiter:
    """What runs, from an effort at a time."""

    def __init__(self, effort=(0.0, 0.0, 0.0), now_ns: int = 0) -> None:
        self.record = blank(SentCommand)
        self.record.started, self.record.now_ns, self.record.effort[:JOINTS] = 1, now_ns, effort

    @property
    def effort(self) -> np.ndarray:
        return self.record.effort[:JOINTS].copy()

    def take(self, wanted: np.ndarray, now_ns: int) -> bool:
        flags = np.full(JOINTS, 7)
        finite = call(limit_effort, LIMITER, self.record, wanted, now_ns, flags)
        self.clipped = flags == 1
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


def test_flags_name_limited_joints() -> None:
    limiter = Limiter((86.5, 0.0, 0.0))
    limiter.take(np.array([100.0, 5.0, 0.0]), 1_000_000)
    assert limiter.clipped.tolist() == [True, True, False]
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
    assert call(needs_restart, LIMITER, limiter.record, 0)
    call(start_limiter, LIMITER, limiter.record, measured, gravity, 10**9)
    np.testing.assert_allclose(limiter.effort, expected, rtol=0.0, atol=ROUNDING)
    assert limiter.record.now_ns == 10**9 - PERIOD_NS  # the first step counts one control period
    assert limiter.record.started == 1


def test_restart_after_a_pause_only() -> None:
    limiter = Limiter(now_ns=1_000)
    assert not call(needs_restart, LIMITER, limiter.record, 50_001_000)
    assert call(needs_restart, LIMITER, limiter.record, 50_001_001)
