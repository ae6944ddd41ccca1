"""Tare at rest: means and spreads against numpy's, and what is out of bounds is named."""

from __future__ import annotations

import numpy as np
import pytest

from slip_core.vectors import spatial
from slip_vic_controller.arm.tare import (
    MOVED,
    ROUGH,
    Tare,
    TareConfig,
    add,
    add_slip,
    add_velocities,
    deviation,
    judge_tare,
    leave_to_mass,
    measure_at_rest,
    moved_most,
    start_tare,
    take_biases,
)
from slip_vic_controller.safety.conditions import Reason
from slip_vic_controller.session.words import describe
from slip_vic_controller.sizes import NEVER
from test.support.call import blank, left

N, SAMPLES = 7, 300


def bounds() -> TareConfig:
    config: TareConfig = blank(TareConfig)
    config.joints = N
    config.slip_linear, config.slip_angular, config.force, config.torque = 0.02, 0.2, 0.5, 0.05
    config.mass, config.mass_share = 0.5, 0.5
    return config


def begun() -> Tare:
    state: Tare = blank(Tare)
    start_tare(state, NEVER)
    return state


def take(config: TareConfig, state: Tare, weight: np.ndarray, way: float = 0.0) -> None:
    """Take the biases after SAMPLES ms of rest, in which every joint moves by `way` [rad]."""
    state.begun_ns, state.position[:] = 0, 0.4
    take_biases(config, state, spatial(weight), SAMPLES * 1_000_000, np.full(N, 0.4 + way))


@pytest.mark.parametrize("seed", range(5))
def test_means_and_spreads_match_numpy(seed: int) -> None:
    rng, config, state = np.random.default_rng(seed), bounds(), begun()
    slips = rng.normal(rng.normal(size=6), 0.01, (SAMPLES, 6))
    velocities = rng.normal(rng.normal(size=N), 0.003, (SAMPLES, N))
    for slip, qd in zip(slips, velocities, strict=True):
        add(state.slip, slip, 6)
        add_velocities(config, state, qd)
    np.testing.assert_allclose(state.slip.average[:6], slips.mean(axis=0), rtol=1e-12)
    np.testing.assert_allclose(state.velocity.average[:N], velocities.mean(axis=0), rtol=1e-12)
    spread = [deviation(state.slip, k) for k in range(6)]
    np.testing.assert_allclose(spread, slips.std(axis=0, ddof=1), rtol=1e-9)


@pytest.mark.parametrize(
    ("sensor", "axis", "bias", "words"),
    [
        (0, 1, 0.03, "the slip sensor [m/s] reads 0.03 at rest"),
        (0, 5, -0.3, "the slip sensor [rad/s] reads 0.3 at rest"),
        (1, 0, 0.7, "the wrench sensor [N] reads 0.7 at rest"),
        (1, 4, 0.08, "the wrench sensor [N m] reads 0.08 at rest"),
        (2, 6, -0.03, "the joint velocity [rad/s] reads 0.03 at rest"),
    ],
)
def test_excess_bias_names_sensor(sensor: int, axis: int, bias: float, words: str) -> None:
    config, state = bounds(), begun()
    for _ in range(SAMPLES):
        slip, wrench, qd = samples = np.zeros(6), np.zeros(6), np.zeros(N)
        samples[sensor][axis] = bias
        add_slip(config, state, slip)
        add(state.wrench, wrench, 6)
        add_velocities(config, state, qd)
    assert judge_tare(config, state)
    assert describe(state.found, ()).startswith(words)
    start_tare(state, NEVER)
    assert not judge_tare(config, state)


def test_no_mass_explains_a_wrench_without_gravity() -> None:
    config, state = bounds(), begun()
    add(state.wrench, np.array([0.7, 0.0, 0.0, 0.0, 0.0, 0.0]), 6)
    assert leave_to_mass(config, state, spatial(np.zeros(6))) == 0.0


@pytest.mark.parametrize("seed", range(20))
def test_noise_is_no_bias(seed: int) -> None:
    """With a bias at the bound, and noise ten times as large, some 300 samples accuse no sensor but by chance."""
    rng, config, state = np.random.default_rng(seed), bounds(), begun()
    for _ in range(SAMPLES):
        add(state.slip, np.array([0.01, 0, 0, 0, 0, 0]) + rng.normal(0, 0.1, 6), 6)
        add_velocities(config, state, rng.normal(0, 0.1, N))
    assert not judge_tare(config, state)


@pytest.mark.parametrize(("unit", "words"), [((1000.0, 1.0), "[m/s] reads 0.0"), ((1.0, 57.3), "[rad/s] reads 0.")])
def test_noise_in_another_unit_names_sensor(unit: tuple[float, float], words: str) -> None:
    rng, config, state = np.random.default_rng(0), bounds(), begun()
    for slip in rng.normal(0.0, np.repeat((1e-3, 2e-2), 3), (SAMPLES, 6)):
        add_slip(config, state, slip * np.repeat(unit, 3))
    take(config, state, np.zeros(6))
    assert state.found.reason == Reason.BIASED
    assert words in describe(state.found, ())


