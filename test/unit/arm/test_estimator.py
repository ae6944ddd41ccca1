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
from slip_vic_controller.arm.config import (
    LAG_ACCELERATION,
    Noise,
    estimator_config,
    predicted_covariance,
    process,
    sensor_noise,
    steady_state,
)
from slip_vic_controller.arm.disturbance import oppose_disturbance
from slip_vic_controller.arm.estimator import (
    estimate_joints,
    pad_variances,
    remember_input,
    transition,
)
from slip_vic_controller.arm.joint_estimate import (
    ESTIMATOR_CONFIG,
    JOINT_ESTIMATE,
    MAX_LATENCY,
    QUICK,
    Finding,
    Trust,
    clear_findings,
)
from slip_vic_controller.arm.plausibility import compare_measurements
from slip_vic_controller.contact.layouts import MOTION
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.params.arm_params import JointSensorConfig
from slip_vic_controller.params.controller_params import ControllerParams
from test.referees import joint_filter
from test.support.call import call

MS, T, N = 1_000_000, 1e-3, 3
LIMIT = np.array([87.0, 50.0, 12.0])
NOISE = Noise(2e-5, 3e-3, 0.1, 30.0)
EXACT = 1e-12  # the same numbers by two ways
CONVERGED = 1e-6  # the recursion's distance from its limit, relative


def configuration(**values: Any) -> Any:
    """Return the record for N joints; the names of parameters with __ for the dot."""
    given = {"joint_sensor.noise_velocity": 3e-3, **{name.replace("__", "."): v for name, v in values.items()}}
    return record(estimator_config(build(ControllerParams, given, "test"), LIMIT), ESTIMATOR_CONFIG)


class Joints:
    """What runs, sample by sample."""

    def __init__(self, config: Any) -> None:
        self.config, self.state, self.k = config, record(new(JOINT_ESTIMATE), JOINT_ESTIMATE), 0

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


def test_gains_are_the_limit_of_the_full_recursion() -> None:
    for noise, bandwidth in ((NOISE, 0.0), (Noise(1e-4, 0.01, 0.3, 100.0), 0.0), (NOISE, 100.0)):
        steady = steady_state(noise, bandwidth, T)
        predicted, updated, gain = joint_filter.covariances(*noise, bandwidth, T)
        np.testing.assert_allclose(steady.predicted, predicted, rtol=CONVERGED)
        np.testing.assert_allclose(steady.updated, updated, rtol=CONVERGED, atol=1e-18)
        np.testing.assert_allclose(steady.gain, gain, rtol=CONVERGED)
        assert steady.change_variance == pytest.approx(float((predicted - updated)[1, 1]), rel=CONVERGED)


def test_each_sample_is_used_at_its_time_of_measurement() -> None:
    """Against a filter that integrates its inputs between any two times, with latencies of parts of a period."""
    for late_ms in (0.0, 0.4, 1.0, 3.0, 7.3):
        config = configuration(joint_sensor__latency_s=late_ms * 1e-3, joint_sensor__difference=1.0)
        config.significant = math.inf
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


WITH_GAPS = (
    {}, {"joint_sensor__noise_velocity": 1e-3}, {"control_period_s": 0.004}, {"control_period_s": 0.01},
    {"command__interface": "velocity", "control_period_s": 0.008},
)  # fmt: skip


@pytest.mark.parametrize("values", WITH_GAPS)
@pytest.mark.parametrize("quick", [False, True])
@pytest.mark.parametrize("trust", tuple(Trust))
def test_errors_fade_as_well_where_samples_are_missing(values: dict[str, float], quick: bool, trust: Trust) -> None:
    """The error after a sample is a linear map of that before it: its spectral radius, by how many periods pass."""
    config, radii = configuration(**values), []
    config.significant = config.difference = math.inf
    for periods in range(1, 6):
        joints, after = Joints(config), np.zeros((3, N))
        joints.sample(0.0, 0.0)
        state = joints.state
        state.q[:N], state.v[:N], state.d[:N] = np.eye(3) * 1e-3
        state.quick[:N], state.trust[:N] = 2 if quick else 0, trust
        call(estimate_joints, config, state, round(1e9 * periods * config.period), np.zeros(N), np.zeros(N), True)
        after[:] = state.q[:N], state.v[:N], state.d[:N]
        used = slice(1, 3) if trust == Trust.VELOCITY else slice(0, 3)  # velocities do not show where a joint is
        radii.append(float(np.abs(np.linalg.eigvals(1e3 * after[used, used])).max()))
    np.testing.assert_array_less(radii, max(0.95, radii[0] + 0.02))


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
        config = configuration(joint_sensor__latency_s=late * T, joint_sensor__difference=1.0)
        state, q, v = simulate(config, -1.7, late)
        np.testing.assert_allclose(state.d[:N], -1.7, atol=1e-8)
        np.testing.assert_allclose(state.position[:N], q, atol=1e-9)
        np.testing.assert_allclose(state.velocity[:N], v, atol=1e-9)


