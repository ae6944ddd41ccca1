"""Limit avoidance: torques that keep joints from their stops and limit speeds, against numpy."""

from __future__ import annotations

import numpy as np

from slip_core.records import new, record
from slip_vic_controller.cycle import CONFIG
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.safety.limit_avoidance import MOTION_LIMITS
from test.referees.safety_referee import joint_repulsion, pad_brake
from test.support.made_up import N, controller_of
from test.support.safety_kernels import run_limit_avoidance

CLOSE = 1e-10  # sums of products up to 1e4
CONTROLLER = controller_of()
ROBOT = CONTROLLER.robot
LIMITS = record(CONTROLLER.config, CONFIG).motion
BUFFER = np.frombuffer(LIMITS.tobytes()).copy()
MIDDLE, HALF = (ROBOT.position_upper + ROBOT.position_lower) / 2, (ROBOT.position_upper - ROBOT.position_lower) / 2


def random_arm(rng: np.random.Generator, speed: float) -> np.ndarray:
    buffer = new(ARM)
    arm = record(buffer, ARM)
    arm.J[:, :N], arm.twist[:] = rng.normal(size=(6, N)), speed * rng.normal(size=6)
    arm.M[range(N), range(N)] = 10.0 ** rng.uniform(-2.5, 1.0, N)
    return buffer


def heavy_arm() -> np.ndarray:
    """Return an arm whose joints no brake turns round."""
    buffer = new(ARM)
    record(buffer, ARM).M[range(N), range(N)] = 1e6
    return buffer


def torque(q: np.ndarray, qd: np.ndarray, arm: np.ndarray, braked: bool, wanted: np.ndarray) -> np.ndarray:
    out = np.array(wanted)
    run_limit_avoidance(BUFFER, N, q, qd, arm, braked, out)
    return out


def test_it_adds_repulsion_of_the_joints_and_the_brake_of_the_pad() -> None:
    pushed = braked_pads = 0
    for seed in range(300):
        rng = np.random.default_rng(seed)
        q, qd = MIDDLE + HALF * rng.uniform(-1.05, 1.05, N), ROBOT.velocity_limit * rng.uniform(-1.2, 1.2, N)
        buffer, wanted = random_arm(rng, 10.0 ** rng.uniform(-2, 1)), 60.0 * rng.normal(size=N)
        arm = record(buffer, ARM)
        joints, pad = joint_repulsion(LIMITS, q, qd, np.diag(arm.M)[:N]), pad_brake(LIMITS, arm.J[:, :N], arm.twist)
        pushed, braked_pads = pushed + joints.any(), braked_pads + pad.any()
        np.testing.assert_allclose(torque(q, qd, buffer, False, wanted), wanted + joints, atol=CLOSE)
        np.testing.assert_allclose(torque(q, qd, buffer, True, wanted), wanted + joints + pad, atol=CLOSE)
    assert pushed > 100
    assert braked_pads > 20


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


def test_a_brake_at_the_rate_limit_stops_a_joint_and_never_turns_it_round() -> None:
    """With the full effort, a joint that is light for its motor is thrown from one side to the other for ever."""
    arm, limits = new(ARM), record(BUFFER.copy(), MOTION_LIMITS)
    T, step = limits.period, limits.rate * limits.period
    for inertia in (2e-3, 6e-3, 0.03, 0.2, 1.5):
        record(arm, ARM).M[range(N), range(N)] = 2.0 * inertia  # half of it gives way
        for speed in (3.0, 12.0, 50.0):
            qd, effort = np.full(N, speed), np.zeros(N)
            for _ in range(round((1.0 + 12.0 * inertia) / T)):
                wanted = torque(MIDDLE, qd, arm, False, np.zeros(N))
                effort = effort + np.clip(wanted - effort, -step, step)
                qd = qd + T * effort / inertia
                assert (qd > -1e-9).all(), (inertia, speed)
            assert (qd <= LIMITS.velocity[:N]).all()


def test_limits_are_the_parameters_and_the_urdf_s() -> None:
    limits = CONTROLLER.params.safety.limits
    assert MOTION_LIMITS.itemsize == LIMITS.dtype.itemsize
    np.testing.assert_allclose(LIMITS.near_lower[:N], ROBOT.position_lower + limits.position_margin)
    np.testing.assert_allclose(LIMITS.near_upper[:N], ROBOT.position_upper - limits.position_margin)
    np.testing.assert_allclose(LIMITS.velocity[:N], limits.velocity_scale * ROBOT.velocity_limit)
    np.testing.assert_allclose(LIMITS.trip[:N], limits.velocity_trip * LIMITS.velocity[:N])
    assert (LIMITS.speed_linear, LIMITS.speed_angular) == (limits.speed_linear, limits.speed_angular)
    assert (LIMITS.rate, LIMITS.period) == (limits.effort_rate, CONTROLLER.params.control_period_s)
