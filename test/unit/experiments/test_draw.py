"""Drawn worlds: the same from a number whatever else is drawn, and what they differ in."""

from dataclasses import replace

import pytest

from slip_vic.experiments.draw import KINDS, drawn_worlds
from slip_vic.experiments.run import run
from slip_vic.experiments.runner import under_laws
from slip_vic.experiments.world import World
from slip_vic.run.versions import digest

PAIR = ("pane_two_arms_upright", "pane_two_arms_flat")


@pytest.fixture(scope="module")
def worlds() -> list[World]:
    return list(drawn_worlds(40, 3))


def test_a_world_depends_on_its_number_and_seed_alone() -> None:
    worlds = list(drawn_worlds(8, 1))
    assert list(drawn_worlds(4, 1)) == [world for world in worlds if world.number < 4]
    assert len({(world.scenario, world.sensor, world.seed, world.settings) for world in worlds}) == len(worlds) > 1


def test_sets_stay_what_they_were(worlds: list[World]) -> None:
    """Rows name their worlds by set and number."""
    assert digest(world.digest.encode() for world in (*worlds, *drawn_worlds(12, 3, PAIR))) == "8df5904d7394419e"


def test_worlds_cover_every_scenario_motion_and_error(worlds: list[World]) -> None:
    assert {world.scenario for world in worlds} == {"paper_planar", "vertical_plane", "glass_transport"}
    assert {world.motion for world in worlds} == set(KINDS)


def test_a_drive_that_is_given_is_that_of_all_worlds() -> None:
    drawn = drawn_worlds(5, 3, drive="ideal", assignments=["object.mass=0.4"])
    assert {(world.drive, "object.mass=0.4" in world.settings) for world in drawn} == {("ideal", True)}


def test_two_arms_have_troubles_of_their_own() -> None:
    worlds = list(drawn_worlds(12, 3, PAIR))
    assert [(world.scenario, world.arms) for world in worlds] == [(PAIR[k % 2], 2) for k in range(12)]


def test_worlds_of_two_arms_run() -> None:
    (world,) = drawn_worlds(1, 0, PAIR, "ideal")
    worlds = under_laws(
        [replace(world, settings=(*world.settings, "bridge.duration_s=0.03"))], ("classical", "vic", "printed")
    )
    assert {run(world)["outcome"] for world in worlds} <= {"ok", "held"}, "none is refused"
