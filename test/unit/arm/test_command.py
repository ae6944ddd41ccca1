"""Commands for drives that take velocities or positions: limits, rest, and the acceleration behind an effort."""

from __future__ import annotations

import numpy as np
import pytest

from slip_core.arrays import Array
from slip_vic_controller.arm.command import (
    LEAD,
    CommandLimits,
    SentCommand,
    advance_motion,
    joint_acceleration,
    return_to,
    start_motion,
    stop_motion,
)
from slip_vic_controller.sizes import MAX_JOINTS
from test.support.call import blank

N, PERIOD = 3, 1e-3
ROUNDING = 1e-9
VELOCITY, ACCELERATION = np.array([2.0, 1.0, 3.0]), np.array([15.0, 10.0, 20.0])


def limits(reach: float = 2.8) -> CommandLimits:
    config: CommandLimits = blank(CommandLimits)
    config.joints = N
    config.velocity[:N], config.acceleration[:N] = VELOCITY, ACCELERATION
    config.lower[:N], config.upper[:N] = -reach, reach
    return config


def begun(config: CommandLimits, q: Array, qd: Array) -> SentCommand:
    state: SentCommand = blank(SentCommand)
    start_motion(config, state, q, qd)
    return state


def full(values: Array) -> Array:
    return np.concatenate((values, np.zeros(MAX_JOINTS - len(values))))


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("period", [1e-3, 2e-3, 8e-3])
def test_any_command_keeps_every_limit(seed: int, period: float) -> None:
    rng, reach = np.random.default_rng(seed), 0.4
    config = limits(reach=reach)
    state = begun(config, np.zeros(N), np.zeros(N))
    wanted = np.zeros(N)
    for k in range(1500):
        if k % 40 == 0:
            wanted = rng.choice([-1.0, 1.0], N) * 10.0 ** rng.uniform(-1, 4, N)
        if rng.uniform() < 0.02:
            wanted = np.array([np.nan, np.inf, -np.inf])[rng.permutation(3)]
        before = state.velocity[:N].copy()
        advance_motion(config, state, full(wanted), full(before), period)
        assert (np.abs(state.velocity[:N]) <= VELOCITY + ROUNDING).all()
        assert (np.abs(state.velocity[:N] - before) <= ACCELERATION * period + ROUNDING).all()
        assert (np.abs(state.position[:N]) <= reach).all()


def test_command_stays_in_joint_range() -> None:
    """At the end at full speed, and measured beyond it: what is left is braked as ever, and the position stays."""
    config = limits(reach=0.4)
    state = begun(config, np.array([0.39999, -0.45, 0.7]), VELOCITY)
    assert state.position[:N].tolist() == [0.39999, -0.4, 0.4]
    for _ in range(1500):
        before = state.velocity[:N].copy()
        advance_motion(config, state, full(np.full(N, 5.0)), full(before), PERIOD)
        assert (np.abs(state.position[:N]) <= 0.4).all()
        assert (np.abs(state.velocity[:N] - before) <= ACCELERATION * PERIOD + ROUNDING).all()
    assert (state.velocity[:N] < ROUNDING).all()


def test_command_inside_limits_is_exact() -> None:
    config = limits()
    state = begun(config, np.full(N, 0.1), np.zeros(N))
    q, v = np.full(N, 0.1), np.zeros(N)
    for k in range(400):
        a = 0.5 * np.sin(0.01 * k) * np.ones(N)
        advance_motion(config, state, full(a), full(v), PERIOD)
        q, v = q + (v + 0.5 * a * 1e-3) * 1e-3, v + a * 1e-3
        assert state.position[:N].tolist() == q.tolist()
        assert state.velocity[:N].tolist() == v.tolist()


def test_stop_without_reversal() -> None:
    config = limits()
    state = begun(config, np.zeros(N), np.array([1.5, -0.9, 2.9]))
    sign = np.sign(state.velocity[:N])
    for _ in range(200):
        before = state.velocity[:N].copy()
        stop_motion(config, state, PERIOD)
        assert (sign * state.velocity[:N] >= -ROUNDING).all()
        assert (np.abs(state.velocity[:N] - before) <= ACCELERATION * PERIOD + ROUNDING).all()
    assert not state.velocity[:N].any()


def test_command_lead_is_bounded() -> None:
    config = limits()
    state = begun(config, np.zeros(N), np.zeros(N))
    for _ in range(3000):
        advance_motion(config, state, full(np.array([5.0, -5.0, 5.0])), np.zeros(MAX_JOINTS), PERIOD)
    assert (np.abs(state.velocity[:N]) <= LEAD + ROUNDING).all()


def test_acceleration_solves_equation_of_motion() -> None:
    rng = np.random.default_rng(5)
    A, J, h = rng.normal(size=(N, N)), rng.normal(size=(6, N)), rng.normal(size=6)
    M, bias, qdd = A @ A.T + np.eye(N), rng.normal(size=N), rng.normal(size=N)
    tau, found = M @ qdd + bias - J.T @ h, np.zeros(MAX_JOINTS)
    assert joint_acceleration(N, M, bias, J, h, tau, found)
    np.testing.assert_allclose(found[:N], qdd, rtol=1e-10, atol=1e-12)
    assert not joint_acceleration(N, -M, bias, J, h, tau, found)


def test_a_commanded_position_comes_back_at_half_the_speed_limit() -> None:
    config = limits()
    state = begun(config, np.zeros(N), np.zeros(N))
    return_to(config, state, full(np.array([0.5, -0.5, 0.01])), 0.1)
    np.testing.assert_allclose(state.position[:N], [0.1, -0.05, 0.01], rtol=1e-12)
