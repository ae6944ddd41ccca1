"""The search for gains on runs that are made up: what it proposes, what it costs, how it continues."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pytest

from slip_vic.experiments.rows import COLUMNS, Row, Task, row_of
from slip_vic.experiments.run import METRICS, Result
from slip_vic.experiments.world import World, combined

pytest.importorskip("optuna", reason="the extra `tune`")

from slip_vic.experiments.tune import Range, Search, Trial, cost, run_search, search_space, worst_mm

WORLDS = tuple(combined(("paper_planar",), ("vision_25",), ("none", "mass+"), range(2), {"": ()}))
SPACE = (Range("gains.k_s", 50.0, 1000.0, True, 1000.0), Range("governor.margin", 0.7, 1.0, False, 0.95))
SEARCH = Search(WORLDS, "vic", SPACE)


def made_up(tasks: Sequence[Task]) -> list[Row]:
    """Return rows by a formula: the best k_s is 200, and a small margin costs effort rate."""
    rows = []
    for task in tasks:
        k_s, margin = (float(text.partition("=")[2]) for text in task.world.settings[-2:])
        slip = 1e-3 * (1.0 + abs(math.log(k_s / 200.0)) + margin + 0.1 * task.world.seed)
        values = dict.fromkeys(METRICS, 0.0)
        values |= {"slip_linear_m": slip, "effort_rate_rms_n_m_s": 1.0 / margin**2, "arrival_s": 2.0}
        rows.append(row_of(Result(*task, "ok", "", values)))
    return rows[::-1]


def searched(trials: int) -> list[Trial]:
    return list(run_search(SEARCH, trials, made_up))


def test_the_search_finds_better_within_the_bounds() -> None:
    trials = searched(33)
    best = min(trials, key=lambda trial: trial.cost)
    assert [trial.number for trial in trials] == list(range(33))
    assert dict(trials[0].values) == {"gains.k_s": 1000.0, "governor.margin": 0.95}
    assert best.cost < 0.7 * trials[0].cost
    beyond = [trial for trial in trials if trial.values["governor.margin"] < 0.95 / math.sqrt(1.2)]
    assert beyond
    assert all(trial.cost > trials[0].cost for trial in beyond)


def test_a_search_proposes_the_same_again() -> None:
    assert searched(13) == searched(13)
    assert searched(13) == searched(5) + searched(13)[5:]


def row(**changes: object) -> Row:
    values = dict.fromkeys(METRICS, "0.0") | {"outcome": "ok", "arrival_s": "2.0", "effort_rate_rms_n_m_s": "10.0"}
    return dict.fromkeys(COLUMNS, "") | values | {name: str(value) for name, value in changes.items()}


DEFAULT = [row(slip_linear_m=0.003, slip_angular_rad=0.1), row(slip_linear_m=0.001)]


def test_cost_is_the_worst_slip_with_turning() -> None:
    assert cost(SEARCH, DEFAULT, DEFAULT) == worst_mm(DEFAULT) == pytest.approx(3.0 * math.sqrt(2.0))
    assert cost(SEARCH, [row(slip_linear_m=0.001), row(slip_linear_m=0.002)], DEFAULT) == pytest.approx(2.0)


@pytest.mark.parametrize(
    "worse",
    [
        row(slip_linear_m=0.001, effort_rate_rms_n_m_s="13.0"), row(slip_linear_m=0.001, arrival_s="2.4"),
        row(slip_linear_m=0.001, arrival_s="nan"), row(outcome="held", slip_linear_m=0.001),
    ],
)  # fmt: skip
def test_less_slip_beyond_the_bounds_costs_more_than_the_default(worse: Row) -> None:
    assert math.inf > cost(SEARCH, [worse, DEFAULT[1]], DEFAULT) > cost(SEARCH, DEFAULT, DEFAULT)


def test_nothing_is_asked_where_the_default_never_arrives() -> None:
    never = [row(arrival_s="nan"), row(slip_linear_m=0.001)]
    assert cost(SEARCH, [row(arrival_s="9.0"), row()], never) == 0.0


def test_sets_whose_runs_all_fail_have_a_cost() -> None:
    assert math.isfinite(cost(SEARCH, [row(outcome="refused"), row(outcome="crashed")], DEFAULT))


@pytest.mark.parametrize(
    ("law", "estimator", "more"),
    [("vic", "measured", ()), ("vic", "observer", ()), ("governed", "observer", ("governor.margin",))],
)
def test_what_is_searched_depends_on_the_law(law: str, estimator: str, more: tuple[str, ...]) -> None:
    loaded = World("paper_planar", "optical_flow_120").load(law, estimator)  # type: ignore[arg-type]
    space = {one.name: one for one in search_space(loaded)}
    assert all(one.low <= one.default <= one.high for one in space.values())
    assert set(space) & {"governor.margin"} == set(more)
    if estimator == "measured":
        assert space["gains.k_s"].high == pytest.approx(54.886, abs=0.001)  # what the sensor's delay allows
