"""One axis of the slip observer against full matrices, sampling and Monte Carlo."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slip_vic_controller.contact.axis import Axis, correct, correct_within, excess, forget_errors, predict, put_velocity
from test.referees import kalman_referee as referee
from test.support.call import blank

REFEREE = 1e-9  # the same arithmetic in another order


def axis(v=0.01, b=0.1, c=-0.05, P_vv=1e-4, P_vb=0.0, P_vc=0.0, P_bb=0.04, P_bc=0.0, P_cc=0.04):
    x = blank(Axis)
    x.v, x.b, x.c, x.P_vv, x.P_vb, x.P_vc, x.P_bb, x.P_bc, x.P_cc = v, b, c, P_vv, P_vb, P_vc, P_bb, P_bc, P_cc
    return x


def matrices(x) -> tuple[np.ndarray, np.ndarray]:
    P = np.array([[x.P_vv, x.P_vb, x.P_vc], [x.P_vb, x.P_bb, x.P_bc], [x.P_vc, x.P_bc, x.P_cc]])
    return np.array([x.v, x.b, x.c]), P


def assert_same(x, mean: np.ndarray, P: np.ndarray) -> None:
    got, got_P = matrices(x)
    np.testing.assert_allclose(got, mean, rtol=REFEREE, atol=REFEREE * 1e-3)
    np.testing.assert_allclose(got_P, P, rtol=1e-7, atol=REFEREE * 1e-4)


@pytest.mark.parametrize("seed", range(4))
def test_filter_equals_the_referee(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x = axis()
    mean, P = matrices(x)
    for _ in range(300):
        step, f, dt = rng.normal(scale=1e-3), rng.normal(scale=2.0), rng.uniform(5e-4, 2e-3)
        predict(x, step, f, dt, 1e-9, 1e-8)
        mean, P = referee.predict(mean, P, step, f, dt, 1e-9, 1e-8)
        if rng.random() < 0.2:
            z, R = rng.normal(scale=1e-2), 10.0 ** rng.uniform(-8, -4)
            correct(x, z, R)
            mean, P = referee.correct(mean, P, z, R)
        assert_same(x, mean, P)


def test_exact_velocity_is_taken_whole() -> None:
    """Stick: the velocity is zero, and what was predicted of it is the errors' doing."""
    x = axis(v=0.0, P_vv=0.0)
    predict(x, 3e-4, 0.7, 1e-3, 1e-9, 0.0)
    correct(x, 0.0, 0.0)
    assert (x.v, x.P_vv, x.P_vb, x.P_vc) == (0.0, 0.0, 0.0, 0.0)
    assert x.P_bb < 0.04
    assert x.b > 0.1


def test_forgotten_numbers_are_uncorrelated() -> None:
    x = axis(P_vb=1e-4, P_vc=1e-4, P_bc=1e-3)
    put_velocity(x, 0.3, 1e-6)
    forget_errors(x, 1.0, 2.0)
    mean, P = matrices(x)
    np.testing.assert_array_equal(mean, (0.3, 0.1, -0.05))
    np.testing.assert_array_equal(P, np.diag((1e-6, 1.0, 2.0)))


@pytest.mark.parametrize("v", [0.0, 3e-3, -8e-3])
@pytest.mark.parametrize("band", [1e-3, 5e-3, 2e-2])
def test_dead_band_correction_is_the_posterior(v: float, band: float) -> None:
    x, R = axis(v, 0.1, 0.0, 9e-6, 1e-6, 0.0, 1e-4, 0.0, 1e-4), 4e-6
    rng = np.random.default_rng(1)
    samples = rng.multivariate_normal([x.v, x.b], [[x.P_vv, x.P_vb], [x.P_vb, x.P_bb]], 400_000)
    kept = samples[np.abs(samples[:, 0] + rng.normal(scale=math.sqrt(R), size=len(samples))) < band]
    got = axis(*x.item())
    correct_within(got, band, R)
    error = 6.0 / math.sqrt(len(kept))  # six standard errors of the Monte Carlo mean
    assert abs(got.v - kept[:, 0].mean()) < error * math.sqrt(x.P_vv)
    assert abs(got.b - kept[:, 1].mean()) < error * math.sqrt(x.P_bb)
    assert abs(got.P_vv / kept[:, 0].var() - 1.0) < 3.0 * error
    assert abs(got.P_bb / kept[:, 1].var() - 1.0) < 3.0 * error
    assert_same(got, *referee.correct_within(*matrices(x), band, R))


def test_far_outside_band_edge_counts() -> None:
    x, y = (axis(0.5, 0.0, 0.0, 1e-6, 0.0, 0.0, 1e-4, 0.0, 1e-4) for _ in range(2))
    correct_within(x, 5e-3, 1e-6)
    correct(y, 5e-3, 1e-6)
    assert x.tobytes() == y.tobytes()


def pulled(deviations: float, R: float, limit: float) -> float:
    """Return by how much a measurement so many deviations away moves the estimate."""
    x = axis()
    z = x.v + deviations * math.sqrt(x.P_vv + R)
    correct(x, z, R + excess(x, z, R, limit) / limit**2)
    return float(x.v - 0.01)


def test_outliers_pull_with_bounded_force() -> None:
    R, limit = 1e-5, 3.0
    near = pulled(limit, R, limit)
    for far in (5.0, 50.0, 5000.0):
        assert 0.0 < pulled(far, R, limit) < near * 1.001
    assert pulled(2.9, R, limit) == pytest.approx(near * 2.9 / limit)
    assert excess(axis(), 0.01 + 2.9 * math.sqrt(1.1e-4), R, limit) == 0.0
