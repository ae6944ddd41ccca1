"""Latency of joint states and slip samples, with made-up clocks."""

from __future__ import annotations

import pytest

from slip_core.records import new, record
from slip_vic_controller.safety.latency import (
    DECAY_S,
    LATENCY,
    SLIP_LATENCY,
    measure_latency,
    measure_slip_latency,
    whole_cycles,
)
from slip_vic_controller.safety.validation import SLIP_QUEUE
from test.support.call import call

MS = 1_000_000


def run(took_ms, buffer=None, *, offset_ns: int = 123):
    """Return the record after answers that took so long."""
    buffer = new(LATENCY) if buffer is None else buffer.copy()
    state = record(buffer, LATENCY)
    for k, took in enumerate(took_ms):
        now_ns = 1_000 * MS + k * 4 * MS + offset_ns
        stamp_ns = now_ns - round(took * MS) - offset_ns
        call(measure_latency, buffer, now_ns, stamp_ns, 4 * MS)
    return state, buffer


def test_clocks_need_not_agree() -> None:
    state, _ = run([5.0] * 20, offset_ns=10**15)
    assert state.last_ns == 0
    assert state.most_ns == 0


def test_one_late_answer_does_not_count() -> None:
    _, good = run([1.0] * 20)
    assert run([30.0], good)[0].most_ns == 0
    late, _ = run([30.0] * 6, good)
    assert late.most_ns == pytest.approx(29 * MS, rel=1e-2)


def test_lasting_delay_is_remembered() -> None:
    late, buffer = run([30.0] * 2000, run([1.0] * 20)[1])
    assert late.last_ns == pytest.approx(29 * MS, rel=1e-2)
    over, _ = run([1.0] * round(5 * DECAY_S / 0.004), buffer)
    assert over.most_ns < 0.02 * late.most_ns


class Slips:
    """Slip samples that come with cycles of 1 ms."""

    def __init__(self) -> None:
        self.buffer, self.queue = new(SLIP_LATENCY), new(SLIP_QUEUE)

    def take(self, now_ms: float, *stamps_ms: float) -> tuple[int, int]:
        queue = record(self.queue, SLIP_QUEUE)
        queue.count = len(stamps_ms)
        for sample, stamp_ms in zip(queue.samples, stamps_ms, strict=False):
            sample.stamp_ns = round(stamp_ms * MS)
        call(measure_slip_latency, self.buffer, round(now_ms * MS), self.queue)
        return call(whole_cycles, self.buffer, MS)


def test_slip_period_and_age() -> None:
    slips = Slips()
    assert slips.take(0.0, 0.0) == (1, 0)
    assert slips.take(5.0, 5.0) == (5, 0)
    assert slips.take(10.0, 10.0) == (5, 0)
    assert slips.take(17.05, 15.0) == (5, 2)  # a little more than two cycles late counts as two
    assert slips.take(22.2, 20.0) == (5, 3)
    assert slips.take(23.0) == (5, 3)
    assert slips.take(24.0, 20.0) == (5, 3)  # the same one again
    assert slips.take(25.0, 19.0)[0] == 5  # a late sample does not count as a period
    assert slips.take(28.1, 24.0, 28.0)[0] == 5  # 4 and 4 ms, where it was 5
