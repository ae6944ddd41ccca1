"""Statistics of counts: bounds of a share, and whether two laws differ in equal worlds."""

from __future__ import annotations

from scipy.stats import binomtest


def clopper_pearson(count: int, total: int, confidence: float = 0.95) -> tuple[float, float]:
    """Return the exact two-sided bounds of the share of `count` in `total`."""
    bounds = binomtest(count, total).proportion_ci(confidence, "exact")
    return float(bounds.low), float(bounds.high)


def mcnemar(before_alone: int, after_alone: int) -> float:
    """Return the probability, two-sided, of counts at least as different where both chances are the same.

    Args:
        before_alone, after_alone: worlds in which only the run before, and only that after, has the event.

    Implements: McNemar's test, exact: the binomial test of the discordant pairs with one half.
    """
    pairs = before_alone + after_alone
    return float(binomtest(before_alone, pairs).pvalue) if pairs else 1.0
