"""The search for gains on runs that are made up: what it proposes, what it costs, how it continues."""

from __future__ import annotations

import math

import pytest

from slip_vic.experiments.run import COLUMNS, METRICS, Row, row_of
from slip_vic.experiments.world import World, combined

pytest.importorskip("optuna", reason="the extra `tune`")

from optuna.distributions import FloatDistribution

from slip_vic.experiments.tune import Values, cost, search, search_space, tried, worst_mm

WORLDS = tuple(combined(("paper_planar",), ("vision_25",), ("none", "mass+"), range(2)))
SPACE = {"gains.k_s": FloatDistribution(50.0, 1000.0, log=True), "governor.margin": FloatDistribution(0.7, 1.0)}
DEFAULTS = {"gains.k_s": 1000.0, "governor.margin": 0.95}


def made_up(name: str, values: Values) -> list[Row]:
    """Return rows by a formula: the best k_s is 200, and a small margin costs effort rate."""
    rows = []
    for world in tried(WORLDS, "vic", name, values):
        k_s, margin = (float(text.partition("=")[2]) for text in world.settings[-2:])
        slip = 1e-3 * (1.0 + abs(math.log(k_s / 200.0)) + margin + 0.1 * world.seed)
        numbers = dict.fromkeys(METRICS, 0.0)
        numbers |= {"slip_linear_m": slip, "effort_rate_rms_n_m_s": 1.0 / margin**2, "arrival_s": 2.0}
        rows.append(row_of(world, "ok", "", numbers))
    return rows[::-1]


def searched(trials: int) -> list[tuple[float, dict[str, float]]]:
    return [(trial.value, trial.params) for trial in search(SPACE, DEFAULTS, trials, made_up)]


def test_the_search_finds_better_within_the_bounds() -> None:
    trials = searched(33)
    best, default = min(value for value, _ in trials), trials[0]
    assert len(trials) == 33
    assert default[1] == DEFAULTS
    assert best < 0.7 * default[0]
    beyond = [value for value, params in trials if params["governor.margin"] < 0.95 / math.sqrt(1.2)]
    assert beyond
    assert min(beyond) > default[0]


def test_a_search_proposes_the_same_again() -> None:
    assert searched(13) == searched(13)
    assert searched(13)[:5] == searched(5)


def row(**changes: object) -> Row:
    values = dict.fromkeys(METRICS, "0.0") | {"outcome": "ok", "arrival_s": "2.0", "effort_rate_rms_n_m_s": "10.0"}
    return dict.fromkeys(COLUMNS, "") | values | {name: str(value) for name, value in changes.items()}


DEFAULT = [row(slip_linear_m=0.003, slip_angular_rad=0.1), row(slip_linear_m=0.001)]


def test_cost_is_the_worst_slip_with_turning() -> None:
    assert cost(DEFAULT, DEFAULT) == worst_mm(DEFAULT) == pytest.approx(3.0 * math.sqrt(2.0))
    assert cost([row(slip_linear_m=0.001), row(slip_linear_m=0.002)], DEFAULT) == pytest.approx(2.0)


@pytest.mark.parametrize(
    "worse",
    [
        row(slip_linear_m=0.001, effort_rate_rms_n_m_s="13.0"), row(slip_linear_m=0.001, arrival_s="2.4"),
        row(slip_linear_m=0.001, arrival_s="nan"), row(outcome="held", slip_linear_m=0.001),
    ],
)  # fmt: skip
def test_less_slip_beyond_the_bounds_costs_more_than_the_default(worse: Row) -> None:
    assert math.inf > cost([worse, DEFAULT[1]], DEFAULT) > cost(DEFAULT, DEFAULT)


def test_nothing_is_asked_where_the_default_never_arrives() -> None:
    never = [row(arrival_s="nan"), row(slip_linear_m=0.001)]
    assert cost([row(arrival_s="9.0"), row()], never) == 0.0


def test_sets_whose_runs_all_fail_have_a_cost() -> None:
    assert math.isfinite(cost([row(outcome="refused"), row(outcome="crashed")], DEFAULT))


@pytest.mark.parametrize(
    ("law", "more"), [("vic?slip_estimator=measured", ()), ("vic", ()), ("governed", ("governor.margin",))]
)
def test_what_is_searched_depends_on_the_law(law: str, more: tuple[str, ...]) -> None:
    space, start = search_space(World("paper_planar", "optical_flow_120").load(law))
    assert all(one.low <= start[name] <= one.high for name, one in space.items())
    assert set(space) & {"governor.margin"} == set(more)
    if law.endswith("measured"):
        assert space["gains.k_s"].high == pytest.approx(54.886, abs=0.001)  # what the sensor's delay allows
