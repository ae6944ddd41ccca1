"""Whether a number that is sampled now and then grows: a slope that single jumps do not bend."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

WARM_UP = 0.2  # share of the run that does not count: caches, pools and buffers fill
LONGEST_WARM_UP_S = 600.0
SECONDS_PER_HOUR = 3600.0
MIB = 2.0**20


@dataclass(frozen=True, slots=True)
class Sample:
    """A process at one moment: time since the start [s], resident memory [bytes], open files, threads."""

    t: float
    rss: int
    files: int
    threads: int


@dataclass(frozen=True, slots=True)
class Growth:
    """A number over a run: first, last and most; slope per hour, and by how much it rose along that slope."""

    first: float
    last: float
    most: float
    per_hour: float
    rise: float


@dataclass(frozen=True, slots=True)
class Limits:
    """What counts as growth: a slope per hour, together with a rise over the run that is no page more or less."""

    memory_mib_per_hour: float = 4.0
    memory_rise_mib: float = 1.0
    files_rise: float = 1.0


@dataclass(frozen=True, slots=True)
class ProcessGrowth:
    """Memory [MiB], open files and threads of one process."""

    memory_mib: Growth
    files: Growth
    threads: Growth

    def grows(self, limits: Limits) -> list[str]:
        """Return what grows, in words; empty where nothing does."""
        found = []
        memory = self.memory_mib
        if memory.per_hour > limits.memory_mib_per_hour and memory.rise > limits.memory_rise_mib:
            found.append(f"memory by {memory.per_hour:.1f} MiB per hour")
        for name, growth in (("open files", self.files), ("threads", self.threads)):
            if growth.rise >= limits.files_rise:
                found.append(f"{name} by {growth.per_hour:.1f} per hour")
        return found

    def as_dict(self) -> dict[str, Any]:
        """Return it as JSON can hold it."""
        return asdict(self)


def growth_of(samples: Sequence[Sample]) -> ProcessGrowth:
    """Return how a process grew after its warm-up; at least two samples."""
    times = np.array([sample.t for sample in samples])
    after = times >= min(WARM_UP * times[-1], LONGEST_WARM_UP_S)

    def growth(values: list[float]) -> Growth:
        kept, when = np.array(values)[after], times[after]
        slope = robust_slope(when, kept)
        rise = slope * float(when[-1] - when[0])
        return Growth(float(kept[0]), float(kept[-1]), float(kept.max()), slope * SECONDS_PER_HOUR, rise)

    return ProcessGrowth(
        growth([sample.rss / MIB for sample in samples]),
        growth([float(sample.files) for sample in samples]),
        growth([float(sample.threads) for sample in samples]),
    )


def robust_slope(times: Sequence[float] | np.ndarray, values: Sequence[float] | np.ndarray) -> float:
    """Return the median of the slopes between all pairs (Theil and Sen); 0 where there is no pair.

    A jump, as of a buffer that is made once, does not bend it as it bends a least-squares line.
    """
    from scipy.stats import theilslopes  # takes more than a second to import

    return float(theilslopes(values, times).slope) if np.ptp(times) > 0.0 else 0.0
