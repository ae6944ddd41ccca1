"""How late joint states are answered, by their stamps.

Clocks need not agree: what counts of a joint state is how much more lies between stamp and answer than in the best case
seen so far.
"""

from __future__ import annotations

from slip_core.compiled import part
from slip_core.records import Record, Whole

DRIFT, STEADY_NS, DECAY_S = 5e-4, 5_000_000, 0.5
"""Share by which two clocks may run apart [1], delay below which a growing one may be that [ns], and time in which a
delay that is over is forgotten [s]. Quartz clocks differ by 1e-4 at most."""


class Latency(Record):
    """Of joint states: time from stamp to answer."""

    known: Whole
    least_ns: Whole  # least time from stamp to answer
    last_ns: Whole  # what the last one had above it
    most_ns: Whole  # the most of late


@part
def forget_latency(state: Latency) -> None:
    """Restart."""
    state.known, state.least_ns, state.last_ns, state.most_ns = 0, 0, 0, 0


@part
def measure_latency(state: Latency, now_ns: int, stamp_ns: int, dt_ns: int) -> None:
    """Take in that a joint state of `stamp_ns` is answered at `now_ns`, `dt_ns` after the one before.

    One-way delay above its minimum. A single late answer is the machine's hiccup and does not count: two in a row do.
    While answers are late the least time stays as it is, or a lasting delay would be taken for a clock that drifts.
    """
    took_ns = now_ns - stamp_ns
    least = state.least_ns if state.known != 0 else took_ns
    if state.last_ns < STEADY_NS:
        least += round(DRIFT * dt_ns)
    least = min(least, took_ns)
    last = took_ns - least
    sure = min(last, state.last_ns)
    fading = state.most_ns - round(state.most_ns * min(1.0, dt_ns * 1e-9 / DECAY_S))
    state.known, state.least_ns, state.last_ns, state.most_ns = 1, least, last, max(sure, fading)
