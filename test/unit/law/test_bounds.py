"""The bound on k_s against simulated slip loops, and the verdicts on gains."""

from __future__ import annotations

import math
from collections import deque

import numpy as np
import pytest

from slip_core.errors import InputError
from slip_vic_controller.law.bounds import (
    check,
    delay_margin,
    held_sample_limit,
    judge_gains,
    judge_stiffness,
    slip_gain_limit,
    stiffness_limit,
)

NEAR = 0.01  # how far below and above the bound the simulation is tried
DAMPING = np.array([2.5, 2.5, 2.5, 2.2, 2.2, 2.2])


def amplitude_ratio(k_s_T: float, held: int, delay: int, ticks: int = 60_000) -> float:
    """Simulate v[k+1] = v[k] - k_s T v(sample), samples every `held` ticks, `delay` old; late over early amplitude."""
    v, acting, under_way = 1.0, 0.0, deque()
    sizes = []
    for k in range(ticks):
        if k % held == 0:
            under_way.append((k + delay, v))
        while under_way and under_way[0][0] <= k:
            acting = under_way.popleft()[1]
        v -= k_s_T * acting
        sizes.append(abs(v))
        if not 1e-200 < max(sizes[-max(4 * (held + delay), 4) :]) < 1e200:
            break
    early, late = sizes[len(sizes) // 4 : len(sizes) // 2], sizes[3 * len(sizes) // 4 :]
    return max(late) / max(early)


@pytest.mark.parametrize(("held", "delay"), [(1, 0), (1, 2), (1, 5), (9, 0), (9, 10), (2, 5), (17, 33), (3, 3)])
def test_the_loop_is_stable_up_to_the_limit(held: int, delay: int) -> None:
    limit = held_sample_limit(held, delay)
    if held == 1:
        assert abs(limit - 2.0 * math.cos(delay * math.pi / (2 * delay + 1))) < 1e-12
    assert amplitude_ratio((1.0 - NEAR) * limit, held, delay) < 0.5
    assert amplitude_ratio((1.0 + NEAR) * limit, held, delay) > 2.0


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


@pytest.mark.parametrize(("K", "D", "M"), IMPEDANCES)
@pytest.mark.parametrize(("share", "decays"), [(0.9, True), (1.1, False)])
def test_an_error_decays_below_the_delay_margin_and_grows_above(
    K: float, D: float, M: float, share: float, decays: bool
) -> None:
    delay_s, steps = share * delay_margin(K, D, M), 400
    dt = delay_s / steps
    e, v, past = 1.0, 0.0, deque([(1.0, 0.0)] * steps)
    most = []
    for _ in range(60):  # delays, in which a crossover of pi/2 per delay turns many times
        peak = 0.0
        for _ in range(steps):
            late_e, late_v = past.popleft()
            v -= dt * (K * late_e + D * late_v) / M
            e += dt * v
            past.append((e, v))
            peak = max(peak, abs(e))
        most.append(peak)
    assert (max(most[-20:]) < max(most[20:40])) == decays


def test_a_stiffness_beyond_the_delay_is_refused_with_its_axis() -> None:
    conditions = judge_stiffness(
        np.array([5.0, 5.0, 1e4, 4.5, 4.5, 4.5]), DAMPING, np.array([0.4, 0.4, 0.4, 0.3, 0.3, 0.3]), 0.005
    )
    assert [one.name for one in conditions if not one.holds] == ["K_D z"]
    assert conditions[2].limit == pytest.approx(stiffness_limit(DAMPING[2], 0.4, 0.005))
