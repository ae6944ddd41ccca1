"""What a run with two arms is judged by, and what is left of it."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from slip_sim_bridge.internal import internal_wrenches
from slip_vic.pair.measures import COLUMNS, LOST_SLIP_M, judge
from slip_vic.pair.picture import write_series
from slip_vic.pair.scenario import load_pair
from slip_vic.pair.study import World, run_draws, summary, write_results

SHORT = ("left.bridge.duration_s=0.03", "right.bridge.duration_s=0.03")
UPRIGHT = "pane_two_arms_upright"


def test_internal_wrenches_balance_and_the_rest_moves_the_object() -> None:
    rng = np.random.default_rng(4)
    places = [np.array([0.0, 0.2, 0.0]), np.array([0.0, -0.16, 0.03])]
    wrenches = list(rng.normal(size=(2, 6)))
    total, parts = internal_wrenches(wrenches, places, [np.eye(3)] * 2, np.zeros(3), 0.02)
    force = sum(part[:3] for part in parts)
    moment = sum(part[3:] + np.cross(x, part[:3]) for part, x in zip(parts, places, strict=True))
    np.testing.assert_allclose(np.concatenate((force, moment)), 0.0, atol=1e-12)
    assert max(np.abs(part).max() for part in parts) > 0.1
    np.testing.assert_allclose(total[:3], sum(h[:3] for h in wrenches))
    np.testing.assert_allclose(
        total[3:], sum(h[3:] + np.cross(x, h[:3]) for h, x in zip(wrenches, places, strict=True))
    )


def test_a_run_leaves_a_picture_and_its_numbers(tmp_path: Path) -> None:
    rows: list[tuple[float, ...]] = []
    judged = judge(load_pair(UPRIGHT, assignments=SHORT), 0, rows)
    assert judged.outcome == "ok"
    assert len(rows) == 30
    assert max(row[COLUMNS.index("load_left")] for row in rows) == judged.load[0]
    write_series(tmp_path / "pair", "two arms", {"internal": rows})
    with (tmp_path / "pair" / "internal.csv").open() as file:
        read = list(csv.reader(file))
    assert tuple(read[0]) == COLUMNS
    assert len(read) == 31
    assert (tmp_path / "pair" / "pair.png").stat().st_size > 10_000


def test_a_pane_that_slides_out_is_lost() -> None:
    judged = judge(load_pair(UPRIGHT, assignments=("bridge.friction.mu_s=0.1", "bridge.friction.mu_k=0.1")))
    assert judged.outcome in ("lost", "fault")
    assert judged.reason
    assert max(judged.slip) < 2.0 * LOST_SLIP_M


def test_a_study_runs_every_law_in_every_world_and_counts(tmp_path: Path) -> None:
    results = list(run_draws(2, 0, [UPRIGHT], ["classical", "internal"], 1, SHORT))
    assert [(world.number, law) for world, law, _ in results] == [
        (0, "classical"), (0, "internal"), (1, "classical"), (1, "internal"),
    ]  # fmt: skip
    assert isinstance(results[0][0], World)
    assert summary(results).row_count == 2
    write_results(tmp_path / "pair_study.csv", results)
    assert len((tmp_path / "pair_study.csv").read_text().splitlines()) == 5