def test_a_velocity_drive_is_predicted_by_its_bandwidth() -> None:
    config = configuration(joint_sensor__difference=1.0)
    config.bandwidth = 100.0
    config.gain[[Trust.BOTH, QUICK]] = steady_state(NOISE, 100.0, T).gain
    state, q, v = simulate(config, 0.8, bandwidth=100.0)
    np.testing.assert_allclose(state.d[:N], 0.8, atol=1e-8)
    np.testing.assert_allclose([state.position[0], state.velocity[0]], [q, v], atol=1e-9)


def test_covariance_is_that_of_simulated_joints() -> None:
    """Monte Carlo: 4000 joints that move as the model says, measured as the sensor does, estimated with the gains."""
    rng, count = np.random.default_rng(3), 4000
    steady = steady_state(NOISE, 0.0, T)
    F, _ = process(NOISE, 0.0, T)
    white = NOISE.model * F[:, 2] * [1.0, 1.0, 0.0]
    x, estimate = np.zeros((count, 3)), np.zeros((count, 3))
    before = estimate
    for _ in range(600):
        x = x @ F.T + rng.normal(size=(count, 1)) * white
        x[:, 2] += NOISE.drift * math.sqrt(T) * rng.normal(size=count)
        predicted = estimate @ F.T
        z = x[:, :2] + rng.normal(size=(count, 2)) * [NOISE.position, NOISE.velocity]
        before, estimate = predicted, predicted + (z - predicted[:, :2]) @ steady.gain.T
    error = estimate - x
    five_deviations = 5.0 * math.sqrt(2.0 / count)
    np.testing.assert_allclose(np.var(error, axis=0), np.diag(steady.updated), rtol=five_deviations)
    assert np.var((estimate - before)[:, 1]) == pytest.approx(steady.change_variance, rel=five_deviations)
    ahead = predicted_covariance(steady, NOISE, 0.0, T, 2.4e-3)
    assert (np.diag(ahead) > np.diag(steady.updated)).all()


def test_it_filters_velocity_noise() -> None:
    """The variance of the estimate is far below that of the samples."""
    for velocity in (0.01, 0.03):
        steady = steady_state(Noise(2e-5, velocity, 0.1, 30.0), 0.0, T)
        assert math.sqrt(steady.updated[1, 1]) < 0.5 * velocity


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
        if found < 0 and joints.state.finding != Finding.NONE:
            found = k - 200
    return joints.state, found, error


def test_position_and_velocity_that_contradict_each_other_are_found_within_milliseconds() -> None:
    """Wrong sign, stuck, biased: the joint goes on with the other measurement."""
    cases = [
        (lambda q, v, t, m: (q, -v), Finding.VELOCITY_SIGN, Trust.POSITION, 10),
        (lambda q, v, t, m: (q, 0.0), Finding.VELOCITY_STUCK, Trust.POSITION, 15),
        (lambda q, v, t, m: (m.setdefault("q", q), v), Finding.POSITION_STUCK, Trust.VELOCITY, 15),
        (lambda q, v, t, m: (q, v + 0.5), Finding.VELOCITY_BIASED, Trust.POSITION, 15),
    ]
    for change, finding, trust, most in cases:
        state, found, error = moving(change)
        assert (Finding(state.finding), state.joint, Trust(state.trust[1])) == (finding, 1, trust)
        assert 0 <= found <= most
        assert error < 0.8, finding
        assert list(state.trust[[0, 2]]) == [Trust.BOTH, Trust.BOTH]


