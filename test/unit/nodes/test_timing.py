"""Pacing and timing numbers against times that the test makes up; no clock is read here."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_sim_bridge.pacing import Pacer
from slip_vic_controller.node import timing
from slip_vic_controller.node.timing import CycleTiming

T = 1e-3
ROUNDING_S = 1e-9  # sums of a few thousand double periods differ by less than this
NS = 1_000_000_000


def named(names: tuple[str, ...], numbers: tuple[float, ...]) -> dict[str, float]:
    return dict(zip(names, numbers, strict=True))


class Run:
    """Plays ticks on a made-up clock: how long the step takes, and when the command comes after publication."""

    def __init__(self, start_s: float = 100.0) -> None:
        self.now = start_s
        self.pacer = Pacer(T, start_s)

    def tick(self, step_s: float, answer_s: float | None) -> float:
        self.now += step_s
        self.pacer.published(self.now)
        if answer_s is not None and answer_s < self.pacer.left(self.now):
            self.now += answer_s
            self.pacer.answered(self.now)
        self.now += max(0.0, self.pacer.left(self.now))
        return self.pacer.end(self.now)


def test_punctual_ticks_are_fresh() -> None:
    run = Run()
    for k in range(1, 2001):
        assert run.tick(2e-4, 3e-4) == pytest.approx(3e-4, abs=ROUNDING_S)
        assert run.now == pytest.approx(100.0 + k * T, abs=ROUNDING_S)
    assert run.pacer.fresh_share == 1.0
    assert run.pacer.overruns == 0


@given(st.lists(st.floats(0.0, 5e-3), min_size=1, max_size=50))
def test_tick_never_ends_early(steps: list[float]) -> None:
    run = Run()
    for k, step in enumerate(steps, start=1):
        run.tick(step, 1e-4)
        assert run.now >= 100.0 + k * T - ROUNDING_S


# -- the controller's numbers -------------------------------------------------------------------------


def ledger(cycle: int, *stamps_ns: int) -> tuple[int, ...]:
    return (cycle, *(part for stamp_ns in stamps_ns for part in divmod(stamp_ns, NS)))


def test_cycle_times() -> None:
    cycles = CycleTiming(T)
    stamp_ns = 5 * NS
    first = named(timing.SCALARS, cycles.add(1_000, 201_000, stamp_ns + 500_000, ledger(0, stamp_ns, stamp_ns, 1)))
    assert math.isnan(first["period_s"])
    assert first["compute_s"] == pytest.approx(2e-4)
    assert first["latency_s"] == pytest.approx(5e-4)
    assert first["input_age_s"] == pytest.approx(3e-4)
    assert first["wrench_age_s"] == 0.0
    assert first["slip_age_s"] == pytest.approx(5.0)
    stamp_ns += 1_000_000
    second = named(
        timing.SCALARS, cycles.add(1_101_000, 1_301_000, stamp_ns, ledger(1, stamp_ns, stamp_ns - 2_000_000, stamp_ns))
    )
    assert second["period_s"] == pytest.approx(1.1e-3)
    assert second["wrench_age_s"] == pytest.approx(2e-3)
    assert (second["missed"], second["overruns"]) == (0, 0)


def test_missed_and_overrun_counts() -> None:
    cycles = CycleTiming(T)
    for stamp_ns in (0, 1_000_000, 4_000_000, 4_000_000, 5_000_000):
        numbers = cycles.add(stamp_ns, stamp_ns + 1_000_001, stamp_ns, ledger(0, stamp_ns, 1, 1))
    assert named(timing.SCALARS, numbers)["missed"] == 2
    assert named(timing.SCALARS, numbers)["overruns"] == 5
