"""Timing as data: the spread of the last values of a measured time."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

OK, WARN, ERROR = 0, 1, 2
"""Levels of /diagnostics."""


def spread(measured: Iterable[float]) -> dict[str, float]:
    """Return mean, standard deviation, percentiles 50, 99, 99.9 and maximum of what is finite; NaN without a value."""
    values = np.array(tuple(measured), dtype=np.float64)
    values = values[np.isfinite(values)]
    if not len(values):
        return dict.fromkeys(("mean", "deviation", "p50", "p99", "p999", "max"), float("nan"))
    p50, p99, p999 = np.percentile(values, (50.0, 99.0, 99.9)).tolist()
    return {
        "mean": float(values.mean()),
        "deviation": float(values.std()),
        "p50": p50,
        "p99": p99,
        "p999": p999,
        "max": float(values.max()),
    }
