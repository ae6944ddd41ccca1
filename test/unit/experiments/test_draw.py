"""Drawn worlds: the same from a number whatever else is drawn, and what they differ in."""

from dataclasses import replace

import pytest

from slip_vic.experiments.draw import BANDWIDTH, KINDS, SPREAD, carries_weight, drawn_worlds
from slip_vic.experiments.run import run
from slip_vic.experiments.runner import under_laws
from slip_vic.experiments.world import World
from slip_vic.scenarios.scenario import load

PAIR = ("pane_two_arms_upright", "pane_two_arms_flat")


@pytest.fixture(scope="module")
def worlds() -> list[World]:
    return list(drawn_worlds(40, 3))


def test_a_world_depends_on_its_number_and_seed_alone() -> None:
    worlds = list(drawn_worlds(8, 1))
    assert list(drawn_worlds(4, 1)) == [world for world in worlds if world.number < 4]
    assert len({(world.scenario, world.sensor, world.seed, world.settings) for world in worlds}) == len(worlds) > 1
    assert worlds[0].settings != next(drawn_worlds(8, 2)).settings


def test_worlds_cover_every_scenario_motion_and_error(worlds: list[World]) -> None:
    assert 0 < len(worlds) < 40, "friction carries the weight in some alone"
    assert {world.scenario for world in worlds} == {"paper_planar", "vertical_plane", "glass_transport"}
    assert {world.motion for world in worlds} == set(KINDS)
    for world in worlds:
        known, drawn = load(world.scenario, law="vic").bridge, world.load("governed").bridge
        assert abs(drawn.object.mass / known.object.mass - 1.0) <= SPREAD
        assert abs(drawn.friction.mu_s / known.friction.mu_s - 1.0) <= SPREAD
        assert carries_weight(drawn)


def test_about_half_of_the_drives_take_velocities_or_positions(worlds: list[World]) -> None:
    arms = [world.load("governed") for world in worlds]
    assert {arm.bridge.drive.interface for arm in arms} == {"effort", "velocity", "position"}
    assert {arm.bridge.friction.model for arm in arms} == {"stribeck", "coulomb", "lugre"}
    assert 0.3 < sum(arm.bridge.drive.interface == "effort" for arm in arms) / len(arms) < 0.7
    for arm in arms:
        assert arm.controller.command.interface == arm.bridge.drive.interface
        if arm.bridge.drive.interface == "effort":
            assert 0.0 <= arm.bridge.drive.delay_s <= 4e-3
            assert max(map(abs, arm.bridge.drive.offset)) <= 0.2
            continue
        known = arm.controller.drive
        assert 0.0 < abs(arm.bridge.drive.bandwidth / known.bandwidth - 1.0) <= BANDWIDTH
        assert 0.0 <= arm.bridge.drive.delay_s - known.delay_s <= 4e-3 + 1e-12


def test_a_drive_that_is_given_is_that_of_all_worlds() -> None:
    assert {world.drive for world in drawn_worlds(5, 3, drive="ideal")} == {"ideal"}


def test_two_arms_have_troubles_of_their_own() -> None:
    worlds = list(drawn_worlds(12, 3, PAIR))
    assert [(world.scenario, world.arms) for world in worlds] == [(PAIR[k % 2], 2) for k in range(12)]
    assert len({world.sensor for world in worlds}) > 3
    for case in [world.load("governed") for world in worlds]:
        left, right = case.bridges["left"], case.bridges["right"]
        assert left.drive.interface == right.drive.interface == case.controllers["right"].command.interface
        assert left.sensors.wrench.bias != right.sensors.wrench.bias
        assert left.sensors.slip.faults.gain != right.sensors.slip.faults.gain


def test_worlds_of_two_arms_run() -> None:
    (world,) = drawn_worlds(1, 0, PAIR, "ideal")
    worlds = under_laws(
        [replace(world, settings=(*world.settings, "bridge.duration_s=0.03"))], ("classical", "vic", "printed")
    )
    assert {run(world)["outcome"] for world in worlds} <= {"ok", "held"}, "none is refused"
