"""One axis of the slip observer against full matrices, sampling and Monte Carlo."""

from __future__ import annotations

import itertools
import math

import numpy as np

from slip_vic_controller.contact.axis import (
    AXIS,
    Axis,
    contradicts,
    correct,
    correct_within,
    noisy_zero_velocity_update,
    predict,
    robust_variance,
    zero_velocity_update,
)
from test.referees import kalman_referee as referee

REFEREE = 1e-9  # the same arithmetic in another order
START = Axis(0.01, 0.1, -0.05, 1e-4, 0.0, 0.0, 0.04, 0.0, 0.04)


def matrices(x: Axis) -> tuple[np.ndarray, np.ndarray]:
    P = np.array([[x.P_vv, x.P_vb, x.P_vc], [x.P_vb, x.P_bb, x.P_bc], [x.P_vc, x.P_bc, x.P_cc]])
    return np.array([x.v, x.b, x.c]), P


def assert_same(x: Axis, mean: np.ndarray, P: np.ndarray) -> None:
    got, got_P = matrices(x)
    np.testing.assert_allclose(got, mean, rtol=REFEREE, atol=REFEREE * 1e-3)
    np.testing.assert_allclose(got_P, P, rtol=1e-7, atol=REFEREE * 1e-4)


def test_filter_equals_the_referee() -> None:
    for seed in range(10):
        rng = np.random.default_rng(seed)
        x = START
        mean, P = matrices(x)
        for _ in range(300):
            step, f, dt = rng.normal(scale=1e-3), rng.normal(scale=2.0), rng.uniform(5e-4, 2e-3)
            x = predict(x, step, f, dt, 1e-9, 1e-8)
            mean, P = referee.predict(mean, P, step, f, dt, 1e-9, 1e-8)
            if rng.random() < 0.2:
                z, R = rng.normal(scale=1e-2), 10.0 ** rng.uniform(-8, -4)
                x = correct(x, z, R)
                mean, P = referee.correct(mean, P, z, R)
            assert_same(x, mean, P)


def test_zero_velocity_update_is_a_prediction_corrected_by_rest() -> None:
    x = START._replace(v=0.0, P_vv=0.0)
    learnt = zero_velocity_update(x, 3e-4, 0.7, 1e-3, 1e-9, 0.0)
    mean, P = referee.predict(*matrices(x), 3e-4, 0.7, 1e-3, 1e-9, 0.0)
    mean, P = referee.correct(mean, P, 0.0, 0.0)
    assert_same(learnt, mean, P)


def test_noise_of_the_pads_velocity_hides_no_model_error_for_long() -> None:
    """Noise that comes back does not add up: what is learnt of b lies within its own deviation, and that falls fast."""
    sigma, dt, b, ticks = 1e-3, 1e-3, 0.02, 400
    errors, deviation = [], 0.0
    for seed in range(200):
        noise = np.random.default_rng(seed).normal(scale=sigma, size=ticks + 1)
        x = white = Axis(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.04, 0.0, 1e-12)
        for before, after in itertools.pairwise(noise):
            step = after - before + b * dt
            x = noisy_zero_velocity_update(x, step, 0.0, dt, 1e-14, 0.0, sigma**2, 1.0)
            white = zero_velocity_update(white, step, 0.0, dt, 1e-14 + 2.0 * sigma**2, 0.0)
        deviation = math.sqrt(x.P_bb)
        errors.append(x.b - b)
        assert deviation < 0.2 * math.sqrt(white.P_bb)
    assert 0.5 < np.std(errors) / deviation < 1.5


def test_truncated_correction_is_the_posterior_of_a_reading_in_the_dead_band() -> None:
    for v in (0.0, 3e-3, -8e-3):
        for band in (1e-3, 5e-3, 2e-2):
            x, R = Axis(v, 0.1, 0.0, 9e-6, 1e-6, 0.0, 1e-4, 0.0, 1e-4), 4e-6
            rng = np.random.default_rng(1)
            samples = rng.multivariate_normal([x.v, x.b], [[x.P_vv, x.P_vb], [x.P_vb, x.P_bb]], 400_000)
            kept = samples[np.abs(samples[:, 0] + rng.normal(scale=math.sqrt(R), size=len(samples))) < band]
            got = correct_within(x, band, R)
            error = 6.0 / math.sqrt(len(kept))  # six standard errors of the Monte Carlo mean
            assert abs(got.v - kept[:, 0].mean()) < error * math.sqrt(x.P_vv)
            assert abs(got.b - kept[:, 1].mean()) < error * math.sqrt(x.P_bb)
            assert abs(got.P_vv / kept[:, 0].var() - 1.0) < 3.0 * error
            assert abs(got.P_bb / kept[:, 1].var() - 1.0) < 3.0 * error
            assert_same(got, *referee.correct_within(*matrices(x), band, R))


def test_far_outside_the_dead_band_the_edge_counts() -> None:
    x = Axis(0.5, 0.0, 0.0, 1e-6, 0.0, 0.0, 1e-4, 0.0, 1e-4)
    assert correct_within(x, 5e-3, 1e-6) == correct(x, 5e-3, 1e-6)


def test_outliers_pull_with_bounded_force() -> None:
    x, R, limit = START, 1e-5, 3.0
    deviation = math.sqrt(x.P_vv + R)
    near = correct(x, x.v + limit * deviation, robust_variance(x, x.v + limit * deviation, R, limit)).v - x.v
    for far in (5.0, 50.0, 5000.0):
        z = x.v + far * deviation
        moved = correct(x, z, robust_variance(x, z, R, limit)).v - x.v
        assert 0.0 < moved < near * 1.001
    assert robust_variance(x, x.v + 2.9 * deviation, R, limit) == R


def test_record_holds_the_numbers() -> None:
    assert AXIS.names == Axis._fields
    assert AXIS.itemsize == 8 * len(Axis._fields)


def test_a_reading_contradicts_from_the_edge_of_its_dead_band_on() -> None:
    """Beyond three of their common deviations of 0.02; a reading of zero with a band is anything within it."""
    R, limit = 3e-4, 3.0
    for v, z, band, expected in (
        (0.01, 0.06, 0.0, False), (0.01, 0.08, 0.0, True), (0.01, -0.06, 0.0, True), (0.1, 0.0, 0.0, True),
        (0.1, 0.0, 0.03, True), (0.1, 0.0, 0.05, False), (0.02, 0.0, 0.05, False),
    ):  # fmt: skip
        assert contradicts(START._replace(v=v), z, R, limit, band) == expected, (v, z, band)
