"""Timing as data: the spread of the last values of a measured time."""

from __future__ import annotations

from collections import deque

import numpy as np

from slip_core.arrays import Array

OK, WARN, ERROR = 0, 1, 2
"""Levels of /diagnostics."""


class Window:
    """The last `size` values of one quantity."""

    def __init__(self, size: int) -> None:
        self._values: deque[float] = deque(maxlen=size)

    def add(self, value: float) -> None:
        """Take one value; the oldest falls out of a full window."""
        self._values.append(value)

    def values(self) -> Array:
        """Return the finite values of the window, oldest first; (k,)."""
        values = np.array(self._values, dtype=np.float64)
        return values[np.isfinite(values)]


def spread(values: Array) -> dict[str, float]:
    """Return mean, standard deviation, percentiles 50, 99, 99.9 and maximum; (k,), NaN where there is no value."""
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
