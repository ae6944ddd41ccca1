"""A parameter that was renamed: the old name works for one release, wherever it is given, with one warning line."""

from __future__ import annotations

import inspect
import logging
import re
from pathlib import Path

import pytest

from slip_core.errors import InputError
from slip_core.params import (
    OLD_NAMES_END,
    ParameterModel,
    build,
    current_names,
    flatten,
    is_name,
    old_names,
    parameter,
    parameter_infos,
)
from slip_vic.scenarios import scenario_text
from slip_vic.scenarios.parameter_files import config_files, parameter_page
from slip_vic.scenarios.scenario import NODES, load_scenario
from slip_vic.study.check import Question
from slip_vic_controller.params import ControllerParams

ROOT = Path(__file__).parents[3]
OLD = {
    "gains.spin_lever": "gains.characteristic_length",
    "observer.rough_linear": "observer.process_noise_linear",
    "observer.rough_angular": "observer.process_noise_angular",
    "observer.floor_linear": "observer.min_slip_std_m_s",
    "observer.floor_angular": "observer.min_slip_std_rad_s",
    "observer.rest_linear": "observer.stick_acceleration_std_m_s2",
    "observer.rest_angular": "observer.stick_acceleration_std_rad_s2",
    "observer.calm_linear": "observer.stick_speed_std_m_s",
    "observer.calm_angular": "observer.stick_speed_std_rad_s",
}


class Group(ParameterModel):
    length: float = parameter(1.0, "a length", formerly="group.lever")
    width: float = parameter(2.0, "a width", formerly="span")
    other: float = parameter(3.0, "something else")


class Model(ParameterModel):
    group: Group = Group()


def values_and_lines(values: dict[str, object]) -> tuple[dict[str, object], list[str]]:
    lines: list[str] = []
    return flatten(build(Model, values, "file.yaml", warn=lines.append)), lines


def lines_of(caplog: pytest.LogCaptureFixture) -> list[str]:
    return [record.getMessage() for record in caplog.records if record.levelno == logging.WARNING]


def test_an_old_name_sets_the_parameter_and_warns_in_one_line() -> None:
    """Dotted and nested, within the same group or from another place."""
    for given in ({"group.lever": 5.0}, {"group": {"lever": 5.0}}):
        values, lines = values_and_lines(given)
        assert values == {"group.length": 5.0, "group.width": 2.0, "group.other": 3.0}
        assert lines == [
            "file.yaml: parameter group.lever is now called group.length; "
            f"the old name works until version {OLD_NAMES_END}"
        ]
    values, lines = values_and_lines({"span": 7.0, "group.lever": 5.0})
    assert (values["group.width"], values["group.length"]) == (7.0, 5.0)
    assert len(lines) == 1
    assert all(word in lines[0] for word in ("span", "group.width", "group.lever", "group.length", OLD_NAMES_END))


def test_the_name_of_today_gives_no_warning() -> None:
    values, lines = values_and_lines({"group.length": 5.0, "group.other": 1.0})
    assert values["group.length"] == 5.0
    assert lines == []


def test_both_names_at_once_are_refused() -> None:
    with pytest.raises(InputError, match=r"group\.length.*old name group\.lever.*one of the two"):
        values_and_lines({"group": {"length": 1.0, "lever": 2.0}})


def test_a_value_under_an_old_name_is_checked_like_any_other() -> None:
    with pytest.raises(InputError, match=r"group\.length: got wide, expected a valid number"):
        values_and_lines({"group.lever": "wide"})


def test_suggestions_know_both_names() -> None:
    with pytest.raises(InputError, match=r"did you mean group\.length \(formerly group\.lever\)"):
        values_and_lines({"group.levr": 1.0})
    with pytest.raises(InputError, match=r"did you mean group\.length"):
        values_and_lines({"group.lengt": 1.0})
    with pytest.raises(
        InputError, match=r"did you mean .*gains\.characteristic_length \(formerly .*gains\.spin_lever\)"
    ):
        load_scenario("paper_planar", assignments=["controller.gains.spin_levr=0.1"])


def test_a_line_is_logged_once_in_a_process(caplog: pytest.LogCaptureFixture) -> None:
    for _ in range(3):
        build(Model, {"group.lever": 1.0}, "read three times.yaml")
    assert len(lines_of(caplog)) == 1
    assert lines_of(caplog)[0].startswith("warning: read three times.yaml: ")


