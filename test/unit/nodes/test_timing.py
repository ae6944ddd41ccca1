"""Pacing and timing numbers against times that the test makes up; no clock is read here."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_core.timing import OK, WARN, spread
from slip_sim_bridge import pacing
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

    def tick(self, step_s: float, answer_s: float | None) -> dict[str, float]:
        self.now += step_s
        self.pacer.published(self.now)
        if answer_s is not None and answer_s < self.pacer.left(self.now):
            self.now += answer_s
            self.pacer.answered(self.now)
        self.now += max(0.0, self.pacer.left(self.now))
        return named(pacing.SCALARS, self.pacer.end(self.now))


def test_punctual_ticks_are_fresh() -> None:
    run = Run()
    for k in range(1, 2001):
        numbers = run.tick(2e-4, 3e-4)
        assert numbers["fresh"] == 1.0
        assert numbers["latency_s"] == pytest.approx(3e-4, abs=ROUNDING_S)
        assert run.now == pytest.approx(100.0 + k * T, abs=ROUNDING_S)
    assert numbers["fresh_share"] == 1.0
    assert numbers["overruns"] == 0
    assert numbers["real_time_factor"] == pytest.approx(1.0, abs=1e-6)


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
    assert (first["stale_wrench"], first["stale_slip"]) == (0, 1)
    stamp_ns += 1_000_000
    second = named(
        timing.SCALARS,
        cycles.add(1_101_000, 1_301_000, stamp_ns, ledger(1, stamp_ns, stamp_ns - 2_000_000, stamp_ns)),
    )
    assert second["period_s"] == pytest.approx(1.1e-3)
    assert second["wrench_age_s"] == pytest.approx(2e-3)
    assert (second["stale_wrench"], second["stale_slip"]) == (1, 1)
    assert (second["missed"], second["overruns"]) == (0, 0)


def test_missed_and_overrun_counts() -> None:
    cycles = CycleTiming(T)
    for stamp_ns in (0, 1_000_000, 4_000_000, 4_000_000, 5_000_000):
        numbers = cycles.add(stamp_ns, stamp_ns + 1_000_001, stamp_ns, ledger(0, stamp_ns, 1, 1))
    assert named(timing.SCALARS, numbers)["missed"] == 2
    assert named(timing.SCALARS, numbers)["overruns"] == 5


def test_status_warns_of_late_cycles() -> None:
    cycles = CycleTiming(T)
    for k in range(100):
        began_ns = k * 1_000_000
        cycles.add(began_ns, began_ns + 1_500_000, began_ns, ledger(k, began_ns, 1, 1))
    level, text, values = cycles.status()
    assert (level, text) == (WARN, "100 cycles overran or were missed since the last status")
    assert values["overruns"] == 100
    assert values["period_p99_us"] == 1000.0
    assert cycles.status()[0] == OK


# -- spread --------------------------------------------------------------------------------


def test_spread_is_that_of_finite_values() -> None:
    found = spread([math.nan, *range(101), math.inf])
    assert (found["mean"], found["p50"], found["p99"], found["max"]) == (50.0, 50.0, 99.0, 100.0)
    assert found["deviation"] == pytest.approx(math.sqrt(850.0))
    assert all(map(math.isnan, spread([math.nan]).values()))
