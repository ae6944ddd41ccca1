"""Count the messages of a topic that were published and not received, from the publisher's own numbers."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class LossCounter:
    """Exact while one publisher sends at a time; publishers may follow each other.

    A publisher numbers its messages 1, 2, 3 ..., and they are taken in the order of sending. They do not name their
    publisher, so with two at once nothing can be said and `lost` is None. What the first publisher sent before the
    first received message is not lost.
    """

    received: int = 0
    lost: int | None = 0
    _last: int = 0

    def see_publishers(self, count: int) -> None:
        """Say how many publishers there are now."""
        if count > 1:
            self.lost = None

    def add(self, sequence: int) -> None:
        """Count one received message; number 0 is of a middleware that does not number."""
        self.received += 1
        if sequence == 0:
            self.lost = None
        elif self._last and sequence > self._last and self.lost is not None:
            self.lost += sequence - self._last - 1
        self._last = sequence  # a lower number is of the next publisher, again from 1
