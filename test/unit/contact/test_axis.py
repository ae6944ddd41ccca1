"""One axis of the slip observer against full matrices, sampling and Monte Carlo."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slip_vic_controller.contact.axis import (
    AXIS,
    Axis,
    contradicts,
    correct,
    correct_within,
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


@pytest.mark.parametrize("seed", range(4))
def test_filter_equals_the_referee(seed: int) -> None:
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


def test_zero_velocity_update_is_a_correction() -> None:
    x = START._replace(v=0.0, P_vv=0.0)
    learnt = zero_velocity_update(x, 3e-4, 0.7, 1e-3, 1e-9, 0.0)
    mean, P = referee.predict(*matrices(x), 3e-4, 0.7, 1e-3, 1e-9, 0.0)
    mean, P = referee.correct(mean, P, 0.0, 0.0)
    assert_same(learnt, mean, P)


@pytest.mark.parametrize("v", [0.0, 3e-3, -8e-3])
@pytest.mark.parametrize("band", [1e-3, 5e-3, 2e-2])
def test_dead_band_correction_is_the_posterior(v: float, band: float) -> None:
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


def test_far_outside_band_edge_counts() -> None:
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


@pytest.mark.parametrize(
    ("v", "z", "band", "expected"),
    [
        (0.01, 0.06, 0.0, False),
        (0.01, 0.08, 0.0, True),
        (0.01, -0.06, 0.0, True),
        (0.1, 0.0, 0.03, True),
        (0.1, 0.0, 0.05, False),
        (0.02, 0.0, 0.05, False),
    ],
)
def test_contradiction_starts_beyond_dead_band(v: float, z: float, band: float, expected: bool) -> None:
    """Beyond three of the common deviations of 0.02; a reading of zero with a band is anything within it."""
    assert contradicts(START._replace(v=v), z, 3e-4, 3.0, band) == expected
