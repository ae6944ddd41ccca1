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


def metric(*numbers: float, better: str = "high") -> Metric:
    return Metric("m", "x", better, numbers)  # type: ignore[arg-type]


# -- samples ------------------------------------------------------------------------------------------


def test_ratios_are_formed_within_a_round_so_that_a_slow_round_does_not_show() -> None:
    rounds = Rounds()
    for speed in (1.0, 5.0, 0.2):  # the machine is five times slower in one round, five times faster in another
        rounds.add("r0", 6.0 * speed)
        rounds.add("ours", 2.0 * speed)
    found = rounds.ratio("ratio", "r0", "ours", "high")
    assert found.values == pytest.approx((3.0, 3.0, 3.0))
    assert (found.low, found.median, found.high) == pytest.approx((3.0, 3.0, 3.0))


def test_a_ratio_of_unequal_rounds_is_an_error() -> None:
    rounds = Rounds({"a": [1.0, 2.0], "b": [1.0]})
    with pytest.raises(ValueError, match="shorter"):
        rounds.ratio("ratio", "a", "b", "high")


def test_a_metric_keeps_its_values_and_scales_them() -> None:
    found = Rounds({"tick": [3e-6, 1e-6, 2e-6]}).metric("tick_us", "tick", "us", "low", scale=1e6)
    assert found.values == pytest.approx((3.0, 1.0, 2.0))
    assert (found.low, found.median, found.high) == pytest.approx((1.0, 2.0, 3.0))


def test_a_metric_without_values_is_nan() -> None:
    assert math.isnan(metric().median)
    assert math.isnan(metric().low)


@given(st.lists(st.text(min_size=1), min_size=1, max_size=8, unique=True), st.integers(0, 20))
def test_every_round_has_all_names_and_over_the_rounds_everybody_is_first(names: list[str], number: int) -> None:
    assert sorted(rotated(names, number)) == sorted(names)
    assert {rotated(names, k)[0] for k in range(len(names))} == set(names)


def test_spread() -> None:
    assert relative_spread([1.0, 2.0, 3.0]) == 1.0
    assert relative_spread([7.0]) == 0.0


# -- results ------------------------------------------------------------------------------------------

FREE = {f"latency_{key}_ms": 0.3 for key in ("p50", "p99", "p999", "max")}
RESULT = BenchResult(
    metrics={
        name: Metric(name, "", "high", (2.0, 3.0))
        for name in ("control_step_ratio", "control_step_observer_ratio", "lockstep_ratio")
    }
    | {"supervised_loop_real_time_factor": Metric("supervised_loop_real_time_factor", "x", "high", (12.0, 13.0))},
    free_running={
        name: {"fresh": 1.0, "lost": 0.0, "recorder_lost": 0.0, "real_time_factor": 1.0, **FREE}
        for name in ("500_normal", "500", "1000_normal", "1000", "2000_normal", "2000")
    },
    profile_us={"controller: law and torque": 50.0, "middleware, waking, waiting": 100.0},
    memory_mib={"bridge": 100.0},
    machine={},
    noise={"calibration_spread": 0.1, "stalled_share": 0.0},
    notes=[],
)


def test_the_file_has_the_figures_that_are_asked_for_by_name(tmp_path: Path) -> None:
    path = write_results(tmp_path / "new", RESULT)
    stored = json.loads(path.read_text())
    assert stored["supervised_loop_real_time_factor"] == 12.5
    assert {"control_step_ratio", "control_step_observer_ratio", "lockstep_ratio"} <= stored.keys()
    for rate in ("500", "1000", "2000"):
        wanted = {"fresh", "lost", "latency_p50_ms", "latency_p99_ms", "latency_max_ms"}
        assert wanted <= stored["free_running"][rate].keys()


# -- what is measured is what it says -----------------------------------------------------------------


def test_the_measured_control_step_does_the_whole_law() -> None:
    now, rounds = cost.stretch(load_scenario(cost.SCENARIO), ticks=30), []
    for _ in range(2):
        now.restore()
        results = [now.step() for _ in now.inputs]
        assert all(result.ok for result in results)
        rounds.append([result.command.effort.tobytes() for result in results])
    assert rounds[0] == rounds[1]
    assert len(set(rounds[0])) == cost.STRETCH


def test_the_slipping_scenario_slips_and_the_other_sticks() -> None:
    for scenario, slips in ((load_scenario(cost.SCENARIO), False), (cost.slipping_scenario(), True)):
        step = cost.holding_bridge(scenario)
        for _ in range(50):
            step.advance([None])
        speed = max(abs(step.simulation.observe(0).slip.twist))
        assert (speed > 1e-3) == slips


def test_the_sliding_object_is_put_back_before_it_is_far_away() -> None:
    bridge = cost.holding_bridge(cost.slipping_scenario())
    step = cost.sliding_step(bridge)
    slips = []
    for _ in range(2 * cost.SLIDE_TICKS + 10):
        step()
        slips.append(max(abs(bridge.simulation.observe(0).truth.slip_displacement[:3])))
    assert max(slips) > 0.005
    assert max(slips) < 0.1
    assert slips[-1] < 0.01 * max(slips)


def test_of_a_stretch_one_tick_after_another_is_timed() -> None:
    now = cost.stretch(load_scenario(cost.SCENARIO), ticks=30)
    for turns, at in ((1, 2), (cost.STRETCH + 3, 6)):  # and one that is not timed
        assert cost.interleaved({"step": now}, turns)["step"] > 0.0
        assert now.at == at


def test_calls_are_timed_in_every_order() -> None:
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
