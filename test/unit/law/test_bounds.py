"""The bound on k_s against simulated slip loops, and the verdicts on gains."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slip_core.errors import InputError
from slip_vic_controller.law.bounds import (
    check,
    delay_margin,
    held_sample_limit,
    internal_gain_limit,
    judge_gains,
    judge_stiffness,
    slip_gain_limit,
    stiffness_limit,
)

DAMPING = np.array([2.5, 2.5, 2.5, 2.2, 2.2, 2.2])


def roots_inside(k_s_T: float, held: int, delay: int) -> bool:
    """Return whether all roots of z^(q+1) (z - 1) + k_s T ((N - r) z + r) lie inside the unit circle."""
    q, r = divmod(delay, held)
    coefficients = np.zeros(q + 3)
    coefficients[0], coefficients[1] = 1.0, -1.0
    coefficients[-2] += k_s_T * (held - r)
    coefficients[-1] += k_s_T * r
    return bool(max(abs(np.roots(coefficients))) < 1.0)


def test_the_first_root_leaves_at_the_limit() -> None:
    """For every sensor and delay, against the roots themselves."""
    for held in range(1, 21):
        for delay in range(0, 61, 1 if held < 4 else 3):
            limit = held_sample_limit(held, delay)
            assert roots_inside((1.0 - 1e-7) * limit, held, delay), (held, delay)
            assert not roots_inside((1.0 + 1e-7) * limit, held, delay), (held, delay)


def test_many_short_samples_approach_the_continuous_bound() -> None:
    tau = 0.05
    assert abs(slip_gain_limit(1e-5, 0.0, tau) * tau / (math.pi / 2.0) - 1.0) < 1e-3
    assert internal_gain_limit(0.5, 2e4, tau) == pytest.approx(0.38 * 0.5 / (2e4 * tau * tau))


@pytest.mark.parametrize(
    ("damping", "k_s", "word"),
    [(np.full(6, 0.9), 1000.0, "damping"), (DAMPING, 0.8, "Prop. 2")],
    ids=["no lambda_1", "no lambda_2"],
)
def test_gains_without_a_lambda_are_refused(damping, k_s: float, word: str) -> None:
    check(judge_gains(DAMPING, 1000.0))
    with pytest.raises(InputError, match=word):
        check(judge_gains(damping, k_s))


IMPEDANCES = [(5.0, 2.5, 0.4), (400.0, 25.0, 0.4), (500.0, 2.5, 0.4), (4.5, 2.2, 0.3), (1e5, 50.0, 0.4)]


@pytest.mark.parametrize(("K", "D", "M"), IMPEDANCES)
def test_at_the_delay_margin_an_impedance_swings_for_ever(K: float, D: float, M: float) -> None:
    """The quasi-polynomial M s^2 + (D s + K) exp(-s T) has a root on the imaginary axis."""
    delay_s = delay_margin(K, D, M)
    w = np.sqrt(0.5 * ((D / M) ** 2 + np.sqrt((D / M) ** 4 + 4.0 * (K / M) ** 2)))
    assert abs(M * (1j * w) ** 2 + (D * 1j * w + K) * np.exp(-1j * w * delay_s)) < 1e-9 * (K + D * w)
    assert stiffness_limit(D, M, delay_s) == pytest.approx(K, rel=1e-6)


def test_a_stiffness_beyond_the_delay_is_refused_with_its_axis() -> None:
    conditions = judge_stiffness(
        np.array([5.0, 5.0, 1e4, 4.5, 4.5, 4.5]), DAMPING, np.array([0.4, 0.4, 0.4, 0.3, 0.3, 0.3]), 0.005
    )
    assert [one.name for one in conditions if not one.holds] == ["K_D z"]
    assert conditions[2].limit == pytest.approx(stiffness_limit(DAMPING[2], 0.4, 0.005))
