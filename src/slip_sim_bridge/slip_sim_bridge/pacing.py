"""Real time for the bridge: absolute deadlines, and what a tick owes and gets.

A tick is due one period after the one before it, counted from the start, so that lateness never adds up. It ends
when the next one is due and its command is there, and otherwise one period after it began, at least half a period
after its state went out: the controller has its time also in a tick that this machine began late or worked at for
too long, and late ticks catch up at the controller's speed.
"""

from __future__ import annotations

import math


class Pacer:
    """The schedule of one real-time run; all times are seconds of one steady clock.

    Args:
        period_s: control period.
        start_s: when tick 0 is due, and begins.
    """

    def __init__(self, period_s: float, start_s: float) -> None:
        self._period = period_s
        self._start = start_s
        self._began = self._published = start_s
        self._latency = math.nan
        self.ticks = self.fresh = self.overruns = 0

    def published(self, now_s: float) -> None:
        """The state of this tick goes out."""
        self._published = now_s

    def answered(self, now_s: float) -> None:
        """The command of this tick is there."""
        if not self.is_answered:
            self._latency = now_s - self._published

    @property
    def is_answered(self) -> bool:
        """Whether the command of this tick is there."""
        return not math.isnan(self._latency)

    @property
    def fresh_share(self) -> float:
        """Share of the ticks so far that got their own command in time."""
        return self.fresh / self.ticks if self.ticks else math.nan

    def left(self, now_s: float) -> float:
        """Return how long this tick still waits [s]; not positive where it is over."""
        due = self._start + (self.ticks + 1) * self._period
        if not self.is_answered:
            working = min(self._published - self._began, 0.5 * self._period)
            due = max(due, self._published + self._period - working)
        return due - now_s

    def end(self, now_s: float) -> float:
        """This tick is over and the next one begins; return from state to command [s], NaN without one in time."""
        self.ticks += 1
        self.fresh += self.is_answered
        latency, self._began, self._latency = self._latency, now_s, math.nan
        self.overruns += now_s - self._start - self.ticks * self._period >= self._period
        return latency
