"""The search for gains on runs that are made up: what it proposes, what it costs, how it goes on, what it writes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from slip_core.errors import InputError
from slip_vic.cli import cli
from slip_vic.experiments.contents import Contents
from slip_vic.experiments.rows import COLUMNS, Plan, Row, RowFile, Task
from slip_vic.experiments.run import METRICS, Result, failed
from slip_vic.experiments.tune.space import Bounds, Range, cost, score, search_space
from slip_vic.experiments.world import World, combined
from slip_vic.scenarios.scenario import Texts

pytest.importorskip("optuna", reason="the extra `tune`")

from slip_vic.experiments.tune.command import check_time
from slip_vic.experiments.tune.page import Found, page
from slip_vic.experiments.tune.search import Search, Trial, best_of, run_search, run_sets

WORLDS = tuple(combined(("paper_planar",), ("vision_25",), ("none", "mass+"), range(2), {"": ()}))
SPACE = (Range("gains.k_s", 50.0, 1000.0, True, 1000.0), Range("governor.margin", 0.7, 1.0, False, 0.95))
SEARCH = Search(WORLDS, "vic", SPACE, Bounds(1.2, 0.3), seed=0, batch=4)
CONTENTS = Contents(Texts(), {"numpy": "2.0"})


class Stop(Exception):
    """Somebody pulls the plug."""


class MadeUp:
    """An engine whose runs are a formula: the best k_s is 200, and a small margin costs effort rate."""

    deaths = 0

    def __init__(self, stop_after: float = math.inf) -> None:
        self.runs, self._stop_after = 0, stop_after

    def run(self, call: Callable[..., Any], shared: Contents, tasks: Iterable[Task]) -> Iterator[Any]:
        for task in tasks:
            if self.runs >= self._stop_after:
                raise Stop
            self.runs += 1
            set_of = [text for text in task.world.settings if text.startswith("controller.g")]
            k_s, margin = (float(text.partition("=")[2]) for text in (set_of or ("k_s=1000.0", "margin=0.95")))
            slip = 1e-3 * (1.0 + abs(math.log(k_s / 200.0)) + margin + 0.1 * task.world.seed)
            values = dict.fromkeys(METRICS, 0.0)
            values |= {"slip_linear_m": slip, "effort_rate_rms_n_m_s": 1.0 / margin**2, "arrival_s": 2.0}
            yield task, Result(*task, "ok", "", values)


def ignore(done: int) -> None:
    pass


def searched(folder: Path, trials: int, engine: MadeUp) -> list[Trial]:
    with RowFile(folder / "trials.csv", Plan(CONTENTS.made_of, ())) as file:
        return list(run_search(SEARCH, trials, CONTENTS, file, engine, ignore))  # type: ignore[arg-type]


def test_the_default_is_first_and_the_search_finds_better_within_the_bounds(tmp_path: Path) -> None:
    trials = searched(tmp_path, 33, MadeUp())
    best = best_of(trials)
    assert [trial.number for trial in trials] == list(range(33))
    assert dict(trials[0].values) == {"gains.k_s": 1000.0, "governor.margin": 0.95}
    assert best.cost < 0.7 * trials[0].cost
    assert best.score.excess == 0.0
    beyond = [trial for trial in trials if trial.values["governor.margin"] < 0.95 / math.sqrt(1.2)]
    assert beyond
    assert all(trial.score.excess > 0.0 and trial.cost > trials[0].cost for trial in beyond)


def test_a_search_that_was_stopped_anywhere_goes_on_to_the_same_end(tmp_path: Path) -> None:
    whole = searched(tmp_path / "whole", 13, MadeUp())
    runs = 13 * len(WORLDS)
    for stop in (3, 21):
        folder, first, second = tmp_path / str(stop), MadeUp(stop), MadeUp()
        with pytest.raises(Stop):
            searched(folder, 13, first)
        assert searched(folder, 13, second) == whole
        assert first.runs + second.runs == runs
    grown = tmp_path / "grown"
    searched(grown, 5, MadeUp())
    assert searched(grown, 13, MadeUp()) == whole
    nothing = MadeUp()
    assert searched(grown, 13, nothing) == whole
    assert nothing.runs == 0


def test_a_folder_keeps_to_one_search(tmp_path: Path) -> None:
    searched(tmp_path, 1, MadeUp())
    other = replace(SEARCH, bounds=Bounds(1.5, 0.3))
    with (
        RowFile(tmp_path / "trials.csv", Plan(CONTENTS.made_of, ())) as file,
        pytest.raises(InputError, match="a search with bounds"),
    ):
        list(run_search(other, 1, CONTENTS, file, MadeUp(), ignore))  # type: ignore[arg-type]


def row(**changes: object) -> Row:
    values = dict.fromkeys(METRICS, "0.0") | {"outcome": "ok", "arrival_s": "2.0", "effort_rate_rms_n_m_s": "10.0"}
    return dict.fromkeys(COLUMNS, "") | values | {name: str(value) for name, value in changes.items()}


def test_less_slip_beyond_the_bounds_costs_more_than_the_default() -> None:
    default = [row(slip_linear_m=0.003, slip_angular_rad=0.1), row(arrival_s="nan", slip_linear_m=0.001)]
    base = score(default, default, SEARCH.bounds)
    assert base.slip == pytest.approx(math.hypot(0.003, 0.003))
    assert base.excess == base.failed == 0
    assert cost(base, base) == pytest.approx(3.0 * math.sqrt(2.0))
    good = score([row(slip_linear_m=0.001), row(slip_linear_m=0.002, arrival_s="nan")], default, SEARCH.bounds)
    assert cost(good, base) == pytest.approx(2.0)
    for worse in (
        row(slip_linear_m=0.001, effort_rate_rms_n_m_s="13.0"),
        row(slip_linear_m=0.001, arrival_s="2.4"),
        row(slip_linear_m=0.001, arrival_s="nan"),
        row(outcome="held", slip_linear_m=0.001),
    ):
        found = score([worse, default[1]], default, SEARCH.bounds)
        assert found.excess > 0.0
        assert cost(found, base) > cost(base, base)
    crossed = [row(arrival_s="3.6"), row(arrival_s="5.1")]
    assert score([row(arrival_s="5.2"), row(arrival_s="3.5")], crossed, SEARCH.bounds).excess == 0.0
    assert score([row(arrival_s="5.2"), row(arrival_s="nan")], crossed, SEARCH.bounds).excess > 1.0
    assert score([row(arrival_s="5.5"), row(arrival_s="3.5")], crossed, SEARCH.bounds).excess > 0.0
    other = [row(mismatch="mass+", arrival_s="3.6"), row(mismatch="mass-", arrival_s="5.1")]
    late = [row(mismatch="mass+", arrival_s="5.1"), row(mismatch="mass-", arrival_s="3.6")]
    assert score(late, other, SEARCH.bounds).excess > 0.0
    nothing = score([row(outcome="refused"), row(outcome="crashed")], default, SEARCH.bounds)
    assert math.isfinite(cost(nothing, base))


def test_runs_that_end_before_the_latest_arrival_that_is_allowed_are_refused() -> None:
    check_time(3.5, 0.3, 4.0)
    check_time(math.nan, 0.3, 4.0)
    with pytest.raises(InputError, match=r"4 s, and the default arrives after 3\.90 s, expected at least 4\.20 s"):
        check_time(3.9, 0.3, 4.0)


def test_a_set_whose_runs_fail_has_rows_all_the_same(tmp_path: Path) -> None:
    class Failing(MadeUp):
        def run(self, call: Any, shared: Any, tasks: Iterable[Any]) -> Iterator[Any]:
            for task in tasks:
                yield task, failed(*task, "refused", "no such gain")

    sets = {"one": {"gains.k_s": -1.0}}
    with RowFile(tmp_path / "trials.csv", Plan({}, ())) as file:
        rows = run_sets(file, sets, WORLDS, "vic", CONTENTS, Failing(), ignore)  # type: ignore[arg-type]
    assert [one["outcome"] for one in rows["one"]] == ["refused"] * 4


def test_what_is_searched_depends_on_the_estimator() -> None:
    names = {}
    for law, estimator in (("vic", "measured"), ("vic", "observer"), ("governed", "observer")):
        loaded = World("paper_planar", "optical_flow_120").load(law, estimator)
        space = {one.name: one for one in search_space(loaded, law, estimator)}
        assert all(one.low <= one.default <= one.high for one in space.values())
        names["governed" if law == "governed" else estimator] = set(space)
        if estimator == "measured":
            assert space["gains.k_s"].high == pytest.approx(54.886, abs=0.001)  # what the sensor's delay allows
    assert names["measured"] < names["observer"] < names["governed"]
    assert names["governed"] - names["observer"] == {"governor.margin"}


def test_the_page_shows_what_was_found(tmp_path: Path) -> None:
    trials = searched(tmp_path, 5, MadeUp())
    default = [row(mismatch=name, slip_linear_m=0.004) for name in ("none", "mass+")]
    tuned = [row(mismatch="none", slip_linear_m=0.002), row(mismatch="mass+", outcome="diverged")]
    text = page(SEARCH, Found(trials, best_of(trials), default, tuned), "a <b> & c", "slip-vic tune")
    assert "a &lt;b&gt; &amp; c" in text
    assert "<td>mass+</td><td>4</td><td>inf</td>" in text
    assert "<svg" in text
    assert "http://" not in text.replace("http://www.w3.org", "").replace("http://purl.org", "").replace(
        "http://creativecommons.org", ""
    )


@pytest.mark.parametrize(
    ("words", "said"),
    [(["--sensor", "vision_26"], "vision_25"), (["--sensor", "ideal", "--mismatch", "mass"], "mass+")],
)
def test_a_mistake_is_said_before_anything_is_written(
    words: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    ran = CliRunner().invoke(cli, ["tune", *words])
    assert isinstance(ran.exception, InputError)
    assert said in str(ran.exception)
    assert list(tmp_path.iterdir()) == []
