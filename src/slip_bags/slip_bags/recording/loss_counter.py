"""Count the messages of a topic that were published and not received, from the publisher's own numbers."""

from __future__ import annotations

from slip_bags.recording.raw_subscription import Arrival


class LossCounter:
    """Exact while one publisher sends at a time; publishers may follow each other, messages may come out of order.

    A publisher numbers its messages 1, 2, 3 ... The messages do not name their publisher, so with two at once
    nothing can be said and `lost` is None. What the first publisher sent before the first received message is
    not lost but `missed_at_start`.
    """

    def __init__(self) -> None:
        self.received = 0
        self._unknown = False
        self._lost_before = 0
        self._missed_at_start: int | None = None
        self._first = self._last = self._count = 0
        self._last_sent_ns = 0

    @property
    def lost(self) -> int | None:
        """Messages lost so far, None where it cannot be known."""
        return None if self._unknown else self._lost_before + self._gaps()

    @property
    def missed_at_start(self) -> int:
        """Messages the first publisher had sent before the first that was received."""
        return max(self._first - 1, 0) if self._missed_at_start is None else self._missed_at_start

    def see_publishers(self, count: int) -> None:
        """Tell how many publishers there are now."""
        self._unknown = self._unknown or count > 1

    def add(self, arrival: Arrival) -> None:
        """Count one received message."""
        self.received += 1
        sequence = arrival.sequence
        if sequence == 0:  # a middleware that does not number
            self._unknown = True
            return
        if self._count and sequence <= self._last and arrival.sent_ns > self._last_sent_ns:
            # A lower number sent later: the next publisher, again from 1.
            self._missed_at_start = self.missed_at_start
            self._lost_before += self._gaps()
            self._count = 0
        if not self._count:
            self._first = self._last = sequence
            self._last_sent_ns = arrival.sent_ns
        self._first = min(self._first, sequence)
        if sequence > self._last:
            self._last, self._last_sent_ns = sequence, arrival.sent_ns
        self._count += 1

    def _gaps(self) -> int:
        return self._last - self._first + 1 - self._count if self._count else 0
