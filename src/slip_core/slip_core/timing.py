"""Timing as data: the spread of the last values of a measured time, and the levels at which it is worth a warning.

The levels are those of ros2_control's controller manager (its documented defaults): errors of
the mean rate and deviation of the rate in Hz, mean and deviation of the execution time in seconds.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from slip_core.arrays import Array

OK, WARN, ERROR = 0, 1, 2
_LEVEL_TEXT = ("within limits", "beyond the warning level", "beyond the error level")


RATE_ERROR_HZ, RATE_DEVIATION_HZ = (5.0, 10.0), (5.0, 10.0)
"""Error of the mean rate of the cycle and its standard deviation: warning and error above [Hz]."""
COMPUTE_S, COMPUTE_DEVIATION_S = (1e-3, 2e-3), (1e-4, 2e-4)
"""Mean compute time of a cycle and its standard deviation: warning and error above [s]."""


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


def rate_level(periods_s: Array, nominal_s: float) -> tuple[int, str]:
    """Return level and text for the rate of a cycle, from its last periods; (k,) [s]."""
    positive = periods_s[periods_s > 0.0]
    if len(positive) < 2:
        return OK, "rate: too few cycles"
    rates = 1.0 / positive
    error, deviation = abs(float(rates.mean()) - 1.0 / nominal_s), float(rates.std())
    level = max(level_of(error, *RATE_ERROR_HZ), level_of(deviation, *RATE_DEVIATION_HZ))
    return level, f"rate {_LEVEL_TEXT[level]}: mean off by {error:.1f} Hz, deviation {deviation:.1f} Hz"


def compute_level(times_s: Array) -> tuple[int, str]:
    """Return level and text for the compute time of a cycle, from its last values; (k,) [s]."""
    if not len(times_s):
        return OK, "compute time: too few cycles"
    mean, deviation = float(times_s.mean()), float(times_s.std())
    level = max(level_of(mean, *COMPUTE_S), level_of(deviation, *COMPUTE_DEVIATION_S))
    return level, f"compute time {_LEVEL_TEXT[level]}: mean {mean * 1e6:.0f} us, deviation {deviation * 1e6:.0f} us"


def level_of(value: float, warn: float, error: float) -> int:
    """Return the level of a value that is better small."""
    return ERROR if value > error else WARN if value > warn else OK
