"""How late messages are, by their stamps: joint states before they are answered, slip samples before they are used.

Clocks need not agree: what counts of a joint state is how much more lies between stamp and answer than in the best case
seen so far.
"""

from __future__ import annotations

import math

from slip_core.compiled import part
from slip_core.records import Real, Record, Whole, dtype_of
from slip_vic_controller.safety.validation import SlipQueue

DRIFT = 5e-4  # by which two clocks may run apart; more is not taken back
STEADY_NS = 5_000_000  # below which a growing time from stamp to answer may be clocks that drift
DECAY_S = 0.5  # in which a delay that is over is forgotten
_SLACK = 0.1
"""Part of a cycle by which stamps may be late without counting as one more cycle."""


class Latency(Record):
    """Of joint states: time from stamp to answer."""

    known: Whole
    least_ns: Whole  # least time from stamp to answer
    last_ns: Whole  # what the last one had above it
    most_ns: Whole  # the most of late


LATENCY = dtype_of(Latency)


class SlipLatency(Record):
    """Of slip samples: worst latency and period of late."""

    known: Whole
    newest_ns: Whole  # stamp of the newest one
    latency_ns: Real
    period_ns: Real


SLIP_LATENCY = dtype_of(SlipLatency)


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


@part
def _fading_most(most: float, seen: float, forgets: float) -> float:
    """Return the largest value seen, as far as it is not forgotten."""
    return max(seen, most + forgets * (seen - most))


@part
def measure_slip_latency(state: SlipLatency, now_ns: int, queue: SlipQueue) -> None:
    """Take in the slip samples that came with a cycle: maxima that fade; a late sample does not count as a period."""
    for i in range(queue.count):
        stamp_ns = queue.samples[i].stamp_ns
        if state.known != 0 and stamp_ns == state.newest_ns:
            continue  # the same one again
        passed_ns = stamp_ns - state.newest_ns if state.known != 0 else 0
        forgets = min(max(passed_ns, 0) * 1e-9 / DECAY_S, 1.0)
        state.latency_ns = _fading_most(state.latency_ns, float(now_ns - stamp_ns), forgets)
        if passed_ns > 0:
            state.period_ns = _fading_most(state.period_ns, float(passed_ns), forgets)
        state.newest_ns = max(state.newest_ns, stamp_ns) if state.known != 0 else stamp_ns
        state.known = 1


@part
def whole_cycles(state: SlipLatency, period_ns: int) -> tuple[int, int]:
    """Return for how many cycles a slip sample is held, and how many it is old when it arrives."""
    held = math.ceil(state.period_ns / period_ns - _SLACK)
    late = math.ceil(state.latency_ns / period_ns - _SLACK)
    return max(1, int(held)), max(0, int(late))
