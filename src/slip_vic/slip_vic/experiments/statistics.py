"""Statistics of counts: bounds of a share, and whether two laws differ in equal worlds."""

from __future__ import annotations

from typing import Final

from scipy.stats import beta, binom

CONFIDENCE: Final = 0.95


def clopper_pearson(count: int, total: int, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """Return the exact bounds of the share of `count` in `total`.

    Implements: C. Clopper, E. Pearson, Biometrika 26 (1934), by quantiles of the beta distribution.
    """
    tail = 0.5 * (1.0 - confidence)
    low = float(beta.ppf(tail, count, total - count + 1)) if count > 0 else 0.0
    high = float(beta.ppf(1.0 - tail, count + 1, total - count)) if count < total else 1.0
    return low, high


def mcnemar(before_alone: int, after_alone: int) -> float:
    """Return the probability, two-sided, of counts at least as different where both chances are the same.

    Args:
        before_alone, after_alone: worlds in which only the run before, and only that after, has the event.

    Implements: McNemar's test, exact: the binomial test of the discordant pairs with one half.
    """
    pairs = before_alone + after_alone
    return min(1.0, 2.0 * float(binom.cdf(min(before_alone, after_alone), pairs, 0.5)))
