"""Latency of joint states, with made-up clocks."""

from __future__ import annotations

import pytest

from slip_core.records import dtype_of, new, record
from slip_vic_controller.safety.latency import (
    DECAY_S,
    Latency,
    measure_latency,
)
from test.support.call import call

MS = 1_000_000


def run(took_ms, buffer=None, *, offset_ns: int = 123):
    """Return the record after answers that took so long."""
    buffer = new(dtype_of(Latency)) if buffer is None else buffer.copy()
    state = record(buffer, dtype_of(Latency))
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