def test_a_velocity_against_its_position_is_never_what_the_joint_goes_on_with() -> None:
    """From crawling to fast, and at 250 Hz, where some samples before it still count: it was taken for a drift."""
    for period_ms, speed in itertools.product((1, 4), (0.03, 0.3, 3.0)):
        config, rng = configuration(control_period_s=period_ms * T), np.random.default_rng(4)
        state = record(new(JOINT_ESTIMATE), JOINT_ESTIMATE)
        for k in range(1000 // period_ms):
            t, wrong = k * period_ms * T, k >= 300 // period_ms
            v = speed + 2e-3 * rng.normal()
            q = np.array([0.0, speed * t, 0.0]) + 2e-5 * rng.normal(size=N)
            call(estimate_joints, config, state, k * period_ms * MS, q, np.array([0.0, -v if wrong else v, 0.0]), True)
        found = Finding(state.finding), state.joint, Trust(state.trust[1])
        assert found == (Finding.VELOCITY_SIGN, 1, Trust.POSITION), (period_ms, speed)


def test_what_a_joint_does_while_samples_are_missing_contradicts_nothing() -> None:
    """Velocity goes up and down faster than samples arrive: the trapezoids between them were taken for a drift."""
    config, rng = configuration(), np.random.default_rng(7)
    state = record(new(JOINT_ESTIMATE), JOINT_ESTIMATE)
    w = 2.0 * np.pi * 40.0
    for k in range(2000):
        if rng.random() < 0.5:
            continue
        t = k * T
        q, qd = 4.0 * (t - math.sin(w * t) / w), 4.0 * (1.0 - math.cos(w * t))
        call(estimate_joints, config, state, k * MS, np.array([q, 0.0, 0.0]), np.array([qd, 0.0, 0.0]), True)
    assert Finding(state.finding) == Finding.NONE


def test_a_position_that_drifts_at_rest_is_found_and_not_followed() -> None:
    joints, rng = Joints(configuration()), np.random.default_rng(2)
    for k in range(3000):
        drift = 0.03 * max(0, k - 500) * T
        q = 0.4 + 2e-5 * rng.normal(size=N) + np.array([0.0, 0.0, drift])
        joints.sample(q, 3e-3 * rng.normal(size=N))
        joints.act(0.0)
    state = joints.state
    assert (Finding(state.finding), state.joint) == (Finding.POSITION_DRIFTS, 2)
    assert abs(state.position[2] - 0.4) < 0.02
    call(clear_findings, state)
    assert (state.finding, state.joint, state.value, state.limit) == (Finding.NONE, 0, 0.0, 0.0)
    assert not state.trust.any()
    assert not state.jumped_s.any()
    assert not state.beyond_s.any()


def test_noise_and_motion_alone_are_no_fault() -> None:
    for seed in range(5):
        state, found, _ = moving(lambda q, v, t, m: (q, v), steps=2000, seed=seed)
        assert found == -1
        assert (state.finding, state.lag) == (Finding.NONE, 0.0)


def late(lag_s: float, joints: tuple[int, ...], seed: int, steps: int = 1200, **values: Any) -> tuple[Any, float]:
    """Return the state after a motion with velocities behind a low-pass, and the last error of the velocity."""
    sampled, rng, filtered = Joints(configuration(**values)), np.random.default_rng(seed), np.zeros(N)
    speeds = np.array([0.6, -0.4, 0.8])
    for k in range(steps):
        w, t = 4.0, k * T
        q, v, a = speeds * (1.0 - math.cos(w * t)) / w, speeds * math.sin(w * t), speeds * w * math.cos(w * t)
        filtered += (1.0 - math.exp(-T / lag_s)) * (v - filtered)
        measured = np.where(np.isin(np.arange(N), joints), filtered, v) + 1e-3 * rng.normal(size=N)
        _, velocity = sampled.sample(q + 2e-5 * rng.normal(size=N), measured)
        sampled.act(a)
    return sampled.state, float(np.abs(velocity[:N] - v).max())


@pytest.mark.parametrize("lag_s", [0.004, 0.008, 0.016])
def test_velocities_of_a_low_pass_that_nobody_told_are_left_to_the_positions(lag_s: float) -> None:
    """They were called positions that drift: FAULT, and the object was thrown off."""
    for seed in range(3):
        state, error = late(lag_s, (0, 1, 2), seed)
        assert state.finding == Finding.NONE
        assert state.lag == pytest.approx(lag_s, rel=0.25)
        assert error < 0.03
    call(clear_findings, state)
    assert state.lag == 0.0


def test_a_low_pass_that_was_told_is_none_that_nobody_told() -> None:
    state, _ = late(0.008, (0, 1, 2), 1, **{"joint_sensor.velocity_filter_hz": 20.0})
    assert (state.finding, state.lag) == (Finding.NONE, 0.0)


def test_one_late_velocity_is_no_low_pass_of_all() -> None:
    state, _ = late(0.008, (1,), 1)
    assert (state.finding, state.lag) == (Finding.NONE, 0.0)


def opposed(
    d: Any, steps: int, v: float = 0.0, wrench: Any = None, *, fault: bool = False, **values: Any
) -> tuple[Any, np.ndarray]:
    config, state = configuration(**values), record(new(JOINT_ESTIMATE), JOINT_ESTIMATE)
    root = np.random.default_rng(1).normal(size=(N, N))
    M = root @ root.T + np.eye(N)
    torque = np.zeros(N)
    for k in range(steps):
        state.d[:N] = np.linalg.solve(M, d(k * T))
        torque, state.velocity[:N] = np.ones(N), v
        call(oppose_disturbance, config, state, M, wrench(k * T) if wrench else np.zeros(N), T, fault, True, torque)
    return state, torque - 1.0


def test_a_disturbance_inside_its_bound_is_taken_off_whole() -> None:
    effort = np.array([3.0, -2.0, 0.5])
    state, added = opposed(lambda t: effort, 500)
    np.testing.assert_allclose(added, -effort, atol=1e-3)
    assert state.finding == Finding.NONE
    _, added = opposed(lambda t: effort, 5)
    np.testing.assert_allclose(added, -effort * (1.0 - math.exp(-1.0)), atol=1e-9)
    _, added = opposed(lambda t: effort, 5, disturbance__rate=0.1)
    np.testing.assert_allclose(np.abs(added), 5.0 * T * 0.1 * LIMIT, atol=1e-9)
    for fault, settling_ms in ((False, 5.0), (True, 20.0)):  # in FAULT at least five periods
        _, added = opposed(lambda t: effort, 5, fault=fault, control_period_s=0.004)
        np.testing.assert_allclose(added, -effort * (1.0 - math.exp(-5.0 / settling_ms)), atol=1e-9)
    _, added = opposed(lambda t: effort, 500, disturbance__compensate=False)
    assert not added.any()


def test_more_than_the_bound_is_not_taken_off_and_is_found_when_it_lasts() -> None:
    def slow(t: float) -> np.ndarray:
        return np.array([0.0, 0.0, 5.0 * (1.0 - math.exp(-t / 0.5))])

    state, added = opposed(slow, 1500)
    assert added[2] == pytest.approx(-0.25 * 12.0, rel=1e-6)
    assert (Finding(state.finding), state.joint, state.limit) == (Finding.DISTURBED, 2, pytest.approx(3.0))
    assert opposed(slow, 600)[0].finding == Finding.NONE


def test_a_jump_is_a_collision_and_friction_that_reverses_is_none() -> None:
    def step(size: float) -> Any:
        return lambda t: np.array([0.0, size if t > 0.1 else 0.0, 0.0])

    state, _ = opposed(step(20.0), 130)
    assert (Finding(state.finding), state.joint) == (Finding.COLLISION, 1)
    assert state.value > state.limit == pytest.approx(15.0)
    assert opposed(step(10.0), 400)[0].finding == Finding.NONE


def test_a_disturbance_that_jumps_with_the_wrench_is_no_collision_and_not_taken_off() -> None:
    """The joints do not feel a wrench that is measured wrongly, which may jump to and fro before they would."""
    for of_wrench, found in ((-20.0, Finding.NONE), (-2.0, Finding.COLLISION), (20.0, Finding.NONE)):
        state, added = opposed(
            lambda t: np.array([0.0, 20.0 if t > 0.1 else 0.0, 0.0]),
            130,
            wrench=lambda t, size=of_wrench: np.array([0.0, size if 0.1 < t < 0.105 else 0.0, 0.0]),
        )
        assert state.finding == found
        assert (added[1] > -3.0) == (found == Finding.NONE)


def test_a_wrench_that_is_wrong_by_hundreds_of_newtons_for_50_ms_moves_no_joint() -> None:
    """Found by the campaign: the low-pass ran to it, and what was taken off reached its bound while the wrench lied."""

    def lies(t: float) -> np.ndarray:
        return np.array([0.0, 400.0 if 0.1 < t < 0.15 else 0.0, 0.0])

    for steps in (38, 100, 700):
        state, added = opposed(lies, steps, wrench=lambda t: -lies(t))
        assert abs(added[1]) < 2.0, steps
        assert state.finding == Finding.NONE
    assert abs(added[1]) < 0.1


def test_friction_that_turns_round_is_no_collision() -> None:
    """Twice the friction, against the velocity; what jumps along with it, or by more, is something else."""
    friction = {"drive__coulomb": (4.0,)}
    for v, size, found in (
        (-1.0, 20.0, Finding.NONE), (0.01, 20.0, Finding.NONE), (1.0, 20.0, Finding.COLLISION),
        (1.0, -20.0, Finding.NONE), (-1.0, 25.0, Finding.COLLISION),
    ):  # fmt: skip
        state, _ = opposed(lambda t, size=size: np.array([0.0, size if t > 0.1 else 0.0, 0.0]), 130, v, **friction)
        assert state.finding == found


def test_friction_that_reverses_is_followed_fast_and_noise_alone_is_not() -> None:
    """The quick filter: the disturbance is found within 30 ms of a step, and without one the estimate is calm."""
    for step, calm in ((0.0, 0.6), (8.0, None)):
        joints, rng, x = Joints(configuration()), np.random.default_rng(4), np.zeros(3)
        F, _ = joint_filter.matrices(0.0, T)
        largest = 0.0
        for k in range(1500):
            if k == 1400:
                x[2] += step
            joints.sample(x[0] + 2e-5 * rng.normal(), x[1] + 3e-3 * rng.normal())
            largest = max(largest, abs(joints.state.d[0])) if k < 1400 else largest
            joints.act(0.0)
            x = F @ x
            if k == 1430 and step:
                assert joints.state.d[0] == pytest.approx(step, rel=0.3)
        if calm:
            assert largest < calm


def test_variances_of_the_pad_are_those_of_the_matrices() -> None:
    config, rng = configuration(), np.random.default_rng(1)
    J, R = rng.normal(size=(6, N)), np.linalg.qr(rng.normal(size=(3, 3)))[0]
    arm, motion = record(new(ARM), ARM), record(new(MOTION), MOTION)
    arm.J[:, :N], arm.rotation[:] = J, R
    call(pad_variances, config, arm, motion)
    velocity, change = motion.velocity_variance, motion.change_variance
    A = np.kron(np.eye(2), R.T) @ J
    np.testing.assert_allclose(velocity, np.diag(A @ A.T) * config.velocity_variance, rtol=EXACT * 1e3)
    np.testing.assert_allclose(change, np.diag(A @ A.T) * config.change_variance, rtol=EXACT * 1e3)


def test_without_configured_noise_it_is_off_and_a_latency_is_bounded() -> None:
    assert configuration(joint_sensor__noise_velocity=0.0).on == 0
    with pytest.raises(InputError, match=r"joint_sensor\.latency_s"):
        configuration(joint_sensor__latency_s=(MAX_LATENCY + 1) * T)


@pytest.mark.parametrize(
    ("bandwidth", "late", "repeated", "old"), [(40.0, 8, 8, 4), (100.0, 4, 2, 2), (0.0, 0, 1, 0), (0.0, 3, 1, 1)]
)
@pytest.mark.parametrize("lost", [0.0, 0.3, 0.7])
def test_a_slow_sensor_of_a_late_drive_is_followed_between_its_samples(
    bandwidth: float, late: int, repeated: int, old: int, lost: float
) -> None:
    """A joint that the model describes: it is known in every period, though samples are repeated, and some are lost.

    Where one is lost there is no new command either: the drive keeps the last one.
    """
    interface = "velocity" if bandwidth > 0.0 else "effort"
    config = configuration(
        command__interface=interface, drive__bandwidth=bandwidth or 1.0, drive__delay_s=late * T,
        joint_sensor__rate_hz=1.0 / (repeated * T), joint_sensor__latency_s=old * T,
    )  # fmt: skip
    rng, joints = np.random.default_rng(5), Joints(config)
    commands, q, v = [0.0] * (late + 1), [0.0] * (old + 1), [0.0] * (old + 1)
    joints.sample(0.0, 0.0)
    F, G = joint_filter.matrices(bandwidth, T)
    measured, errors, answers = (0.0, 0.0), [], True
    for k in range(1, 1600):
        u = 0.5 * math.sin(0.02 * k)
        if answers:
            joints.act(u)
        commands.append(u if answers else commands[-1])
        x = F[:2, :2] @ np.array([q[-1], v[-1]]) + G[:2] * commands[-1 - late]
        q.append(float(x[0]))
        v.append(float(x[1]))
        if k % repeated == 0:
            measured = q[-1 - old], v[-1 - old]
        answers = rng.random() >= lost
        if answers:
            found = joints.sample(*measured)
            errors.append((abs(found[0][0] - q[-1]), abs(found[1][0] - v[-1])))
        else:
            joints.k += 1
    assert np.max(errors[len(errors) // 2 :], axis=0) == pytest.approx(0.0, abs=1e-9)
    assert joints.state.finding == Finding.NONE


@pytest.mark.parametrize("wild", [1e6, -1e85, math.inf, math.nan])
def test_an_estimate_that_runs_away_begins_again_at_the_measurement(wild: float) -> None:
    """The model's forces grow with the square of velocity, so its input can do so within some cycles."""
    joints, speed = Joints(configuration(joint_sensor__latency_s=2e-3)), 16.0
    for k in range(40):
        joints.act(wild if k >= 20 else 0.0)
        at = 0.3 + speed * k * T
        q, qd = joints.sample(at, speed)
        assert np.abs(q - at).max() < 0.5
        assert np.abs(qd - speed).max() < 20.0
    assert np.isfinite(joints.state.d).all()


def test_a_sensor_is_as_noisy_as_counts_filter_and_its_own_noise_make_it() -> None:
    """Against simulated counts of a joint at constant speed; the filter's lag stands for what acceleration adds."""
    period, quantum, filter_hz, own = 1e-3, 5e-4, 200.0, 2e-2
    filter_s = 1.0 / (2.0 * math.pi * filter_hz)
    sensor = JointSensorConfig(quantum_position=quantum, velocity_filter_hz=filter_hz, noise_velocity=own)
    position, velocity = sensor_noise(sensor, period)
    rng, weight = np.random.default_rng(3), 1.0 - math.exp(-period / filter_s)
    error = rng.uniform(-0.5, 0.5, 200_000) * quantum
    filtered, level = [], 0.0
    for change in np.diff(error) / period:
        level += weight * (change - level)
        filtered.append(level)
    lag = LAG_ACCELERATION * filter_s
    assert position == pytest.approx(np.std(error), rel=0.01)
    assert velocity == pytest.approx(math.hypot(own, float(np.std(filtered)), lag), rel=0.02)


def compared(
    lately: tuple[float, float], before: tuple[float, float], now: tuple[float, float]
) -> tuple[Finding, Trust]:
    """Return what is found of joint 1 by one sample, and what is trusted.

    lately: ways that positions and velocities have shown; before, now: position and velocity of the two samples.
    """
    config, state = configuration(), record(new(JOINT_ESTIMATE), JOINT_ESTIMATE)
    state.moved[1], state.swept[1] = 3.0 * config.difference, 0.0
    state.moved_lately[1], state.swept_lately[1] = lately
    state.measured_position[1], state.measured_velocity[1] = before
    q, qd = np.zeros(N), np.zeros(N)
    q[1], qd[1] = now
    call(compare_measurements, config, state, T, q, qd)
    return Finding(state.finding), Trust(state.trust[1])


def test_a_sign_that_was_wrong_lately_is_one_though_the_newest_sample_rests() -> None:
    assert compared((0.01, -0.009), (0.0, 0.0), (0.0, 1e-6)) == (Finding.VELOCITY_SIGN, Trust.POSITION)
    assert compared((0.01, -0.002), (0.0, 0.0), (0.0, 1e-6)) == (Finding.POSITION_DRIFTS, Trust.VELOCITY)


def test_a_velocity_that_repeats_itself_once_while_the_joint_moves_is_stuck() -> None:
    assert compared((0.01, 0.001), (0.0, 0.02), (1e-3, 0.02)) == (Finding.VELOCITY_STUCK, Trust.POSITION)
    assert compared((0.01, 0.001), (0.0, 0.02), (1e-3, 0.021)) == (Finding.POSITION_DRIFTS, Trust.VELOCITY)
