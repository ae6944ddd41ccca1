"""Statistics of counts: bounds of a share."""

from __future__ import annotations

from scipy.stats import binomtest


def clopper_pearson(count: int, total: int, confidence: float = 0.95) -> tuple[float, float]:
    """Return the exact two-sided bounds of the share of `count` in `total`."""
    bounds = binomtest(count, total).proportion_ci(confidence, "exact")
    return float(bounds.low), float(bounds.high)
