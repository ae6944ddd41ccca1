"""The bench's arithmetic on made-up numbers; what it measures is its own business, not a test's."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_core.errors import InputError
from slip_vic.scenarios.scenario import load_scenario
from slip_vic_controller.arm.robot import Robot
from test.campaigns.bench import cost, measure
from test.campaigns.bench.chain import chain_urdf
from test.campaigns.bench.compare import compare, comparison_table, judge, read_metrics
from test.campaigns.bench.measure import BenchResult
from test.campaigns.bench.report import write_results
from test.campaigns.bench.samples import Metric, Rounds, metric_from, relative_spread, rotated
from test.campaigns.cli import main

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


@given(values, st.sampled_from(["high", "low"]))
def test_a_metric_survives_json(numbers: tuple[float, ...], better: str) -> None:
    original = Metric("name", "us", better, numbers, "note")  # type: ignore[arg-type]
    assert metric_from("name", json.loads(json.dumps(original.as_dict()))) == original


@given(st.lists(st.text(min_size=1), min_size=1, max_size=8, unique=True), st.integers(0, 20))
def test_every_round_has_all_names_and_over_the_rounds_everybody_is_first(names: list[str], number: int) -> None:
    assert sorted(rotated(names, number)) == sorted(names)
    assert {rotated(names, k)[0] for k in range(len(names))} == set(names)


def test_spread() -> None:
    assert relative_spread([1.0, 2.0, 3.0]) == 1.0
    assert relative_spread([7.0]) == 0.0


# -- compare ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("before", "after", "verdict"),
    [
        (metric(1.0, 1.1, 1.2), metric(1.5, 1.6, 1.7), "better"),
        (metric(1.5, 1.6, 1.7), metric(1.0, 1.1, 1.2), "worse"),
        (metric(1.0, 1.1, 1.2, better="low"), metric(1.5, 1.6, 1.7, better="low"), "worse"),
        (metric(1.5, 1.6, 1.7, better="low"), metric(1.0, 1.1, 1.2, better="low"), "better"),
        (metric(1.0, 1.1, 1.6), metric(1.5, 1.6, 1.7), "same"),  # the rounds overlap
        (metric(1.0, 1.0), metric(1.01, 1.01), "same"),  # apart, but by less than is worth a line
        (metric(), metric(1.0), "same"),
        (None, metric(1.0), "new"),
        (metric(1.0), None, "gone"),
    ],
)
def test_verdicts(before: Metric | None, after: Metric | None, verdict: str) -> None:
    assert judge("m", before, after).verdict == verdict


@given(values, values)
def test_a_verdict_turns_round_with_the_files(one: tuple[float, ...], other: tuple[float, ...]) -> None:
    there, back = judge("m", metric(*one), metric(*other)), judge("m", metric(*other), metric(*one))
    assert {there.verdict, back.verdict} in ({"same"}, {"better", "worse"})


@given(values)
def test_nothing_changes_against_itself(numbers: tuple[float, ...]) -> None:
    change = judge("m", metric(*numbers), metric(*numbers))
    assert (change.verdict, change.relative) == ("same", 0.0)


def test_what_changed_comes_first() -> None:
    before = {"a": metric(1.0), "b": metric(1.0), "c": metric(1.0)}
    after = {"a": metric(1.0), "b": metric(2.0), "d": metric(3.0)}
    changes = compare(before, after)
    assert [(change.name, change.verdict) for change in changes] == [
        ("b", "better"),
        ("c", "gone"),
        ("d", "new"),
        ("a", "same"),
    ]
    assert comparison_table(changes).row_count == 4


# -- results ------------------------------------------------------------------------------------------

FREE = {f"latency_{key}_ms": 0.3 for key in ("p50", "p99", "p999", "max")}
RESULT = BenchResult(
    metrics={
        name: Metric(name, "", "high", (2.0, 3.0))
        for name in ("control_step_ratio", "control_step_observer_ratio", "lockstep_ratio")
    }
    | {"closed_loop_real_time_factor": Metric("closed_loop_real_time_factor", "x", "high", (12.0, 13.0))},
    free_running={
        name: {"fresh": 1.0, "lost": 0.0, "recorder_lost": 0.0, "real_time_factor": 1.0, **FREE}
        for name in ("500_normal", "500", "1000_normal", "1000", "2000_normal", "2000")
    },
    profile_us={"controller: law and torque": 50.0, "middleware, waking, waiting": 100.0},
    scaling_us={"joints": {"7": 50.0}, "contacts": {"1": 50.0}},
    memory_mib={"bridge": 100.0},
    machine={},
    noise={"calibration_spread": 0.1, "stalled_share": 0.0},
    notes=[],
)


def test_the_file_has_the_figures_that_are_asked_for_by_name(tmp_path: Path) -> None:
    path, picture = write_results(tmp_path / "new", RESULT)
    stored = json.loads(path.read_text())
    assert stored["closed_loop_real_time_factor"] == 12.5
    assert {"control_step_ratio", "control_step_observer_ratio", "lockstep_ratio"} <= stored.keys()
    for rate in ("500", "1000", "2000"):
        wanted = {"fresh", "lost", "latency_p50_ms", "latency_p99_ms", "latency_max_ms"}
        assert wanted <= stored["free_running"][rate].keys()
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert read_metrics(path) == RESULT.metrics


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"metrics": []}', '{"metrics": {"a": {"unit": "us"}}}'])
def test_a_file_of_another_kind_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "bench.json"
    path.write_text(text)
    with pytest.raises(InputError):
        read_metrics(path)


def test_compare_on_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    first, _ = write_results(tmp_path / "a", RESULT)
    faster = {**RESULT.metrics, "lockstep_ratio": Metric("lockstep_ratio", "", "high", (4.0, 4.1))}
    second, _ = write_results(tmp_path / "b", replace(RESULT, metrics=faster))
    monkeypatch.setattr("sys.argv", ["slip-vic", "bench", "--compare", str(first), str(second)])
    assert main() == 0
    assert "lockstep_ratio" in capsys.readouterr().out
    monkeypatch.setattr("sys.argv", ["slip-vic", "bench", "--compare", str(first), str(tmp_path / "none.json")])
    assert main() == 2
    assert capsys.readouterr().err.count("\n") == 1


# -- what is measured is what it says -----------------------------------------------------------------


@pytest.mark.parametrize("joints", measure.JOINTS)
def test_the_chain_has_the_joints_it_says(joints: int) -> None:
    arm = Robot(chain_urdf(joints), "ee", [f"joint{i}" for i in range(1, joints + 1)])
    assert len(arm.effort_limit) == joints


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
