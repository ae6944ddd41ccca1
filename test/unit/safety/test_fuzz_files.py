"""Whatever a parameter, a URDF or a scenario file says: accepted, or refused in one line; never anything else."""

from __future__ import annotations

import random
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from slip_core.errors import InputError, SlipVicError
from slip_core.params import ParameterModel, build, flat_names, flatten, parameter_infos
from slip_vic.scenarios import scenario_names, scenario_text
from slip_vic.scenarios.scenario import NODES, Scenario, load_scenario
from slip_vic_controller.arm.robot import Robot
from slip_vic_controller.session.controller import Controller
from test.support.one_arm import one_arm
from test.unit.bridge.one_arm import OneArm

MANY = settings(max_examples=60)
SLOW = settings(max_examples=15)  # unknown names are compared with all known ones
MODELS = {name: model for name, (_, model) in NODES.items()}
LEAVES = [(name, info.name) for name, model in MODELS.items() for info in parameter_infos(model)]
odd = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=8), st.binary(max_size=4), st.dates(),
    st.sampled_from([0, -1, 1e308, -1e-308, 2**63, 10**400, "nan", "", "\0", "1e3", "package://x/y"]),
)  # fmt: skip
values = st.recursive(odd, lambda inner: st.lists(inner, max_size=7) | st.dictionaries(st.text(max_size=4), inner))


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load_scenario("paper_planar")


def make_controller(params: Any, urdf: str) -> Controller:
    return one_arm(params, urdf, lockstep=True)


def one_line(action: Callable[[], Any]) -> Any | None:
    """Return what an action returns, None where it refuses its input in one line; any other exception is a crash."""
    try:
        return action()
    except SlipVicError as error:
        refused = error
    assert isinstance(refused, InputError)
    assert str(refused)
    assert "\n" not in str(refused)
    return None


@given(data=st.data(), node=st.sampled_from(sorted(MODELS)))
@MANY
def test_any_value_of_any_parameter(scenario: Scenario, node: str, data: st.DataObject) -> None:
    flat = flatten(getattr(scenario, node))
    names = data.draw(st.lists(st.sampled_from(sorted(flat)), min_size=1, max_size=3))
    flat |= {name: data.draw(values, label=name) for name in names}
    params = one_line(lambda: build(MODELS[node], flat, "fuzz"))
    if params is not None:
        assert isinstance(params, ParameterModel)
        again = build(MODELS[node], flatten(params), "again")
        assert flatten(again) == flatten(params)


@given(
    changes=st.lists(
        st.tuples(st.sampled_from(LEAVES), st.sampled_from([0, 0.0, -1.0, 1e-300, 1e-9, 1e9, 1e300, 0.5, 2, 10**6])),
        min_size=1,
        max_size=3,
    )
)
@MANY
def test_numbers_that_are_accepted_make_a_law_and_a_simulation(
    scenario: Scenario, changes: list[tuple[tuple[str, str], Any]]
) -> None:
    """What the model lets pass may still not fit together: then that is said in one line as well."""
    flats = {name: flatten(getattr(scenario, name)) for name in MODELS}
    for (node, name), value in changes:
        before = flats[node][name]
        flats[node][name] = [value] * len(before) if isinstance(before, list) else value
    for node, make in (("controller", make_controller), ("bridge", OneArm)):
        params = one_line(lambda node=node: build(MODELS[node], flats[node], "fuzz"))
        if params is not None:
            one_line(lambda make=make, params=params: make(params, scenario.urdf))


def mutated_text(text: str, seed: int, count: int) -> str:
    """Cut, copy, swap and overwrite parts of a text, lines and numbers above all."""
    rng = random.Random(seed)
    for _ in range(count):
        lines = text.split("\n")
        kind, at = rng.randrange(7), rng.randrange(len(lines))
        if kind == 0:
            del lines[at]
        elif kind == 1:
            lines.insert(rng.randrange(len(lines)), lines[at])
        elif kind == 2:
            lines[at] = lines[at][: rng.randrange(len(lines[at]) + 1)]
        elif kind == 3:
            words = [
                "nan",
                "-1",
                "0",
                "1e999",
                "[]",
                "{",
                "&a *a",
                "!!python/object:os.system",
                "~",
                "\t",
                '"',
                "ü",
                "<",
            ]
            place = rng.randrange(len(lines[at]) + 1)
            lines[at] = lines[at][:place] + rng.choice(words) + lines[at][place:]
        elif kind == 4:
            digits = [i for i, c in enumerate(lines[at]) if c.isdigit()]
            if digits:
                i = rng.choice(digits)
                lines[at] = lines[at][:i] + rng.choice(["-", "", "9e99", "0", "x"]) + lines[at][i + 1 :]
        elif kind == 5:
            lines = lines[:at]
        else:
            other = rng.randrange(len(lines))
            lines[at], lines[other] = lines[other], lines[at]
        text = "\n".join(lines) or " "
    return text


@given(name=st.sampled_from(scenario_names(1)), seed=st.integers(0, 10**6), count=st.integers(1, 4))
@MANY
def test_scenario_files(name: str, seed: int, count: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "s.yaml"
        path.write_text(mutated_text(scenario_text(name), seed, count), encoding="utf-8")
        one_line(lambda: load_scenario(str(path)))


@given(parts=st.dictionaries(st.sampled_from(["name", "description", "duration_s", "shared", "controller"]), values))
@SLOW
def test_scenario_files_of_the_right_outer_form(parts: dict[str, Any]) -> None:
    text = scenario_text("paper_planar")
    content = yaml.safe_load(text) | parts
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "s.yaml"
        path.write_text(yaml.safe_dump(content), encoding="utf-8")
        one_line(lambda: load_scenario(str(path)))
    assert flat_names(yaml.safe_load(text))


@given(seed=st.integers(0, 10**6), count=st.integers(1, 5))
@MANY
def test_urdf_texts(scenario: Scenario, seed: int, count: int) -> None:
    text = mutated_text(scenario.urdf, seed, count)
    controller = scenario.controller
    one_line(lambda: Robot(text, controller.ee_frame, controller.joint_names))
    one_line(lambda: OneArm(scenario.bridge, text))
