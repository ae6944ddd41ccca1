"""Drawn worlds: the same from a number whatever else is drawn, and what they differ in."""

import pytest

from slip_vic.cli import main
from slip_vic.experiments.draw import BANDWIDTH, KINDS, SPREAD, draw, drawn_worlds
from slip_vic.experiments.run import run
from slip_vic.scenarios.scenario import load_scenario


def test_a_world_depends_on_its_number_and_seed_alone() -> None:
    assert draw(5, 1) == draw(5, 1)
    assert draw(5, 1) != draw(6, 1)
    assert draw(5, 1) != draw(5, 2)


def test_worlds_cover_every_scenario_motion_and_error() -> None:
    worlds = [world for number in range(40) if (world := draw(number, 3, drives=False))]
    assert 0 < len(worlds) < 40, "friction carries the weight in some alone"
    assert {world.scenario for world in worlds} == {"paper_planar", "vertical_plane", "glass_transport"}
    assert {world.motion for world in worlds} == set(KINDS)
    for world in worlds:
        known, drawn = load_scenario(world.scenario).bridge, world.load("governed", "observer").bridge
        assert abs(drawn.object.mass / known.object.mass - 1.0) <= SPREAD
        assert abs(drawn.friction.mu_s / known.friction.mu_s - 1.0) <= SPREAD


def test_half_of_the_drives_take_velocities_or_positions() -> None:
    worlds = [world for number in range(40) if (world := draw(number, 3))]
    arms = [world.load("governed", "observer") for world in worlds]
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


def test_several_arms_have_one_drive_and_each_its_own_joints() -> None:
    scenarios = ["pane_two_arms_flat"]
    worlds = [world for number in range(20) if (world := draw(number, 3, scenarios))]
    plain = [world for number in range(20) if (world := draw(number, 3, scenarios, drives=False))]
    assert all(one.settings[: len(bare.settings)] == bare.settings for bare, one in zip(plain, worlds, strict=True))
    assert len({world.sensor for world in worlds}) > 3
    for case in [world.load("governed") for world in worlds]:
        left, right = case.bridges["left"], case.bridges["right"]
        assert left.drive.interface == right.drive.interface == case.controllers["right"].command.interface
        assert left.sensors.wrench.bias != right.sensors.wrench.bias
        assert left.sensors.slip.faults.gain != right.sensors.slip.faults.gain


def test_worlds_of_two_arms_take_turns_and_run() -> None:
    pair, short = ["pane_two_arms_upright", "pane_two_arms_flat"], ("bridge.duration_s=0.03",)
    worlds = list(drawn_worlds(2, 0, pair, drives=False, assignments=short))
    assert [(world.scenario, world.arms) for world in worlds] == [(pair[0], 2), (pair[1], 2)]
    assert {run(world, law).outcome for world in worlds for law in ("classical", "vic", "printed")} == {"ok"}


def test_an_option_that_the_lottery_would_not_use_is_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["slip-vic", "study", "--lottery", "1", "--sensor", "ideal"])
    assert main() == 2
    assert "takes no --sensor" in capsys.readouterr().err
