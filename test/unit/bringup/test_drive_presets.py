"""Named drives: every file loads, both nodes get what they know, and an arm of any size can have them."""

from __future__ import annotations

import pytest

from slip_core.errors import UnknownName
from slip_core.params import flatten, parameter_infos
from slip_vic.presets import preset_names
from slip_vic.presets.models import DrivePreset, load_preset
from slip_vic.scenarios.scenario import apply_preset, load
from slip_vic_controller.params.controller_params import ControllerParams

NAMES = preset_names("drives")
KNOWN = {info.name for info in parameter_infos(ControllerParams)}


def test_ideal_drives_are_the_defaults() -> None:
    assert load("paper_planar", law="vic", drive="ideal") == load("paper_planar", law="vic")


@pytest.mark.parametrize("name", NAMES)
def test_both_nodes_are_configured(name: str) -> None:
    loaded, preset = load("paper_planar", law="vic", drive=name), load_preset(DrivePreset, name)
    assert loaded.bridge.drive == preset.drive
    assert loaded.bridge.sensors.joint == preset.joint
    assert loaded.controller.command.interface == preset.drive.interface
    known = flatten(loaded.controller)
    for part, values in (("drive", preset.drive), ("joint_sensor", preset.joint)):
        for key, value in flatten(values).items():
            assert f"{part}.{key}" not in KNOWN or known[f"{part}.{key}"] == value
    pair = load("pane_two_arms_flat", law="vic", drive=name)
    assert all(arm.drive == preset.drive for arm in pair.bridges.values())


@pytest.mark.parametrize("joints", [5, 6, 7, 9])
def test_lists_fit_an_arm_of_any_size(joints: int) -> None:
    values = {"controller": {}, "bridge": {"joint_names": [f"joint_{i}" for i in range(joints)]}}
    apply_preset(values, load_preset(DrivePreset, "motor_current"))
    coulomb = values["bridge"]["drive.coulomb"]
    assert len(coulomb) == joints
    assert coulomb[:5] == [3.0, 3.0, 2.4, 2.4, 1.2]
    assert values["bridge"]["drive.viscous"] == [1.0]


def test_a_mistyped_name_is_answered() -> None:
    with pytest.raises(UnknownName, match="velocity_500"):
        load_preset(DrivePreset, "velocity_50")
