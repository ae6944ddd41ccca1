"""Bounds of shares and tests of equal worlds, against closed forms."""

import pytest

from slip_vic.experiments.statistics import clopper_pearson
from test.campaigns.frozen.compare import mcnemar


def test_no_event_in_300_worlds() -> None:
    low, high = clopper_pearson(0, 300)
    assert low == 0.0
    assert high == pytest.approx(1.0 - 0.025 ** (1 / 300))  # closed form of no event


def test_six_more_losses_are_the_least_significant() -> None:
    assert mcnemar(0, 0) == mcnemar(3, 3) == 1.0
    assert mcnemar(0, 5) == pytest.approx(2 / 2**5)
    assert mcnemar(0, 6) == pytest.approx(2 / 2**6)
    assert mcnemar(0, 6) < 0.05 < mcnemar(0, 5)
