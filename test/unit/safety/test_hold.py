"""HOLD: its effort, its load, and the delay that it bears: in closed form and in simulated loops."""

from __future__ import annotations

import math
from collections import deque
from typing import Any

import numpy as np
import pytest

from slip_core.records import dtype_of, new, record
from slip_core.vectors import Vec
from slip_vic_controller.arm.estimator import SLOW_S, JointRecord
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.params.controller_params import SafetyParams
from slip_vic_controller.safety.conditions import Mode
from slip_vic_controller.safety.hold import (
    DELAY,
    LOAD_LEVER,
    Hold,
    HoldConfig,
    carry_load,
    fill_hold,
    hold_effort,
    keep_posture,
    plausible_arm,
)
from slip_vic_controller.state import CONFIG
from test.referees.law_referee import S, exponential
from test.support.call import blank, call
from test.support.made_up import POSITION, N, law_at_work

SAFETY = SafetyParams()
CLOSE = 1e-9  # relative to the largest: products of matrices of size 1 to 100


def held_inertia(M: np.ndarray, J: np.ndarray, r: np.ndarray, mass: float, inertia: np.ndarray) -> np.ndarray:
    """Return M + J_o^T B_o J_o / 2; r = x_c - x_o {w}, inertia {w}."""
    J_v = J[:3] + S(r) @ J[3:]
    return M + 0.5 * (mass * J_v.T @ J_v + J[3:].T @ inertia @ J[3:])


def hold_torque(
    arm: Any, pad: np.ndarray, q: np.ndarray, qd: np.ndarray, posture: np.ndarray, r_pad: np.ndarray,
    rates: tuple[float, float], mass: float, inertia: np.ndarray, weight: np.ndarray, *, carries: bool,
) -> np.ndarray:  # fmt: skip
    """Return g + (M + J_o^T B_o J_o / 2) (k (q_0 - q) - d qd) - J^T h."""
    R, (rate, fastest) = arm.rotation, rates
    R_o, r = R @ pad.T, R @ r_pad
    H = held_inertia(arm.M, arm.J, r, mass, R_o @ inertia @ R_o.T)
    rate = min(rate, fastest / (np.diag(H) / np.diag(arm.M)).max())
    torque = arm.gravity + H @ (rate**2 * (posture - q) - 2.0 * rate * qd)
    return torque - carries * arm.J.T @ np.concatenate((weight, -np.cross(r, weight)))


class Random:
    """A random arm in HOLD with a random object."""

    def __init__(self, seed: int, n: int) -> None:
        rng = self.rng = np.random.default_rng(seed)
        layouts = (dtype_of(HoldConfig), dtype_of(Hold), ARM)
        self.n, self.buffers = n, [new(layout) for layout in layouts]
        self.config, self.hold, self.arm = (
            record(buffer, layout) for buffer, layout in zip(self.buffers, layouts, strict=True)
        )
        root, inertia_root = rng.standard_normal((n, n)), 0.3 * rng.standard_normal((3, 3))
        self.config.rate, self.config.fastest = 15.0, 230.0 if seed % 2 else 10.0
        self.config.mass, self.config.inertia[:] = 0.7, inertia_root @ inertia_root.T
        self.config.weight[:] = self.config.mass * rng.standard_normal(3) * 9.81
        self.hold.posture[:n] = rng.standard_normal(n)
        self.arm.M[:n, :n], self.arm.J[:, :n] = root @ root.T, rng.standard_normal((6, n))
        self.arm.rotation[:], self.arm.gravity[:n] = exponential(rng.standard_normal(3)), rng.standard_normal(n)
        self.pad, self.r_pad = exponential(rng.standard_normal(3)), 0.3 * rng.standard_normal(3)
        sample = self.sample = blank(JointRecord)
        self.q, self.qd = sample.position[:n], sample.velocity[:n]
        self.q[:], self.qd[:] = rng.standard_normal((2, n))
        self.config.joints = n

    def torque(self, carries: bool) -> np.ndarray:
        out, (config, hold, arm) = np.empty(self.n), self.buffers
        call(hold_effort, config, hold, arm, self.sample, self.pad, self.r_pad, out)
        if carries:
            call(carry_load, config, arm, self.r_pad, out)
        return out

    def referee(self, carries: bool) -> np.ndarray:
        n, a, c = self.n, self.arm, self.config
        arm = type("Arm", (), {"rotation": a.rotation, "gravity": a.gravity[:n], "J": a.J[:, :n], "M": a.M[:n, :n]})
        rates = c.rate, c.fastest
        return hold_torque(
            arm, self.pad, self.q, self.qd, self.hold.posture[:n], self.r_pad, rates, c.mass, c.inertia, c.weight,
            carries=carries,
        )  # fmt: skip


