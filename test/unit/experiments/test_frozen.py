"""The frozen judge: its worlds load today, and its verdict says what rows say."""

import math
from collections.abc import Sequence

import pytest

from slip_vic.experiments import suite
from slip_vic.experiments.run import Row, kind_of
from test.campaigns.frozen.compare import compare, verdict
from test.campaigns.frozen.worlds import base_rows, worlds_of


def row(number: int, law: str = "governed", outcome: str = "ok", *, off: float = 0.0, slip: float = 0.0,
        arrival: float = 2.0, drive: str = "ideal", name: str = "one_arm_1") -> Row:  # fmt: skip
    cells = {"set": name, "world": number, "law": law, "drive": drive, "outcome": outcome, "off_goal_m": off,
             "final_error_m": off, "slip_path_m": slip, "arrival_s": arrival}  # fmt: skip
    return {key: str(value) for key, value in cells.items()}


def worse(before: Sequence[Row], now: Sequence[Row]) -> list[str]:
    return verdict(compare(before, now))


def test_worlds_are_all_there() -> None:
    worlds = worlds_of()
    assert [len(worlds_of(name)) for name in ("one_arm_20261201", "one_arm_20261202", "one_arm_20261203")] == [300] * 3
    assert len(worlds_of("two_arms")) == 60
    assert len(set(worlds)) == len(worlds) == 960


@pytest.mark.parametrize("law", ["classical", "vic", "governed", "governed_follow"])
def test_every_world_has_a_row(law: str) -> None:
    rows = [(row["set"], row["world"]) for row in base_rows() if row["law"] == law]
    assert sorted(rows) == sorted((world.set, str(world.number)) for world in worlds_of())


def test_every_parameter_of_the_worlds_exists() -> None:
    """Of both stores; one that is removed is to be removed from them too."""
    seen: set[str] = set()
    for world in (*worlds_of(), *suite.worlds("free", 1, 300), *suite.worlds("free", 2, 60)):
        own = {setting.partition("=")[0] for setting in world.settings} | {world.scenario, world.sensor}
        if own - seen:
            world.load("governed")
            seen |= own


@pytest.mark.parametrize(
    ("one", "kind"),
    [
        (row(1), "arrived"), (row(1, arrival=math.nan), "late"), (row(1, outcome="saturated", off=0.03), "short"),
        (row(1, outcome="fault", off=math.nan), "lost"), (row(1, outcome="held", off=math.nan), "held"),
        (row(1, outcome="refused", off=math.nan), "refused"), (row(1, off=0.0201), "short"),
        (row(1, off=0.02, outcome="held"), "arrived"),
    ],
)  # fmt: skip
def test_kind_of_a_row(one: Row, kind: str) -> None:
    assert kind_of(one) == kind


@pytest.mark.parametrize(("count", "found"), [(5, False), (6, True)])
def test_losses_that_chance_does_not_explain(count: int, found: bool) -> None:
    before = [row(k) for k in range(300)]
    now = [row(k, outcome="lost" if k < count else "ok") for k in range(300)]
    assert bool(worse(before, now)) is found
    assert worse(now, before) == []


@pytest.mark.parametrize(("slip", "count", "found"), [(2.9e-4, 100, False), (3.1e-4, 5, False), (3.1e-4, 6, True)])
def test_slip_path_that_grows_in_many_worlds(slip: float, count: int, found: bool) -> None:
    before = [row(k) for k in range(100)]
    now = [row(k, slip=slip if k < count else 0.0) for k in range(100)]
    assert bool(worse(before, now)) is found


def test_worlds_that_grew_against_those_that_shrank() -> None:
    before = [row(k, slip=1e-3) for k in range(100)]
    now = [row(k, slip=1.4e-3 if k < 9 else 5e-4 if k < 11 else 1.2e-3) for k in range(100)]
    (line,) = compare(before, now)
    assert (line.grown, line.shrunk) == (9, 2)
    assert line.p_grown == pytest.approx(2 * (1 + 11 + 55) / 2**11)  # 0, 1 or 2 of 11, and as many on the other side


def test_three_sets_are_judged_together() -> None:
    before = [row(k, name=f"one_arm_{s}") for s in range(3) for k in range(300)]
    now = [one | {"outcome": "lost"} if int(one["world"]) < 2 else one for one in before]
    assert [line.name for line in compare(before, now)] == ["one_arm_0", "one_arm_1", "one_arm_2", "one_arm, all"]
    (line,) = worse(before, now)
    assert line.startswith("governed in one_arm, all: lost: p 0.031")
