"""Bounds of shares and tests of equal worlds, against scipy's own and printed values."""

import pytest
from scipy.stats import binomtest

from slip_vic.experiments.statistics import clopper_pearson, mcnemar


@pytest.mark.parametrize(("count", "total"), [(0, 60), (1, 300), (17, 300), (59, 60), (60, 60)])
def test_bounds_equal_those_of_scipy(count: int, total: int) -> None:
    wanted = binomtest(count, total).proportion_ci(0.95, "exact")
    assert clopper_pearson(count, total) == pytest.approx((wanted.low, wanted.high), abs=1e-12)


def test_no_event_in_300_worlds() -> None:
    low, high = clopper_pearson(0, 300)
    assert low == 0.0
    assert high == pytest.approx(1.0 - 0.025 ** (1 / 300))  # closed form of no event


@pytest.mark.parametrize(("before", "after"), [(0, 0), (3, 3), (1, 9), (9, 1), (0, 6), (25, 40)])
def test_mcnemar_is_the_binomial_test(before: int, after: int) -> None:
    pairs = before + after
    wanted = binomtest(before, pairs).pvalue if pairs else 1.0
    assert mcnemar(before, after) == pytest.approx(wanted, abs=1e-12)


def test_six_more_losses_are_the_least_significant() -> None:
    assert mcnemar(0, 5) == pytest.approx(2 / 2**5)
    assert mcnemar(0, 6) == pytest.approx(2 / 2**6)
    assert mcnemar(0, 6) < 0.05 < mcnemar(0, 5)