def test_the_renamed_parameters() -> None:
    """All of them, each with a value of its own that arrives under the new name."""
    assert dict(old_names(ControllerParams)) == OLD
    values = {name: 0.001 * (i + 1) for i, name in enumerate(OLD)}
    built = flatten(build(ControllerParams, values, "test", warn=lambda _: None))
    assert {name: built[OLD[name]] for name in OLD} == values
    for name in OLD:
        assert is_name(ControllerParams, name)
        assert name not in built


def test_no_old_name_hides_a_parameter() -> None:
    """An old name is never also a name of today, and stands for one parameter only."""
    for _, model in NODES.values():
        infos = list(parameter_infos(model))
        old = [info.formerly for info in infos if info.formerly]
        assert len(old) == len(set(old))
        assert not {info.name for info in infos} & set(old)


def test_old_names_end_with_the_release_that_says_so() -> None:
    """When the version gets there, this fails until the old names (or this line) are gone."""
    version = re.search(r'version="([\d.]+)"', (ROOT / "src/slip_core/setup.py").read_text())
    assert version
    ended = tuple(map(int, version.group(1).split("."))) >= tuple(map(int, OLD_NAMES_END.split(".")))
    assert not (ended and any(old_names(model) for _, model in NODES.values()))


def test_set_takes_old_names(caplog: pytest.LogCaptureFixture) -> None:
    scenario = load_scenario("paper_planar", assignments=["controller.gains.spin_lever=0.07"])
    assert scenario.controller.gains.characteristic_length == 0.07
    shared = load_scenario("paper_planar", assignments=["gains.spin_lever=0.08"])
    assert shared.controller.gains.characteristic_length == 0.08
    assert [line for line in lines_of(caplog) if "--set controller.gains.spin_lever" in line and OLD_NAMES_END in line]


def test_a_scenario_file_may_use_old_names_and_set_overrules_them(tmp_path: Path) -> None:
    text = scenario_text("paper_planar").replace("controller:\n", "controller:\n  observer.calm_linear: 0.25\n", 1)
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    assert load_scenario(str(path)).controller.observer.stick_speed_std_m_s == 0.25
    later = load_scenario(str(path), assignments=["controller.observer.stick_speed_std_m_s=0.5"])
    assert later.controller.observer.stick_speed_std_m_s == 0.5


def test_a_parameter_file_and_a_sensor_file_may_use_old_names(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    file = tmp_path / "gains.yaml"
    file.write_text("/**/slip_vic_controller: {ros__parameters: {gains: {spin_lever: 0.06, k_s: 77.0}}}\n")
    question = Question("paper_planar", "vic", file=file)
    assert question.gains().asked == 77.0
    sensor = tmp_path / "sensor.yaml"
    sensor.write_text("description: d\nsources: s\ncontroller: {gains.spin_lever: 0.09}\n")
    assert load_scenario("paper_planar", sensor=str(sensor)).controller.gains.characteristic_length == 0.09
    assert len([line for line in lines_of(caplog) if "gains.spin_lever" in line]) == 2


def test_names_that_nobody_knows_stay_for_the_error_that_names_them() -> None:
    assert current_names(Model, {"nonsense": 1.0}, "x") == {"nonsense": 1.0}


def test_the_reference_page_lists_them_and_the_files_do_not_use_them() -> None:
    page = parameter_page()
    for old, new in OLD.items():
        assert f"| `{old}` | `{new}` |" in page
    for text in config_files(["paper_planar"], complete=True).values():
        assert not [old for old in OLD if f"{old.split('.')[1]}:" in text]
        assert "characteristic_length:" in text or "slip_sim_bridge" in text


def test_every_description_stands_alone() -> None:
    """No description refers to the line above it."""
    leaning = re.compile(r"^(and|the same|share of that|that|it|or) ", re.IGNORECASE)
    for _, model in NODES.values():
        assert not [info.name for info in parameter_infos(model) if leaning.match(info.description)]
        assert not [info.name for info in parameter_infos(model) if len(info.description.split()) < 2]


def test_the_warning_has_one_declaration() -> None:
    """The old name stands at the parameter and nowhere else in the sources."""
    declared = inspect.getsource(__import__("slip_vic_controller.parameters.slip_params", fromlist=["x"]))
    assert declared.count('"observer.calm_linear"') == 1
    found = [p for p in (ROOT / "src").rglob("*.py") if '"observer.calm_linear"' in p.read_text()]
    assert [path.name for path in found] == ["slip_params.py"]
