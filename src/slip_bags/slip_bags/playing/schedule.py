"""When to send each message: an absolute schedule with rate, pause and step. Knows nothing of ROS.

A plain sleep ends 80 us late in the median, 1.4 ms at the 99th percentile on a busy machine; with the last part waited
for actively, messages go out within 35 to 44 us in the median (docs/bags.md).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final

SPIN_NS: Final = 200_000  # a sleep ends up to this late; the rest is waited for actively
SLICE_NS: Final = 20_000_000  # longest sleep, so that keys and signals are answered


class Schedule:
    """Maps the bag's time to the wall clock.

    Every due time is computed from an anchor, never by adding sleeps, so that errors do not add up. A change of
    rate, a pause and a step move the anchor.

    Args:
        start_ns: the bag time that is due at `start`.
        rate: bag seconds per second.
        now: wall clock [ns], monotonic.
        sleep: sleeps for seconds.
    """

    def __init__(
        self,
        start_ns: int,
        rate: float,
        now: Callable[[], int] = time.perf_counter_ns,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._now, self._sleep = now, sleep
        self._bag_anchor, self._wall_anchor = start_ns, now()
        self._rate = rate
        self._paused_at: int | None = None

    @property
    def rate(self) -> float:
        """Bag seconds per second."""
        return self._rate

    @property
    def paused(self) -> bool:
        """Whether time is stopped."""
        return self._paused_at is not None

    def bag_time(self) -> int:
        """The bag time that is due now [ns]."""
        if self._paused_at is not None:
            return self._paused_at
        return self._bag_anchor + round((self._now() - self._wall_anchor) * self._rate)

    def due(self, bag_time_ns: int) -> int:
        """The wall time at which this bag time is due [ns]; only while not paused."""
        return self._wall_anchor + round((bag_time_ns - self._bag_anchor) / self._rate)

    def restart(self, bag_time_ns: int) -> None:
        """Make this bag time due now."""
        self._bag_anchor, self._wall_anchor = bag_time_ns, self._now()
        if self._paused_at is not None:
            self._paused_at = bag_time_ns

    def set_rate(self, rate: float) -> None:
        """Go on from now at another rate."""
        self._bag_anchor, self._wall_anchor, self._rate = self.bag_time(), self._now(), rate

    def pause(self) -> None:
        """Stop time."""
        if self._paused_at is None:
            self._paused_at = self.bag_time()

    def resume(self) -> None:
        """Go on from where time stopped."""
        if self._paused_at is not None:
            self._bag_anchor, self._wall_anchor = self._paused_at, self._now()
            self._paused_at = None

    def wait(self, bag_time_ns: int) -> bool:
        """Wait for at most one slice; return whether this bag time is due. While paused it never is."""
        if self.paused:
            self._sleep(SLICE_NS * 1e-9)
            return False
        remaining = self.due(bag_time_ns) - self._now()
        if remaining > SLICE_NS + SPIN_NS:
            self._sleep(SLICE_NS * 1e-9)
            return False
        if remaining > SPIN_NS:
            self._sleep((remaining - SPIN_NS) * 1e-9)
        due = self.due(bag_time_ns)
        while self._now() < due:
            pass  # no sleep ends that exactly
        return True

    def lateness(self, bag_time_ns: int) -> int:
        """How long ago this bag time was due [ns]."""
        return self._now() - self.due(bag_time_ns)