def test_effort_of_hold() -> None:
    for seed in range(24):
        case = Random(seed, 3 + seed % 8)
        for carries in (True, False):
            expected = case.referee(carries)
            np.testing.assert_allclose(case.torque(carries), expected, rtol=0.0, atol=CLOSE * np.abs(expected).max())


@pytest.mark.parametrize(("friction", "stays"), [(10.0, False), (20.0, True)])
def test_a_joint_that_friction_holds_elsewhere_stays(friction: float, stays: bool) -> None:
    case, M = Random(0, 3), 4.0 * np.eye(3)
    case.qd[:] = 0.0
    case.hold.posture[:3] = case.q + 0.02
    call(keep_posture, case.config, case.hold, case.sample, np.zeros(3, np.int64), M, np.full(3, friction), 0.1)
    assert 10.0 < 225.0 * 4.0 * 0.02 < 20.0
    np.testing.assert_allclose(case.hold.posture[:3] - case.q, 0.02 * (1.0 - (0.1 / SLOW_S if stays else 0.0)))


def test_a_joint_whose_effort_is_limited_takes_its_posture_along() -> None:
    made_up = law_at_work()
    assert made_up.past_validation(wrench=np.full(6, np.nan)).mode is Mode.HOLD
    before = np.array(made_up.state.hold.posture[:N])
    limit = record(made_up.controller.config, CONFIG).command.velocity[:N]
    velocity = limit * np.array([1.01, -1.01, 0.0, 0.0, 0.0, 0.0, 1.4])
    away = made_up.joint(POSITION + 1e-4 * np.arange(N), velocity)
    result = made_up.past_validation(away)
    assert result.mode is Mode.HOLD
    limited = result.record.saturated[:N] != 0
    assert 0 < limited.sum() < N
    np.testing.assert_array_equal(made_up.state.hold.posture[:N], np.where(limited, away.position, before))


def test_longest_gap() -> None:
    for more_ns, mode in ((0, Mode.ACTIVE), (1, Mode.HOLD)):
        made_up = law_at_work()
        gap_ns = int(record(made_up.controller.config, CONFIG).joint.age_ns)
        assert made_up.past_validation(passed_ns=gap_ns + more_ns).mode is mode


@pytest.mark.parametrize(("away", "used"), [(0.999, 0.999), (1.001, 1.0), (50.0, 1.0)])
def test_lever_stays_near_its_configured_place(away: float, used: float) -> None:
    configured, direction = Vec(0.02, -0.3, 0.1), np.array([0.6, 0.0, -0.8])
    found = plausible_arm(configured, configured + Vec(*(away * LOAD_LEVER * direction))) - configured
    np.testing.assert_allclose(tuple(found), used * LOAD_LEVER * direction, atol=1e-15)


# -- the delay that it bears --------------------------------------------------------------------------


def response(k: float, d: float, excess: float, delay_s: float) -> float:
    """Return how much a mass under k, d with a delay swings after 40 time constants, of 1 at the start."""
    dt, steps = 1e-4, round(40.0 / math.sqrt(excess * k) / 1e-4)
    x, v, late = 1.0, 0.0, deque([(1.0, 0.0)] * round(delay_s / dt))
    largest = 0.0
    for step in range(steps):
        late.append((x, v))
        x_old, v_old = late.popleft()
        v += dt * -excess * (k * x_old + d * v_old)
        x += dt * v
        if step > 0.9 * steps:
            largest = max(largest, abs(x))
    return largest


@pytest.mark.parametrize("frequency", [15.0, 20.0])
def test_delay_margin_matches_simulation(frequency: float) -> None:
    margin = DELAY / frequency
    assert response(frequency**2, 2.0 * frequency, 1.5, 0.93 * margin) < 0.2
    assert response(frequency**2, 2.0 * frequency, 1.5, 1.07 * margin) > 5.0


def test_the_period_bounds_the_rate_of_hold_and_two_pads_share_the_object() -> None:
    hold, inertia, gravity = blank(HoldConfig), np.arange(9.0).reshape(3, 3), np.array([0.5, 1.0, -9.8])
    hold.carriers = 2
    call(fill_hold, hold, 0.6, inertia, gravity, SAFETY.hold_stiffness, 0.02)
    assert hold.rate**2 == pytest.approx(SAFETY.hold_stiffness)
    assert 2.0 * hold.fastest * 0.02 == pytest.approx(DELAY)
    np.testing.assert_allclose(hold.weight, 0.3 * gravity, rtol=CLOSE)
    np.testing.assert_allclose(hold.inertia, 0.5 * inertia, rtol=CLOSE)
