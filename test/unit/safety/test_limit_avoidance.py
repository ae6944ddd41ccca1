"""Limit avoidance: torques that keep joints from their stops and limit speeds."""

from __future__ import annotations

from collections import deque

import numpy as np

from slip_core.records import new, record
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.safety.effort_limiter import NS
from slip_vic_controller.safety.limit_avoidance import BRAKE_LAG_S, MOTION_LIMITS, TRIP_SHARE, avoid_limits
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


def test_far_from_every_limit_the_wanted_effort_passes_to_the_last_bit() -> None:
    wanted, slow = np.linspace(-3.0, 3.0, N), random_arm(np.random.default_rng(0), 0.1)
    assert torque(MIDDLE, np.zeros(N), slow, True, wanted).tobytes() == wanted.tobytes()


def test_repulsion_is_continuous_and_reaches_the_full_effort_at_the_stop() -> None:
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


def coupled(inertia: float, shared: float) -> np.ndarray:
    """Return the inertia of joints that in pairs have nearly one axis."""
    M = inertia * np.eye(N)
    for j in range(0, N - 1, 2):
        M[j, j + 1] = M[j + 1, j] = shared * inertia
    return M


def test_a_brake_at_the_rate_limit_stops_a_joint_and_never_turns_it_round() -> None:
    """With the full effort, a joint that is light for its motor is thrown from one side to the other for ever."""
    for inertia in (2e-3, 6e-3, 0.03, 0.2, 1.5):
        for speed in (3.0, 12.0, 50.0):
            assert largest_way_back(inertia * np.eye(N), np.full(N, speed)) < CLOSE


def test_joints_with_nearly_one_axis_are_braked_as_the_light_motion_that_they_share() -> None:
    """Each has the inertia of the whole arm; against each other they turn next to nothing."""
    opposite = np.array([1.0, -1.0] * (N // 2) + [1.0] * (N % 2))
    for inertia, shared in ((1.5, 0.99), (0.2, 0.95), (4.0, 0.995)):
        for speed in (3.0, 12.0, 25.0):
            assert largest_way_back(coupled(inertia, shared), speed * opposite) < CLOSE


def test_a_brake_bears_efforts_that_are_late() -> None:
    late = round(BRAKE_LAG_S / (NS * LIMITS.drive.period_ns))
    assert late >= 5
    for inertia in (2e-3, 6e-3, 0.03, 0.2, 1.5):
        for speed in (3.0, 12.0, 50.0):
            assert largest_way_back(inertia * np.eye(N), np.full(N, speed), late) < 0.5


def test_limits_are_the_parameters_and_the_urdf_s() -> None:
    limits = CONTROLLER.first.params.safety.limits
    assert MOTION_LIMITS.itemsize == LIMITS.dtype.itemsize
    np.testing.assert_allclose(LIMITS.near_lower[:N], ROBOT.position_lower + limits.position_margin)
    np.testing.assert_allclose(LIMITS.near_upper[:N], ROBOT.position_upper - limits.position_margin)
    np.testing.assert_allclose(LIMITS.velocity[:N], limits.velocity_scale * ROBOT.velocity_limit)
    np.testing.assert_allclose(LIMITS.trip[:N], TRIP_SHARE * LIMITS.velocity[:N])
    assert (LIMITS.speed_linear, LIMITS.speed_angular) == (limits.speed_linear, limits.speed_angular)
    assert (LIMITS.drive.rate, NS * LIMITS.drive.period_ns) == (
        limits.effort_rate,
        CONTROLLER.first.params.control_period_s,
    )
    np.testing.assert_array_equal(LIMITS.drive.effort[:N], ROBOT.effort_limit)
