"""Limit avoidance: torques that keep joints from their stops and limit speeds."""

from __future__ import annotations

from collections import deque

import numpy as np

from slip_core.records import record
from slip_vic_controller.safety.limit_avoidance import avoid_limits
from slip_vic_controller.state import CONFIG
from test.support.call import call
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
    call(avoid_limits, BUFFER, N, q, qd, M, out)
    return out


def test_effort_passes_far_from_limits() -> None:
    wanted = np.linspace(-3.0, 3.0, N)
    assert torque(MIDDLE, np.zeros(N), HEAVY, wanted).tobytes() == wanted.tobytes()


def test_repulsion_reaches_full_effort() -> None:
    rest, zero = np.zeros(N), np.zeros(N)
    assert LIMITS.position_margin > 0.0
    for side, stop in ((1.0, ROBOT.position_lower), (-1.0, ROBOT.position_upper)):
        np.testing.assert_allclose(torque(stop + side * LIMITS.position_margin, rest, HEAVY, zero), 0.0, atol=CLOSE)
        np.testing.assert_allclose(torque(stop, rest, HEAVY, zero), side * ROBOT.effort_limit, atol=CLOSE)
        np.testing.assert_allclose(torque(stop - side, rest, HEAVY, zero), side * ROBOT.effort_limit, atol=CLOSE)
    for sign in (1.0, -1.0):
        fast = sign * ROBOT.velocity_limit
        np.testing.assert_allclose(torque(MIDDLE, fast, HEAVY, zero), -sign * ROBOT.effort_limit, atol=CLOSE)
        np.testing.assert_allclose(torque(MIDDLE, 0.9 * fast, HEAVY, zero), 0.0, atol=CLOSE)


def test_a_brake_only_takes_power() -> None:
    for seed in range(50):
        rng = np.random.default_rng(seed)
        M, qd = random_inertia(rng), 2.0 * rng.normal(size=N)
        assert torque(MIDDLE, qd, M, np.zeros(N)) @ qd <= 0.0


def largest_way_back(M: np.ndarray, qd: np.ndarray, late: int = 0) -> float:
    """Brake an arm with inertia M below its velocity limits; return how fast a joint turns back, of its first speed.

    late: periods after which an effort is at work.
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
