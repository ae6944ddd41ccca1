"""The bench's arithmetic on made-up numbers; what it measures is its own business, not a test's."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd

from slip_vic.scenarios.scenario import load_scenario
from test.campaigns.bench import cost, measure
from test.campaigns.bench.report import write_results

NAMES = sorted({name for metric in measure.METRICS for name in (metric.over, metric.under) if name})


def test_ratios_within_a_round() -> None:
    speed = np.array([1.0, 5.0, 0.2])  # the machine is five times slower in one round, five times faster in another
    rounds = pd.DataFrame({name: (2.0 + k) * speed for k, name in enumerate(NAMES)})
    found = measure.over_rounds(rounds)
    assert list(found.index) == [metric.name for metric in measure.METRICS]
    tick = 2.0 + NAMES.index("lockstep")
    np.testing.assert_allclose(found.loc["recorder_ratio"], (2.0 + NAMES.index("lockstep, recorded")) / tick)
    np.testing.assert_allclose(found.loc["lockstep_tick_us"], 1e6 * tick * np.array([1.0, 0.2, 5.0]))


def test_figures_in_the_file(tmp_path: Path) -> None:
    rounds = pd.DataFrame({name: [2.0, 3.0] for name in NAMES})
    free = pd.DataFrame({"fresh": [1.0], "latency_p50_ms": [0.3]}, index=["500_normal"])
    result = measure.BenchResult(measure.over_rounds(rounds), free, {"bridge": 100.0}, {}, 0.1)
    stored = json.loads(write_results(tmp_path / "new", result).read_text())
    assert stored["metrics"]["supervised_loop_real_time_factor"] == {"median": 2.5, "min": 2.0, "max": 3.0}
    assert stored["free_running"]["500_normal"]["latency_p50_ms"] == 0.3


# -- what is measured is what it says -----------------------------------------------------------------


def test_measured_step_is_the_whole_cycle() -> None:
    now, rounds = cost.stretch(load_scenario(cost.SCENARIO), ticks=30), []
    for _ in range(2):
        now.restore()
        results = [now.step() for _ in now.inputs]
        assert all(result.ok for result in results)
        rounds.append([result.command.numbers.tobytes() for result in results])
    assert rounds[0] == rounds[1]
    assert len(set(rounds[0])) == cost.STRETCH


def test_ticks_of_a_stretch() -> None:
    now = cost.stretch(load_scenario(cost.SCENARIO), ticks=30)
    for turns, at in ((1, 2), (cost.STRETCH + 3, 6)):  # and one that is not timed
        assert cost.interleaved({"step": now}, turns)["step"] > 0.0
        assert now.at == at
