"""The guard's and the watches' kernels against plain forms and against numpy."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slip_core.arrays import Array
from slip_vic_controller.core.arm import ArmModel, ArmTerms
from slip_vic_controller.core.guard_kernel import WATCHED, guard, too_fast_index, watch
from slip_vic_controller.core.load_monitor import EvidenceState, LoadPolicy, fall_speed, slip_evidence
from slip_vic_controller.core.output_gate import GateLimits, GateState, largest_step, pass_gate
from slip_vic_controller.core.packing import LawOutcome
from slip_vic_controller.core.path_time import moving, scale_for_error
from slip_vic_controller.core.repulsion import TRIP, joint_repulsion, make_walls, pack_walls, pad_brake, too_fast
from slip_vic_controller.core.rotation import exp_so3
from slip_vic_controller.core.watch_kernel import (
    ABSURD,
    DENORMAL,
    JUMP,
    MOVES,
    NOT_FINITE,
    SAME,
    judge_joints,
    judge_six,
)
from slip_vic_controller.safety_params import LimitParams
from test.core.small_arm import JOINT_NAMES, small_arm_urdf

SEEDS = range(200)
EQUAL = 1e-12
ARM = ArmModel(small_arm_urdf(), "ee", JOINT_NAMES)
WALLS = make_walls(ARM, LimitParams())
ROWS, SPEEDS = pack_walls(WALLS)
LIMITS = GateLimits(ARM.effort_limit, 1000.0, 5_000_000, 1_000_000_000)
N = len(JOINT_NAMES)


def arm_record(rng: np.random.Generator, speed: float) -> ArmTerms:
    attitude = exp_so3(rng.normal(size=3))
    J, twist = rng.normal(size=(6, N)), speed * rng.normal(size=6)
    return ArmTerms.of(np.eye(N), np.zeros(N), J, np.zeros(6), np.zeros(3), attitude, twist)


@pytest.mark.parametrize("seed", SEEDS)
def test_guard_is_walls_and_gate(seed: int) -> None:
    rng = np.random.default_rng(seed)
    middle, half = (ARM.position_upper + ARM.position_lower) / 2, (ARM.position_upper - ARM.position_lower) / 2
    q = middle + half * rng.uniform(-1.05, 1.05, N)
    qd = ARM.velocity_limit * rng.uniform(-1.2, 1.2, N)
    arm = arm_record(rng, 10.0 ** rng.uniform(-2, 1))
    wanted, before = 60.0 * rng.normal(size=N), rng.uniform(-1.0, 1.0, N) * ARM.effort_limit
    if seed % 10 == 0:
        wanted[seed % N] = (math.nan, math.inf, -math.inf, 1e200)[seed // 10 % 4]
    gate, now = GateState(before, 1_000_000), 1_000_000 + int(rng.integers(-1_000_000, 8_000_000))
    torque = wanted
    for more in (joint_repulsion(WALLS, q, qd), pad_brake(WALLS, arm.J, arm.twist)):
        torque = torque if more is None else torque + more
    expected = pass_gate(LIMITS, gate, torque, now)
    out = np.empty(3 * N + 3)
    guard(q, qd, arm.record, 1, wanted, ROWS, SPEEDS, before, largest_step(LIMITS, gate, now), out)
    np.testing.assert_allclose(out[:N], expected.effort, rtol=0.0, atol=1e3 * EQUAL)
    np.testing.assert_array_equal(out[N : 2 * N] > 0.0, expected.clipped | expected.limited)
    np.testing.assert_array_equal(out[2 * N : 3 * N] > 0.0, expected.limited)
    assert (out[-3] > 0.0) == expected.refused
    assert out[-2] == np.count_nonzero(expected.clipped | expected.limited)
    assert out[-1] == np.count_nonzero(expected.limited)
    assert (np.abs(out[:N]) <= ARM.effort_limit).all()
    assert (np.abs(out[:N] - before) <= largest_step(LIMITS, gate, now) * (1.0 + EQUAL)).all()


def test_without_a_wall_the_wanted_effort_passes_to_the_last_bit() -> None:
    q, wanted = (ARM.position_upper + ARM.position_lower) / 2, np.linspace(-3.0, 3.0, N)
    out = np.empty(3 * N + 3)
    guard(q, np.zeros(N), np.zeros(0), 0, wanted, ROWS, SPEEDS, np.zeros(N), 5.0, out)
    np.testing.assert_array_equal(out[:N], wanted)


@pytest.mark.parametrize("seed", SEEDS)
def test_too_fast(seed: int) -> None:
    rng = np.random.default_rng(seed)
    qd, twist = ARM.velocity_limit * rng.uniform(-1.0, 1.0, N), 0.5 * rng.normal(size=6)
    qd[seed % N] *= rng.uniform(0.5, 3.0)
    twist *= rng.uniform(0.5, 6.0)
    index = too_fast_index(qd, ROWS, SPEEDS, np.concatenate((np.zeros(7), twist, np.ones(1))), TRIP)
    words = too_fast(WALLS, JOINT_NAMES, qd, twist)
    assert (index < 0) == (words == "")
    if index >= 0:
        assert (*JOINT_NAMES, "m/s", "rad/s")[index] in words


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("known", [True, False])
def test_watch(seed: int, known: bool) -> None:
    rng = np.random.default_rng(seed)
    arm, dt = arm_record(rng, 0.3), float(rng.choice((0.0, 0.001, 0.004)))
    packed, reference = rng.normal(size=LawOutcome.size(N)), 0.01 * rng.normal(size=24)
    packed[4:7] = np.abs(packed[4:7]) * (0.1, 0.3, 0.01)
    packed[3] = rng.uniform()
    before, axes = rng.normal(size=WATCHED), rng.integers(0, 2, 3).astype(float)
    before[0], before[13] = abs(before[0]), known
    policy = LoadPolicy(np.array((0.0, 0.0, -1.0)), 0.2, 0.3)
    bounds = (0.1, 0.5)
    watching = np.concatenate((policy.down, [policy.memory_s, *bounds, 0.005], axes))
    out = np.empty(WATCHED)
    watch(arm.record, packed, reference, watching, before, dt, out)
    law = LawOutcome(packed, N)
    plane = (arm.rotation * axes) @ arm.rotation.T
    slipping = 1.0 if law.slip_speed > 0.005 else law.gate
    evidence = slip_evidence(
        EvidenceState(before[4:7], before[7:13]) if known else None, arm.twist, law.carried, plane, dt
    )
    expected = (
        fall_speed(policy, before[0], law.object_acceleration, reference[18:], plane, slipping, dt),
        scale_for_error(law.error_linear, law.error_angular, *bounds),
        float(moving(reference[12:18])),
        np.linalg.norm(evidence.velocity),
        *evidence.velocity,
        *evidence.twist,
        1.0,
    )
    np.testing.assert_allclose(out, expected, rtol=0.0, atol=EQUAL)


def six_bits(values: Array, before: Array, linear: float, angular: float) -> int:
    if not np.isfinite(values).all():
        return NOT_FINITE
    absurd = np.linalg.norm(values[:3]) > linear or np.linalg.norm(values[3:]) > angular
    denormal = ((values != 0.0) & (np.abs(values) < np.finfo(float).tiny)).any()
    return ABSURD * absurd | DENORMAL * denormal | SAME * (values.tobytes() == before.tobytes())


ODD = (0.0, -0.0, 1.0, -3.0, 1e-310, -1e-320, 50.0, 1e200, math.nan, math.inf, -math.inf)


@pytest.mark.parametrize("seed", range(500))
def test_six_numbers(seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = rng.choice(ODD[: rng.integers(1, len(ODD) + 1)], 6)
    before = values.copy() if seed % 2 else rng.choice(ODD, 6)
    assert judge_six(values, before, 20.0, 30.0) == six_bits(values, before, 20.0, 30.0)


@pytest.mark.parametrize("seed", range(500))
def test_joint_states(seed: int) -> None:
    rng = np.random.default_rng(seed)
    limits = np.array((np.full(N, -2.0), np.full(N, 2.0), np.full(N, 3.0)))
    q, qd = rng.choice(ODD[: rng.integers(1, len(ODD) + 1)], (2, N))
    q_before, qd_before = (q.copy(), qd.copy()) if seed % 2 else rng.uniform(-1.0, 1.0, (2, N))
    q_before[0] += float(rng.choice((0.0, 0.05, 0.5)))
    found = judge_joints(q, qd, limits, q_before, qd_before, 0.04, 0.01)
    both = np.concatenate((q, qd))
    if not np.isfinite(both).all():
        assert found == NOT_FINITE
        return
    absurd = (q < limits[0]).any() or (q > limits[1]).any() or (np.abs(qd) > limits[2]).any()
    jump = (np.abs(q - q_before) > 0.04 + 0.01 * np.maximum(np.abs(qd), np.abs(qd_before))).any()
    denormal = ((both != 0.0) & (np.abs(both) < np.finfo(float).tiny)).any()
    same = both.tobytes() == np.concatenate((q_before, qd_before)).tobytes()
    moves = (np.abs(qd) > 0.02).any()
    assert found == (ABSURD * absurd | JUMP * jump | DENORMAL * denormal | SAME * same | MOVES * moves)
