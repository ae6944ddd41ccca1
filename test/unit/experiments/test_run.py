"""Worlds under laws: what a mismatch changes, what every run becomes, and what a foreign law does wrong."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from slip_core.errors import InputError
from slip_vic.experiments.run import METRICS, Row, run
from slip_vic.experiments.world import MISMATCHES, World, combined

SHORT = ("bridge.duration_s=0.05",)


def under(law: str, **more: Any) -> Row:
    return run(replace(worlds()[0], law=law, **more))


def worlds(mismatches: tuple[str, ...] = ("none",), sensor: str = "event_1000") -> list[World]:
    return combined(("paper_planar",), (sensor,), mismatches, range(1), settings=SHORT)


def test_every_combination_once() -> None:
    drives = ("", "torque_joint")
    made = combined(("paper_planar",), ("ideal", "vision_25"), ("none", "mass+"), range(3), drives, SHORT)
    assert len(made) == len(set(made)) == 24
    assert [world.seed for world in made[::8]] == [0, 1, 2]
    with pytest.raises(InputError, match=r"mass\+"):
        combined(("paper_planar",), ("ideal",), ("mass",), range(1))


@pytest.mark.parametrize("mismatch", MISMATCHES)
def test_a_mismatch_changes_the_world_alone(mismatch: str) -> None:
    plain, wrong = worlds()[0].load("vic"), worlds((mismatch,))[0].load("vic")
    assert wrong.controller == plain.controller
    assert (wrong.bridge == plain.bridge) == (mismatch == "none")


def test_a_sensor_reaches_both_nodes() -> None:
    scenario = worlds(sensor="optical_flow_120")[0].load("vic")
    assert scenario.bridge.sensors.slip.rate_hz == scenario.controller.slip_sensor.rate_hz == 120.0
    assert scenario.controller.slip_estimator == "observer"


def test_a_run_has_all_its_numbers() -> None:
    good = under("vic")
    assert good["outcome"] == "ok"
    assert all(math.isfinite(float(good[name])) for name in METRICS if name not in ("arrival_s", "fastest_s"))
    assert math.isnan(float(good["arrival_s"]))  # the path is not over


@pytest.mark.parametrize(
    ("law", "settings", "outcome", "reason"),
    [
        ("vic", ("controller.gains.k_s=0.5",), "refused", "k_s"),
        ("vic", ("bridge.duration_s=nonsense",), "refused", "duration_s"),
        ("vic", ("bridge.gravity=[0.0, 0.0, -1e6]", "bridge.grip.pad_size=[1e3, 1e3]"), "lost", "simulation diverged"),
        ("classical", ("controller.tare.duration_s=1.0",), "held", "the law never began: "),
        ("nowhere.py:Law", (), "refused", "no file nowhere.py"),
    ],
)
def test_what_goes_wrong_is_a_row(law: str, settings: tuple[str, ...], outcome: str, reason: str) -> None:
    row = under(law, settings=(*SHORT, *settings))
    assert row["outcome"] == outcome, row["reason"]
    assert reason in row["reason"]


def test_laws_of_the_controller_by_name() -> None:
    (world,) = worlds()
    loaded = world.load("vic?gains.k_s=9.0")
    assert (loaded.law, loaded.controller.slip_estimator, loaded.controller.gains.k_s) == ("vic", "observer", 9.0)
    with pytest.raises(InputError, match="fixed_grip"):
        world.load("fixed_grip")


def test_a_foreign_law_runs_in_the_same_worlds(tmp_path: Path) -> None:
    file = tmp_path / "own.py"
    file.write_text(
        "class Still:\n    needs = frozenset()\n    def reset(self, setup): ...\n    def step(self, seen): ...\n"
        "class NotMade(Still):\n    def __init__(self): raise KeyError('no')\n"
    )
    assert under(f"{file}:Still")["outcome"] == "ok"
    row = under(f"{file}:NotMade")
    assert (row["outcome"], row["reason"]) == ("failed", "KeyError: 'no'")
