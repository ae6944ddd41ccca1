"""Whether memory, open files or threads of a process grow: a slope that single jumps do not bend."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
import psutil

WARM_UP: Final = 0.2
"""Share of the run that does not count: caches, pools and buffers fill."""
LONGEST_WARM_UP_S: Final = 600.0
MEMORY_MIB_PER_HOUR, MEMORY_RISE_MIB, COUNT_RISE = 8.0, 1.0, 1.0
"""Growth is a slope per hour together with a rise over the run; of files and threads the rise alone. A recorder keeps
the index of its bag until the end: 1.5 KiB for each chunk, one a second, are 5 MiB per hour."""
QUANTITIES: Final = ("memory [MiB]", "open files", "threads")

Sample = tuple[float, float, float, float]
"""Time since the start [s], resident memory [MiB], open files, threads."""


class Growth(NamedTuple):
    """A quantity after the warm-up: first, last, slope per hour, and its rise along that slope."""

    first: float
    last: float
    per_hour: float
    rise: float


def sample_process(process: psutil.Process, t: float) -> Sample:
    """Sample a process, t [s] after the start."""
    with process.oneshot():
        return t, process.memory_info().rss / 2.0**20, float(process.num_fds()), float(process.num_threads())


def growth_of(samples: Sequence[Sample]) -> dict[str, Growth]:
    """Return how each quantity of a process grew after its warm-up; at least two samples."""
    times, *columns = np.array(samples).T
    after = times >= min(WARM_UP * times[-1], LONGEST_WARM_UP_S)
    found = {}
    for name, column in zip(QUANTITIES, columns, strict=True):
        slope = robust_slope(times[after], column[after])
        rise = slope * float(times[-1] - times[after][0])
        found[name] = Growth(float(column[after][0]), float(column[-1]), 3600.0 * slope, rise)
    return found


def grows(growth: Mapping[str, Growth]) -> list[str]:
    """Return the quantities that grow, with their slopes."""
    memory, *counts = QUANTITIES
    steep = growth[memory].per_hour > MEMORY_MIB_PER_HOUR and growth[memory].rise > MEMORY_RISE_MIB
    found = [memory] if steep else []
    found += [name for name in counts if growth[name].rise >= COUNT_RISE]
    return [f"{name} by {growth[name].per_hour:.1f} per hour" for name in found]


def robust_slope(times: Sequence[float] | np.ndarray, values: Sequence[float] | np.ndarray) -> float:
    """Return the median of the slopes between all pairs (Theil and Sen); 0 where there is no pair.

    A jump, as of a buffer that is made once, does not bend it as it bends a least-squares line.
    """
    from scipy.stats import theilslopes  # takes more than a second to import

    return float(theilslopes(values, times).slope) if np.ptp(times) > 0.0 else 0.0
