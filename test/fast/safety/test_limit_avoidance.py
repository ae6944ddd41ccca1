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
        joints, pad = joint_repulsion(LIMITS, q, qd), pad_brake(LIMITS, arm.J[:, :N], arm.twist)
        pushed, braked_pads = pushed + joints.any(), braked_pads + pad.any()
        np.testing.assert_allclose(torque(q, qd, buffer, False, wanted), wanted + joints, atol=CLOSE)
        np.testing.assert_allclose(torque(q, qd, buffer, True, wanted), wanted + joints + pad, atol=CLOSE)
    assert pushed > 100
    assert braked_pads > 20


def test_far_from_every_limit_the_wanted_effort_passes_to_the_last_bit() -> None:
    wanted, slow = np.linspace(-3.0, 3.0, N), random_arm(np.random.default_rng(0), 0.1)
    assert torque(MIDDLE, np.zeros(N), slow, True, wanted).tobytes() == wanted.tobytes()


def test_repulsion_is_continuous_and_reaches_the_full_effort_at_the_stop() -> None:
    rest, arm, zero = np.zeros(N), new(ARM), np.zeros(N)
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


def test_limits_are_the_parameters_and_the_urdf_s() -> None:
    limits = CONTROLLER.params.safety.limits
    assert MOTION_LIMITS.itemsize == LIMITS.dtype.itemsize
    np.testing.assert_allclose(LIMITS.near_lower[:N], ROBOT.position_lower + limits.position_margin)
    np.testing.assert_allclose(LIMITS.near_upper[:N], ROBOT.position_upper - limits.position_margin)
    np.testing.assert_allclose(LIMITS.velocity[:N], limits.velocity_scale * ROBOT.velocity_limit)
    np.testing.assert_allclose(LIMITS.trip[:N], limits.velocity_trip * LIMITS.velocity[:N])
    assert (LIMITS.speed_linear, LIMITS.speed_angular) == (limits.speed_linear, limits.speed_angular)
