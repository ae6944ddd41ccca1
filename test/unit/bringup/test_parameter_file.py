"""A parameter file of the controller, as bring-up and search write it, on its way into a run."""

from __future__ import annotations

from pathlib import Path

import pytest

from slip_core.errors import InputError
from slip_core.params import flatten
from slip_vic.run.demo import all_laws
from slip_vic.scenarios.parameter_files import check_writable
from slip_vic.scenarios.scenario import load_scenario, read_parameters, ros_parameter_file

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
    run = load_scenario("paper_planar", law="governed", parameters=found).controller
    assert (run.slip_sensor.rate_hz, run.governor.friction_limit, run.governor.mode) == (30.0, 0.2, "slow_down")
    assert run.mode == "lockstep"
    named = load_scenario("paper_planar", sensor="vision_25", parameters=found).controller
    assert named.slip_sensor.rate_hz == 25.0
    told = load_scenario(
        "paper_planar", law="vic", parameters=found, assignments=("controller.slip_sensor.rate_hz=50.0",)
    )
    assert told.controller.slip_sensor.rate_hz == 50.0


def test_it_replaces_what_the_scenario_file_tells_of_the_sensor(file: Path, tmp_path: Path) -> None:
    text = load_scenario("paper_planar").text.replace("controller:\n", "controller:\n  slip_sensor.rate_hz: 100.0\n", 1)
    (tmp_path / "mine.yaml").write_text(text)
    mine = str(tmp_path / "mine.yaml")
    assert load_scenario(mine).controller.slip_sensor.rate_hz == 100.0
    assert load_scenario(mine, parameters=read_parameters(file)).controller.slip_sensor.rate_hz == 30.0


def test_the_controllers_of_a_demo_stay_what_they_are(file: Path) -> None:
    governed = ", controller: vic, governor.mode: slow_down, gains.spin: bounded, mode: realtime"
    file.write_text(MEASURED.replace(", mode: realtime", governed))
    found, plain = (all_laws({"scenario": "paper_planar", "parameters": given}) for given in (file, None))
    for kind, scenario in found.items():
        measured = {"slip_sensor.rate_hz": 30.0, "governor.friction_limit": 0.2}
        assert flatten(scenario.controller) == flatten(plain[kind].controller) | measured, kind


def test_the_file_of_a_whole_controller_gives_that_controller(tmp_path: Path) -> None:
    path = tmp_path / "controller.yaml"
    scenario = load_scenario("vertical_plane", law="governed", assignments=("controller.gains.k_s=321.0",))
    path.write_text(ros_parameter_file(scenario.controller, "slip_vic_controller", complete=False))
    again = load_scenario("vertical_plane", law="governed", parameters=read_parameters(path))
    assert again.controller == scenario.controller


def test_a_file_that_cannot_be_written_is_found_before_and_one_that_is_there_stays(tmp_path: Path) -> None:
    there = tmp_path / "there.yaml"
    there.write_text("kept")
    check_writable(there)
    check_writable(tmp_path / "new" / "file.yaml")
    assert there.read_text() == "kept"
    assert not (tmp_path / "new" / "file.yaml").exists()
    with pytest.raises(InputError, match="a file that can be written"):
        check_writable(Path("/proc/bringup.yaml"))