@pytest.mark.parametrize("seed", range(20))
def test_outliers_are_neither_bias_nor_noise(seed: int) -> None:
    """Not even where the first sample is one."""
    rng, config, state = np.random.default_rng(seed), bounds(), begun()
    bias = np.array([0.006, -0.004, 0.0, 0.15, 0.0, 0.1])
    for k in range(SAMPLES):
        outlier = rng.choice((-1.0, 1.0), 6) * (0.2, 0.2, 0.2, 5.0, 5.0, 5.0) * (k == 0 or rng.random() < 0.02)
        add_slip(config, state, bias + outlier + 1e-3 * rng.normal(size=6))
    take(config, state, np.zeros(6))
    np.testing.assert_allclose(state.slip.bias[:6], bias, atol=3e-4)
    assert max(deviation(state.slip, k) for k in range(3)) < 1.2e-3


def test_bias_is_removed_noise_is_not() -> None:
    """A mean is a bias from SIGNIFICANT of its standard deviations on; a dead band that reads zero has none."""
    config, state, rng = bounds(), begun(), np.random.default_rng(3)
    for _ in range(SAMPLES):
        noise = np.array([1e-3, 1e-3, 0, 0, 0, 0]) * rng.normal(size=6)
        add(state.slip, np.array([0.01, 0.0, 0, 0, 0, 0.1]) + noise, 6)
        add(state.wrench, np.array([0.1, 0, 0, 0, 0, 0]) + 0.05 * rng.normal(size=6), 6)
        add_velocities(config, state, 3e-3 * rng.normal(size=N))
    take(config, state, np.zeros(6))
    assert state.found.reason == Reason.NONE
    np.testing.assert_allclose(state.slip.bias[:6], [0.01, 0, 0, 0, 0, 0.1], atol=2e-4)
    assert np.count_nonzero(state.slip.bias[:6]) == 2
    np.testing.assert_allclose(state.wrench.bias[:6], [0.1, 0, 0, 0, 0, 0], atol=0.01)
    assert np.count_nonzero(state.wrench.bias[:6]) == 1
    assert not state.velocity.bias.any()


WEIGHT = np.array([0.0, 3.0, -4.0, 0.1, 0.0, 0.0])


@pytest.mark.parametrize(
    ("share", "across", "accused", "says"),
    [
        (0.4, 1.0, Reason.NONE, 0.0), (-0.4, 1.0, Reason.NONE, 0.0), (0.8, 1.0, Reason.WRONG_MASS, 0.9),
        (-2.0, 1.0, Reason.INVERTED_WRENCH, -0.5), (0.8, 10.0, Reason.BIASED, 2.0),
    ],
)  # fmt: skip
def test_wrong_mass_is_no_bias(share: float, across: float, accused: Reason, says: float) -> None:
    """Inside its share the measured mass is used, beyond it is named; force across the weight is a bias."""
    config, state, bias = bounds(), begun(), across * np.array([0.2, 0.08, 0.06, 0, 0, 0])
    for _ in range(SAMPLES):
        add(state.wrench, share * WEIGHT + bias, 6)
    take(config, state, WEIGHT)
    assert (state.found.reason, state.found.which) == (accused, 2 if accused == Reason.BIASED else 0)
    assert state.found.value == pytest.approx(says)
    assert state.mass_share == pytest.approx(share if accused == Reason.NONE else 0.0)
    np.testing.assert_allclose(state.wrench.bias[:6], bias if accused == Reason.NONE else 0.0, atol=1e-12)


def test_motion_ends_the_tare() -> None:
    q, before = np.zeros(N), np.zeros(N)
    q[4] = 1.01 * MOVED
    assert moved_most(N, 0.98 * q, before, MOVED) == -1
    assert moved_most(N, q, before, MOVED) == moved_most(N, -q, before, MOVED) == 4


def test_slow_motion_is_no_bias() -> None:
    """What counts as rest may be faster than a bias that matters."""
    config, rng = bounds(), np.random.default_rng(1)
    for speed, bias in ((0.0, 0.01), (0.006, 0.0), (-0.006, 0.01)):
        state = begun()
        for _ in range(SAMPLES):
            add_velocities(config, state, speed + bias + 1e-3 * rng.normal(size=N))
        take(config, state, np.zeros(6), way=1e-3 * SAMPLES * speed)
        np.testing.assert_allclose(state.velocity.bias[:N], bias, atol=3e-4)


def test_motion_restarts_the_tare() -> None:
    config, state, q, ms = bounds(), begun(), np.zeros(N), 1_000_000
    config.duration_ns = 100 * ms
    over = [measure_at_rest(config, state, t * ms, q, np.zeros(N)) for t in range(60)]
    over += [measure_at_rest(config, state, t * ms, q + 0.01, np.zeros(N)) for t in range(60, 161)]
    assert over.index(True) == 160
    assert state.velocity.count == 101


@pytest.mark.parametrize("speed", [0.0, 0.1])
def test_velocity_noise_found_before_rest(speed: float) -> None:
    """From differences, in which a motion that is slow against the control period cancels."""
    config, state, rng = bounds(), begun(), np.random.default_rng(5)
    for k in range(ROUGH + 1):
        assert not state.rough
        add_velocities(config, state, speed * np.sin(0.01 * k) + 5e-3 * rng.normal(size=N))
    assert state.rough
    spread = [deviation(state.change, j) for j in range(N)]
    np.testing.assert_allclose(spread, np.sqrt(2.0) * 5e-3, rtol=0.3)


def test_nothing_of_before_remains() -> None:
    found = left(start_tare, Tare, 7)
    kept = {"watched", "watched_from", "position", "rough", "change", "last_velocity"}
    assert set(found) - kept == {"begun_ns", "wrench_ns"}
    assert found["begun_ns"] == found["wrench_ns"] == 7
