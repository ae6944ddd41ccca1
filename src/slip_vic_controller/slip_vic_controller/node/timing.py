"""How the controller's cycles go in time: period, ages of the inputs, compute time, latency, and what went missing."""

from __future__ import annotations

import math
from collections.abc import Sequence

from slip_core.stamps import NS_PER_S

SCALARS = ("period_s", "input_age_s", "wrench_age_s", "slip_age_s", "compute_s", "latency_s", "overruns", "missed")


class CycleTiming:
    """Measures one cycle after the other; the caller gives the times, so that tests can give theirs.

    overruns: cycles that took longer than a period. missed: joint states that were published and never answered,
    lost on the way or overtaken by a newer one.

    Args:
        period_s: control period.
    """

    def __init__(self, period_s: float) -> None:
        self._period_ns = round(period_s * NS_PER_S)
        self._began_ns: int | None = None
        self._last_stamp_ns: int | None = None
        self.overruns = self.missed = 0

    def add(self, began_ns: int, ended_ns: int, wall_ns: int, ledger: Sequence[int]) -> tuple[float, ...]:
        """Take one answered cycle and return its numbers in the order of `SCALARS`.

        Args:
            began_ns: steady time at which the joint state was there.
            ended_ns: steady time at which the effort had been published.
            wall_ns: time of the stamps' clock at the end, with which ages are measured.
            ledger: what the cycle used, as in `CycleResult`; stamps (0, 0) are inputs never seen.
        """
        stamps = [sec * NS_PER_S + nanosec for sec, nanosec in zip(ledger[1::2], ledger[2::2], strict=True)]
        stamp_ns = stamps[0]
        period_s = math.nan if self._began_ns is None else (began_ns - self._began_ns) * 1e-9
        if self._last_stamp_ns is not None:
            self.missed += max(0, round((stamp_ns - self._last_stamp_ns) / self._period_ns) - 1)
        self._began_ns, self._last_stamp_ns = began_ns, stamp_ns
        compute_ns = ended_ns - began_ns
        self.overruns += compute_ns > self._period_ns
        latency_s = (wall_ns - stamp_ns) * 1e-9
        return (
            period_s,
            latency_s - compute_ns * 1e-9,
            _age_ns(stamp_ns, stamps[1::2]) * 1e-9,
            _age_ns(stamp_ns, stamps[2::2]) * 1e-9,
            compute_ns * 1e-9,
            latency_s,
            float(self.overruns),
            float(self.missed),
        )


def _age_ns(stamp_ns: int, samples: Sequence[int]) -> float:
    oldest = min(samples)
    return stamp_ns - oldest if oldest else math.nan
