"""The joint state estimator against matrices, the full Riccati recursion, closed forms and simulated joints."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest

from slip_core.errors import InputError
from slip_core.params import build
from slip_core.records import new, record
from slip_vic_controller.arm.estimator import (
    BIAS,
    ESTIMATOR_CONFIG,
    MAX_LATENCY,
    JointEstimate,
    Trust,
    clear_findings,
    contradiction,
    estimate_joints,
    oppose_disturbance,
    remember_input,
    start_estimate,
    transition,
)
from slip_vic_controller.config.joints import MODEL_NOISE, estimator_config, steady_state
from slip_vic_controller.contact.observer import MOTION
from slip_vic_controller.cycle.sensing import pad_variances
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.safety.conditions import NOTHING, Reason, read_why
from slip_vic_controller.sizes import MAX_JOINTS
from test.referees import joint_filter
from test.support.call import blank, call, left

MS, T, N = 1_000_000, 1e-3, 3
LIMIT = np.array([87.0, 50.0, 12.0])
EXACT = 1e-12  # the same numbers by two ways
CONVERGED = 1e-6  # the recursion's distance from its limit, relative


def configuration(**values: Any) -> Any:
    """Return the record for N joints; the names of parameters with __ for the dot."""
    given = {"joint_sensor.noise_velocity": 3e-3, **{name.replace("__", "."): v for name, v in values.items()}}
    return record(estimator_config(build(ControllerParams, given, "test"), LIMIT), ESTIMATOR_CONFIG)


class Joints:
    """What runs, sample by sample."""

    def __init__(self, config: Any) -> None:
        self.config, self.state, self.k = config, blank(JointEstimate), 0

    def act(self, u: Any) -> None:
        call(remember_input, self.config, self.state, np.broadcast_to(np.asarray(u, float), (N,)))

    def sample(self, q: Any, qd: Any) -> tuple[np.ndarray, np.ndarray]:
        q, qd = (np.broadcast_to(np.asarray(x, float), (N,)).copy() for x in (q, qd))
        call(estimate_joints, self.config, self.state, self.k * MS, q, qd, True)
        self.k += 1
        return self.state.position[:N].copy(), self.state.velocity[:N].copy()


def test_transition_is_the_matrix_exponential() -> None:
    for bandwidth in (0.0, 40.0, 300.0):
        for dt in (1e-4, 1e-3, 0.02):
            F, G = joint_filter.matrices(bandwidth, dt)
            s = call(transition, bandwidth, dt)
            np.testing.assert_allclose([s.qv, s.qd, s.vv, s.vd], [F[0, 1], F[0, 2], F[1, 1], F[1, 2]], rtol=1e-9)
            np.testing.assert_allclose([s.qu, s.vu], G[:2], rtol=1e-9)


def test_gains_are_the_recursion_limit() -> None:
    config = configuration()
    for drift, config.bandwidth, config.noise, velocity in ((30.0, 0.0, 2e-5, 3e-3), (30.0, 100.0, 1e-4, 0.01)):
        updated, predicted = call(steady_state, config, velocity, drift, Trust.BOTH)
        expected = joint_filter.covariances(config.noise, velocity, MODEL_NOISE, drift, config.bandwidth, T)
        np.testing.assert_allclose(predicted, expected[0], rtol=CONVERGED)
        np.testing.assert_allclose(updated, expected[1], rtol=CONVERGED, atol=1e-18)
        np.testing.assert_allclose(config.gain[Trust.BOTH], expected[2], rtol=CONVERGED)


def test_samples_used_at_measurement_time() -> None:
    """Against a filter that integrates its inputs between any two times."""
    for late_ms in (0.0, 1.0, 3.0, 7.0):
        config = configuration(joint_sensor__latency_s=late_ms * 1e-3)
        config.gate = config.difference = math.inf
        rng, joints = np.random.default_rng(1), Joints(config)
        plain = joint_filter.Delayed(np.array(config.gain[Trust.BOTH]), 0.0, T, late_ms * 1e-3, 0.3, 0.1)
        joints.sample(0.3, 0.1)
        plain.x, plain.at = np.array([0.3, 0.1, 0.0]), -late_ms * 1e-3
        for k in range(1, 60):
            u, q, v = rng.normal(), 0.3 + 1e-3 * rng.normal(), 0.1 + 1e-2 * rng.normal()
            joints.act(u)
            plain.act((k - 1) * T, u)
            found = joints.sample(q, v)
            expected = plain.sample(k * T, q, v)
            np.testing.assert_allclose([found[0][1], found[1][1]], expected[:2], atol=1e-9)


def simulate(config: Any, d: float, late: int = 0, bandwidth: float = 0.0, steps: int = 4000) -> tuple[Any, Any, Any]:
    """Return the estimate, and the true q and v, of a joint with a constant disturbance and an input that swings."""
    joints, F_G = Joints(config), joint_filter.matrices(bandwidth, T)
    x, past = np.array([0.2, 0.0, d]), []
    for k in range(steps):
        past.append(x.copy())
        old = past[max(0, k - late)]
        joints.sample(old[0], old[1])
        u = math.sin(0.01 * k)
        joints.act(u)
        x = F_G[0] @ x + F_G[1] * u
    return joints.state, *past[-1][:2]


def test_a_constant_disturbance_is_found_exactly() -> None:
    for late in (0, 4):
        config = configuration(joint_sensor__latency_s=late * T)
        state, q, v = simulate(config, -1.7, late)
        np.testing.assert_allclose(state.d[:N], -1.7, atol=1e-8)
        np.testing.assert_allclose(state.position[:N], q, atol=1e-9)
        np.testing.assert_allclose(state.velocity[:N], v, atol=1e-9)


def moving(change: Any, steps: int = 400, seed: int = 1) -> tuple[Any, int, float]:
    """Return the state, the sample after the change at which joint 1 is found, and the velocity error from then on."""
    joints, rng, found, error = Joints(configuration()), np.random.default_rng(seed), -1, 0.0
    memory: dict[str, float] = {}
    for k in range(200 + steps):
        t = k * T
        q, v, a = 0.3 * math.sin(2.0 * t), 0.6 * math.cos(2.0 * t), -1.2 * math.sin(2.0 * t)
        z = q + 2e-5 * rng.normal(), v + 3e-3 * rng.normal()
        positions, velocities = np.full(N, z[0]), np.full(N, z[1])
        if k >= 200:
            positions[1], velocities[1] = change(z[0], z[1], t, memory)
        _, velocity = joints.sample(positions, velocities)
        joints.act(a)
        if found >= 0:
            error = max(error, abs(velocity[1] - v))
        if found < 0 and joints.state.found.reason != Reason.NONE:
            found = k - 200
    return joints.state, found, error


def test_contradiction_found_within_milliseconds() -> None:
    """Wrong sign, stuck, biased: the joint goes on with the other measurement."""
    cases = [
        (lambda q, v, t, m: (q, -v), Reason.VELOCITY, Trust.POSITION, 10),
        (lambda q, v, t, m: (q, 0.0), Reason.VELOCITY, Trust.POSITION, 15),
        (lambda q, v, t, m: (m.setdefault("q", q), v), Reason.POSITION, Trust.VELOCITY, 15),
        (lambda q, v, t, m: (q, v + 0.5), Reason.VELOCITY, Trust.POSITION, 15),
    ]
    for change, finding, trust, most in cases:
        state, found, error = moving(change)
        assert (Reason(state.found.reason), state.found.which, Trust(state.trust[1])) == (finding, 1, trust)
        assert 0 <= found <= most
        assert error < 0.8, finding
        assert list(state.trust[[0, 2]]) == [Trust.BOTH, Trust.BOTH]


def test_inverted_velocity_is_not_trusted() -> None:
    """From crawling to fast, and at 250 Hz, where some samples before it still count: it was taken for a drift."""
    for period_ms, speed in itertools.product((1, 4), (0.03, 0.3, 3.0)):
        config, rng = configuration(control_period_s=period_ms * T), np.random.default_rng(4)
        state = blank(JointEstimate)
        for k in range(1000 // period_ms):
            t, wrong = k * period_ms * T, k >= 300 // period_ms
            v = speed + 2e-3 * rng.normal()
            q = np.array([0.0, speed * t, 0.0]) + 2e-5 * rng.normal(size=N)
            call(estimate_joints, config, state, k * period_ms * MS, q, np.array([0.0, -v if wrong else v, 0.0]), True)
        found = Reason(state.found.reason), state.found.which, Trust(state.trust[1])
        assert found == (Reason.VELOCITY, 1, Trust.POSITION), (period_ms, speed)


@pytest.mark.parametrize(("moved", "reversals"), [(0.0, 5), (1e-4, 0)])
def test_a_sample_after_one_that_repeats_ends_the_count_of_reversals(moved: float, reversals: int) -> None:
    joints = Joints(configuration())
    for k in range(3):
        joints.sample([0.1, 1e-5 * k, 0.0], 0.01)  # a sample in which all repeat is none
    joints.state.reversals[0] = 5
    joints.sample([0.1 + moved, 1.0, 0.0], 0.01)
    assert joints.state.reversals[0] == reversals


def test_drifting_position_is_not_followed() -> None:
    joints, rng = Joints(configuration()), np.random.default_rng(2)
    for k in range(3000):
        drift = 0.03 * max(0, k - 500) * T
        q = 0.4 + 2e-5 * rng.normal(size=N) + np.array([0.0, 0.0, drift])
        joints.sample(q, 3e-3 * rng.normal(size=N))
        joints.act(0.0)
    state = joints.state
    assert (Reason(state.found.reason), state.found.which) == (Reason.POSITION, 2)
    assert abs(state.position[2] - 0.4) < 0.02
    call(clear_findings, state)
    assert call(read_why, state.found) == NOTHING
    assert not state.trust.any()
    assert not state.jumped_s.any()
    assert not state.beyond_s.any()
    assert not state.parity.any()


def test_only_what_was_not_measured_stays_where_the_model_has_it() -> None:
    config, state, q = configuration(), blank(JointEstimate), np.full(N, 0.2)
    state.position[:], state.measured_position[:N], state.unmeasured[1] = 0.5, q, 3
    call(start_estimate, config, state, 7, q, np.zeros(N))
    np.testing.assert_array_equal(state.q[:N], [0.2, 0.5, 0.2])


@pytest.mark.parametrize("lie", [0.05, -0.1])
def test_slow_lie_is_found(lie: float) -> None:
    """As Page's sum has it: after difference / (lie - BIAS), however slowly; the disturbance swallows it meanwhile."""
    state, found, _ = moving(lambda q, v, t, m: (q, v + lie), steps=1200)
    why = Reason(state.found.reason), state.found.which, Trust(state.trust[1])
    assert why == (Reason.VELOCITY, 1, Trust.POSITION)
    assert found * T == pytest.approx(configuration().difference / (abs(lie) - BIAS), rel=0.3)


