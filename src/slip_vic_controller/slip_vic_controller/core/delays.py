"""How late and how far apart the slip samples really come, from their stamps; and the k_s that this allows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from slip_core.types import SlipSample
from slip_vic_controller.core.bounds import held_sample_limit

FORGET = 0.01
"""Share of a past worst case that each new sample forgets: a hundred good samples make up for a bad one."""


class Delays(NamedTuple):
    """Worst latency and period of late [ns]; newest_ns: stamp of the newest sample, None before the first."""

    latency_ns: float = 0.0
    period_ns: float = 0.0
    newest_ns: int | None = None


def measure_delays(delays: Delays, now_ns: int, samples: Sequence[SlipSample]) -> Delays:
    """Take in the samples that came with the tick of time `now_ns`.

    Implements: ours: a maximum that fades; a late sample does not count as a period.
    """
    latency, period, newest = delays
    for sample in samples:
        stamp_ns = sample.stamp_ns
        if stamp_ns == newest:
            continue  # the same one again
        change = now_ns - stamp_ns - latency
        latency += change if change > 0.0 else FORGET * change
        if newest is not None and stamp_ns > newest:
            change = stamp_ns - newest - period
            period += change if change > 0.0 else FORGET * change
        newest = stamp_ns if newest is None or stamp_ns > newest else newest
    return Delays(latency, period, newest)


def stable_slip_gain(delays: Delays, control_period_ns: int) -> float:
    """Return the k_s [1/s] at which the slip loop with these delays stops decaying.

    Implements: ours: `slip_gain_limit` with measured delays, in whole ticks.
    """
    held = max(1, -int(-(delays.period_ns - _SLACK * control_period_ns) // control_period_ns))
    late = max(0, -int(-(delays.latency_ns - _SLACK * control_period_ns) // control_period_ns))
    return held_sample_limit(held, late) / (1e-9 * control_period_ns)


_SLACK = 0.1
"""Part of a tick by which stamps may be late without counting as one more tick."""
