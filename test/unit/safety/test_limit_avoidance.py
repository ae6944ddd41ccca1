"""Limit avoidance: torques that keep joints from their stops and limit speeds."""

from __future__ import annotations

from collections import deque

import numpy as np

from slip_core.records import new, record
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.safety.effort_limiter import NS
from slip_vic_controller.safety.limit_avoidance import avoid_limits
from slip_vic_controller.state import CONFIG
from test.support.call import call
from test.support.made_up import N, controller_of

CLOSE = 1e-10  # sums of products up to 1e4
STILL = 1e-9  # N m: a brake that asks for no more has done
CONTROLLER = controller_of()
ROBOT = CONTROLLER.first.robot
LIMITS = record(CONTROLLER.config, CONFIG).motion
BUFFER = np.frombuffer(LIMITS.tobytes()).copy()
MIDDLE = (ROBOT.position_upper + ROBOT.position_lower) / 2


def random_arm(rng: np.random.Generator, speed: float) -> np.ndarray:
    buffer = new(ARM)
    arm = record(buffer, ARM)
    arm.J[:, :N], arm.twist[:] = rng.normal(size=(6, N)), speed * rng.normal(size=6)
    root = rng.normal(size=(N, N)) * np.sqrt(10.0 ** rng.uniform(-2.5, 1.0, N))
    arm.M[:N, :N] = root.T @ root
    return buffer


def heavy_arm() -> np.ndarray:
    """Return an arm whose joints no brake turns round."""
    buffer = new(ARM)
    record(buffer, ARM).M[range(N), range(N)] = 1e6
    return buffer


def torque(q: np.ndarray, qd: np.ndarray, arm: np.ndarray, braked: bool, wanted: np.ndarray) -> np.ndarray:
    out = np.array(wanted)
    call(avoid_limits, BUFFER, N, q, qd, arm, braked, out)
    return out


def test_effort_passes_far_from_limits() -> None:
    wanted, slow = np.linspace(-3.0, 3.0, N), random_arm(np.random.default_rng(0), 0.1)
    assert torque(MIDDLE, np.zeros(N), slow, True, wanted).tobytes() == wanted.tobytes()


def test_repulsion_reaches_full_effort() -> None:
    rest, arm, zero = np.zeros(N), heavy_arm(), np.zeros(N)
    assert LIMITS.margin > 0.0
    for side, stop in ((1.0, ROBOT.position_lower), (-1.0, ROBOT.position_upper)):
        np.testing.assert_allclose(torque(stop + side * LIMITS.margin, rest, arm, False, zero), 0.0, atol=CLOSE)
        np.testing.assert_allclose(torque(stop, rest, arm, False, zero), side * ROBOT.effort_limit, atol=CLOSE)
        np.testing.assert_allclose(torque(stop - side, rest, arm, False, zero), side * ROBOT.effort_limit, atol=CLOSE)
    for sign in (1.0, -1.0):
        fast = sign * ROBOT.velocity_limit
        np.testing.assert_allclose(torque(MIDDLE, fast, arm, False, zero), -sign * ROBOT.effort_limit, atol=CLOSE)
        np.testing.assert_allclose(torque(MIDDLE, 0.9 * fast, arm, False, zero), 0.0, atol=CLOSE)


def test_a_brake_only_takes_power() -> None:
    for seed in range(50):
        rng = np.random.default_rng(seed)
        buffer, qd = random_arm(rng, 0.0), 2.0 * rng.normal(size=N)
        arm = record(buffer, ARM)
        arm.twist[:] = arm.J[:, :N] @ qd  # the pad's motion is that of the joints
        assert torque(MIDDLE, qd, buffer, True, np.zeros(N)) @ qd <= 0.0


def largest_way_back(M: np.ndarray, qd: np.ndarray, late: int = 0) -> float:
    """Brake an arm with inertia M below its velocity limits; return how fast a joint turns back, of its first speed.

    late: periods after which an effort is at work.
    """
    arm, drive = new(ARM), LIMITS.drive
    record(arm, ARM).M[:N, :N] = M
    T, first, effort, back = NS * drive.period_ns, qd, np.zeros(N), 0.0
    step, moved, on_the_way = drive.rate * T, qd @ M @ qd / (qd @ qd), deque([np.zeros(N)] * late)
    for _ in range(round((1.0 + 12.0 * moved) / T)):
        effort = effort + np.clip(torque(MIDDLE, qd, arm, False, np.zeros(N)) - effort, -step, step)
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
