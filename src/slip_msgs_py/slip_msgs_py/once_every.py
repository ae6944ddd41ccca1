"""When what is published about once a second is due, spread over the second."""

from __future__ import annotations


class OnceEvery:
    """Due at the first question, and then in every period of a clock once.

    What happens once a second costs a few tenths of a millisecond each: together in one cycle of a real-time run they
    make the next one late, so each has its own phase.

    Args:
        period_ns: length of a period.
        phase: share of the period after which it begins, in [0, 1).
    """

    def __init__(self, period_ns: int, phase: float) -> None:
        self._period_ns, self._shift_ns = period_ns, round((1.0 - phase) * period_ns)
        self._last: int | None = None

    def due(self, now_ns: int) -> bool:
        """Return whether this is the first question in its period; also where the clock was set back."""
        number = (now_ns + self._shift_ns) // self._period_ns
        if number == self._last:
            return False
        self._last = number
        return True
