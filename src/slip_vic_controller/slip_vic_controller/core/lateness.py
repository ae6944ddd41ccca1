"""How late joint states are answered, by their stamps: what was on its way long is old, however recently it came.

Clocks need not agree: what counts is how much more lies between stamp and answer than in the best case seen so far.
"""

from __future__ import annotations

from typing import NamedTuple

DRIFT = 5e-4  # by which two clocks may run apart; more is not taken back
STEADY_NS = 5_000_000  # below which a growing time from stamp to answer may be clocks that drift
DECAY_S = 0.5  # in which a delay that is over is forgotten


class Lateness(NamedTuple):
    """Least time from stamp to answer, what the last one had above it, the most of late, how many in a row; [ns]."""

    least_ns: int | None = None
    last_ns: int = 0
    most_ns: int = 0
    in_a_row: int = 0


def answered(before: Lateness, now_ns: int, stamp_ns: int, dt_ns: int, late_ns: int) -> Lateness:
    """Return the memory after a joint state of `stamp_ns` is answered at `now_ns`, `dt_ns` after the one before.

    A single late answer is the machine's hiccup and does not count: two in a row do. While answers are late the least
    time stays as it is, or a lasting delay would be taken for a clock that drifts.

    Args:
        before: memory of the answer before.
        now_ns: the controller's clock.
        stamp_ns: of the joint state.
        dt_ns: of the controller's clock.
        late_ns: what is too late for the law; 0 = nothing.

    Implements: ours: one-way delay above its minimum.
    """
    took_ns = now_ns - stamp_ns
    least = took_ns if before.least_ns is None else before.least_ns
    if before.last_ns < STEADY_NS:
        least += round(DRIFT * dt_ns)
    least = min(least, took_ns)
    last = took_ns - least
    sure = min(last, before.last_ns)
    fading = before.most_ns - round(before.most_ns * min(1.0, dt_ns * 1e-9 / DECAY_S))
    return Lateness(least, last, max(sure, fading), before.in_a_row + 1 if 0 < late_ns <= sure else 0)