@pytest.mark.parametrize("late_s", [0.004, 0.009])
def test_filtered_velocity_is_no_fault(late_s: float) -> None:
    """Its parity is what it gained times its delay, which is borne up to MEAN_S."""

    def filtered(q: float, v: float, t: float, memory: dict[str, float]) -> tuple[float, float]:
        memory["v"] = memory.get("v", v) + (1.0 - math.exp(-T / late_s)) * (v - memory.get("v", v))
        return q, memory["v"]

    assert moving(filtered, steps=4000)[1] == -1


def test_noise_and_a_bias_that_may_last_are_no_fault() -> None:
    for seed, bias in itertools.product(range(5), (0.0, 0.8 * BIAS)):
        state, found, _ = moving(lambda q, v, t, m, bias=bias: (q, v + bias), steps=4000, seed=seed)
        assert found == -1
        assert state.found.reason == Reason.NONE


def test_a_late_velocity_explains_its_change() -> None:
    config, state = configuration(), blank(JointEstimate)
    for side, v in ((0, 0.5), (1, -0.5)):
        state.parity[:], state.measured_velocity[0] = 0.0, v
        state.parity[side, 0] = 1.0
        assert call(contradiction, config, state, 0) == pytest.approx(1.0 - 0.5 * config.late)


def opposed(d: Any, steps: int, v: float = 0.0, wrench: Any = None, **values: Any) -> tuple[Any, np.ndarray]:
    config, state = configuration(**values), blank(JointEstimate)
    root = np.random.default_rng(1).normal(size=(N, N))
    M = root @ root.T + np.eye(N)
    torque = np.zeros(N)
    for k in range(steps):
        state.d[:N] = np.linalg.solve(M, d(k * T))
        torque, state.velocity[:N] = np.ones(N), v
        call(oppose_disturbance, config, state, M, wrench(k * T) if wrench else np.zeros(N), T, True, torque)
    return state, torque - 1.0


