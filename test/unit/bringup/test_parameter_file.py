"""A parameter file of the controller, as bring-up and search write it, on its way into a run."""

from __future__ import annotations

from pathlib import Path

import pytest

from slip_core.errors import InputError
from slip_core.params import flatten
from slip_vic.run.demo import all_laws
from slip_vic.scenarios.parameter_files import commented_file, write_files
from slip_vic.scenarios.scenario import load, read_parameters

MEASURED = """
/**/slip_sim_bridge:
  ros__parameters: {friction: {mu_s: 0.4}}
/left/slip_vic_controller:
  ros__parameters: {slip_sensor: {rate_hz: 30.0}, governor: {friction_limit: 0.2}, mode: realtime}
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "measured.yaml"
    path.write_text(MEASURED)
    return path


def test_what_was_measured_reaches_the_run_and_the_command_has_the_last_word(file: Path) -> None:
    found = read_parameters(file)
    run = load("paper_planar", law="governed", parameters=found).controller
    assert (run.slip_sensor.rate_hz, run.governor.friction_limit, run.governor.mode) == (30.0, 0.2, "slow_down")
    assert run.mode == "lockstep"
    named = load("paper_planar", law="vic", sensor="vision_25", parameters=found).controller
    assert named.slip_sensor.rate_hz == 25.0
    told = load("paper_planar", law="vic", parameters=found, set=("controller.slip_sensor.rate_hz=50.0",))
    assert told.controller.slip_sensor.rate_hz == 50.0


def test_it_replaces_what_the_scenario_file_tells_of_the_sensor(file: Path, tmp_path: Path) -> None:
    text = load("paper_planar", law="vic").text.replace(
        "controller:\n", "controller:\n  slip_sensor.rate_hz: 100.0\n", 1
    )
    (tmp_path / "mine.yaml").write_text(text)
    mine = str(tmp_path / "mine.yaml")
    assert load(mine, law="vic").controller.slip_sensor.rate_hz == 100.0
    assert load(mine, law="vic", parameters=read_parameters(file)).controller.slip_sensor.rate_hz == 30.0


def test_the_controllers_of_a_demo_stay_what_they_are(file: Path) -> None:
    governed = ", controller: vic, governor.mode: slow_down, gains.spin: bounded, mode: realtime"
    file.write_text(MEASURED.replace(", mode: realtime", governed))
    found, plain = (all_laws({"scenario": "paper_planar", "parameters": given}) for given in (file, None))
    for kind, scenario in found.items():
        measured = {"slip_sensor.rate_hz": 30.0, "governor.friction_limit": 0.2}
        assert flatten(scenario.controller) == flatten(plain[kind].controller) | measured, kind


def test_the_file_of_a_whole_controller_gives_that_controller(tmp_path: Path) -> None:
    path = tmp_path / "controller.yaml"
    scenario = load("vertical_plane", law="governed", set=("controller.gains.k_s=321.0",))
    path.write_text(commented_file(scenario.controller, "slip_vic_controller"))
    again = load("vertical_plane", law="governed", parameters=read_parameters(path))
    assert again.controller == scenario.controller


def test_a_folder_that_cannot_be_written_is_found_before(tmp_path: Path) -> None:
    write_files(tmp_path / "new" / "folder", {})
    with pytest.raises(InputError, match="a folder that can be written"):
        write_files(Path("/proc/bringup"), {})
