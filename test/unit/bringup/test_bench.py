"""The bench's arithmetic on made-up numbers; what it measures is its own business, not a test's."""

from __future__ import annotations

import json
import math
from functools import partial
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_vic.scenarios.scenario import load_scenario
from test.campaigns.bench import cost, measure
from test.campaigns.bench.measure import BenchResult
from test.campaigns.bench.report import write_results
from test.campaigns.bench.samples import Metric, Rounds, relative_spread, rotated

values = st.lists(st.floats(1e-6, 1e6), min_size=1, max_size=9).map(tuple)


def metric(*numbers: float) -> Metric:
    return Metric("m", "x", numbers)


# -- samples ------------------------------------------------------------------------------------------


def test_ratios_within_a_round() -> None:
    rounds = Rounds()
    for speed in (1.0, 5.0, 0.2):  # the machine is five times slower in one round, five times faster in another
        rounds.add("r0", 6.0 * speed)
        rounds.add("ours", 2.0 * speed)
    found = rounds.ratio("ratio", "r0", "ours")
    assert found.values == pytest.approx((3.0, 3.0, 3.0))
    assert (found.low, found.median, found.high) == pytest.approx((3.0, 3.0, 3.0))


def test_ratio_of_unequal_rounds() -> None:
    rounds = Rounds({"a": [1.0, 2.0], "b": [1.0]})
    with pytest.raises(ValueError, match="shorter"):
        rounds.ratio("ratio", "a", "b")


def test_metric_scales_values() -> None:
    found = Rounds({"tick": [3e-6, 1e-6, 2e-6]}).metric("tick_us", "tick", "us", scale=1e6)
    assert found.values == pytest.approx((3.0, 1.0, 2.0))
    assert (found.low, found.median, found.high) == pytest.approx((1.0, 2.0, 3.0))


def test_metric_without_values() -> None:
    assert math.isnan(metric().median)
    assert math.isnan(metric().low)


@given(st.lists(st.text(min_size=1), min_size=1, max_size=8, unique=True), st.integers(0, 20))
def test_rotation_of_names(names: list[str], number: int) -> None:
    assert sorted(rotated(names, number)) == sorted(names)
    assert {rotated(names, k)[0] for k in range(len(names))} == set(names)


def test_spread() -> None:
    assert relative_spread([1.0, 2.0, 3.0]) == 1.0
    assert relative_spread([7.0]) == 0.0


# -- results ------------------------------------------------------------------------------------------

FREE = {f"latency_{key}_ms": 0.3 for key in ("p50", "p99", "p999", "max")}
RESULT = BenchResult(
    metrics={
        name: Metric(name, "", (2.0, 3.0))
        for name in ("control_step_ratio", "control_step_observer_ratio", "lockstep_ratio")
    }
    | {"supervised_loop_real_time_factor": Metric("supervised_loop_real_time_factor", "x", (12.0, 13.0))},
    free_running={
        name: {"fresh": 1.0, "lost": 0.0, "recorder_lost": 0.0, "real_time_factor": 1.0, **FREE}
        for name in ("500_normal", "500", "1000_normal", "1000", "2000_normal", "2000")
    },
    memory_mib={"bridge": 100.0},
    machine={},
    noise=0.1,
    notes=[],
)


def test_figures_in_the_file(tmp_path: Path) -> None:
    path = write_results(tmp_path / "new", RESULT)
    stored = json.loads(path.read_text())
    assert stored["supervised_loop_real_time_factor"] == 12.5
    assert {"control_step_ratio", "control_step_observer_ratio", "lockstep_ratio"} <= stored.keys()
    for rate in ("500", "1000", "2000"):
        wanted = {"fresh", "lost", "latency_p50_ms", "latency_p99_ms", "latency_max_ms"}
        assert wanted <= stored["free_running"][rate].keys()


# -- what is measured is what it says -----------------------------------------------------------------


def test_measured_step_is_the_whole_cycle() -> None:
    now, rounds = cost.stretch(load_scenario(cost.SCENARIO), ticks=30), []
    for _ in range(2):
        now.restore()
        results = [now.step() for _ in now.inputs]
        assert all(result.ok for result in results)
        rounds.append([result.command.effort.tobytes() for result in results])
    assert rounds[0] == rounds[1]
    assert len(set(rounds[0])) == cost.STRETCH


def test_ticks_of_a_stretch() -> None:
    now = cost.stretch(load_scenario(cost.SCENARIO), ticks=30)
    for turns, at in ((1, 2), (cost.STRETCH + 3, 6)):  # and one that is not timed
        assert cost.interleaved({"step": now}, turns)["step"] > 0.0
        assert now.at == at


def test_calls_in_every_order() -> None:
    seen: list[str] = []
    calls = {name: partial(seen.append, name) for name in "abc"}
    assert set(cost.interleaved(calls, 60)) == set("abc")
    turns = ["".join(seen[i : i + 3]) for i in range(0, len(seen), 3)]
    assert turns[0] == "abc"  # not timed
    assert len(turns) == 61
    assert {"".join(sorted(turn)) for turn in turns} == {"abc"}
    assert len(set(turns)) == 6


def test_efforts_differ_in_length_only() -> None:
    assert measure.QUICK.rounds >= 2  # one round would show no noise