def test_bounded_disturbance_is_removed() -> None:
    effort = np.array([3.0, -2.0, 0.5])
    state, added = opposed(lambda t: effort, 500)
    np.testing.assert_allclose(added, -effort, atol=1e-3)
    assert state.found.reason == Reason.NONE
    _, added = opposed(lambda t: effort, 5)
    np.testing.assert_allclose(added, -effort * (1.0 - math.exp(-1.0)), atol=1e-9)
    _, added = opposed(lambda t: effort, 5, control_period_s=0.004)  # five periods
    np.testing.assert_allclose(added, -effort * (1.0 - math.exp(-5.0 / 20.0)), atol=1e-9)


def test_excess_disturbance_is_a_finding() -> None:
    def slow(t: float) -> np.ndarray:
        return np.array([0.0, 0.0, 5.0 * (1.0 - math.exp(-t / 0.5))])

    state, added = opposed(slow, 1500)
    assert added[2] == pytest.approx(-0.25 * 12.0, rel=1e-6)
    found = Reason(state.found.reason), state.found.which, state.found.limit
    assert found == (Reason.DISTURBED, 2, pytest.approx(3.0))
    assert opposed(slow, 600)[0].found.reason == Reason.NONE


def test_jump_is_a_collision() -> None:
    def step(size: float) -> Any:
        return lambda t: np.array([0.0, size if t > 0.1 else 0.0, 0.0])

    state, _ = opposed(step(20.0), 130)
    assert (Reason(state.found.reason), state.found.which) == (Reason.COLLISION, 1)
    assert state.found.value > state.found.limit == pytest.approx(15.0)
    assert opposed(step(10.0), 400)[0].found.reason == Reason.NONE
    state, _ = opposed(step(20.0), 130, drive__coulomb=(1.0,))  # friction that turns round
    assert state.found.limit == pytest.approx(15.0 + 2.0)


def test_pad_variances_match_matrices() -> None:
    config, rng = configuration(), np.random.default_rng(1)
    J, R = rng.normal(size=(6, N)), np.linalg.qr(rng.normal(size=(3, 3)))[0]
    arm, motion = record(new(ARM), ARM), record(new(MOTION), MOTION)
    arm.J[:, :N], arm.rotation[:] = J, R
    call(pad_variances, config, arm, motion)
    velocity, change = motion.velocity_variance, motion.change_variance
    A = np.kron(np.eye(2), R.T) @ J
    np.testing.assert_allclose(velocity, np.diag(A @ A.T) * config.velocity_variance, rtol=EXACT * 1e3)
    np.testing.assert_allclose(change, np.diag(A @ A.T) * config.change_variance, rtol=EXACT * 1e3)


def test_off_without_noise() -> None:
    assert configuration(joint_sensor__noise_velocity=0.0).on == 0
    with pytest.raises(InputError, match=r"joint_sensor\.latency_s"):
        configuration(joint_sensor__latency_s=(MAX_LATENCY + 1) * T)


def test_nothing_of_before_remains_but_the_disturbance() -> None:
    config, q = configuration(), np.linspace(0.1, 0.2, MAX_JOINTS)
    config.joints = MAX_JOINTS
    found = left(start_estimate, config, JointEstimate, 7, q, 2.0 * q)
    of_q, of_v = ("q", "position", "measured_position"), ("v", "velocity", "measured_velocity")
    begun = dict.fromkeys(of_q, q) | dict.fromkeys(of_v, 2.0 * q) | {"began": [2.0 * q] * 2, "started": 1}
    for name, value in (begun | {"stamp_ns": 7, "renewed_ns": 7}).items():
        np.testing.assert_array_equal(found.pop(name), value)
    assert set(found) == {
        "d", "reversals", "trust", "alone", "effort", "slow_effort", "slow_wrench", "wrench_jump", "taken_off",
        "jumped_s", "beyond_s", "found",
    }  # fmt: skip
