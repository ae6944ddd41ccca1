"""`bag verify`: the same code gives the same bits, anything else is found."""

from __future__ import annotations

import dataclasses
import math
import re
from pathlib import Path

import numpy as np
import pytest

from slip_bags.reader import Bag
from slip_core.errors import InputError
from slip_core.files.resources import bounded_memory
from slip_core.params import flatten
from slip_vic.replay.run_data import read_run
from slip_vic.replay.verify import verify_run
from slip_vic.run.data import read_data
from slip_vic.scenarios.scenario import load
from slip_vic_controller.safety.conditions import Mode
from test.support.run_maker import TOPICS, attachments, record_run, with_parameters

SCENARIOS = ("paper_planar", "vertical_plane", "glass_transport")
CYCLES = 300
SLIPPING_CYCLES = 600  # in paper_planar the object slips by then
FLIPPED = 123
OF_OTHER_RUNS = {"/parameter_events", "/controller/reference_used", "/velocity_command"}
# Parameters whose last bit reaches the efforts while the object slips.
SENSITIVE = ("gains.gamma_kp", "gains.alpha", "object.mass", "nullspace.stiffness", "trajectory.duration_s")


def scenario(name: str = "paper_planar", controller: str = "vic", cycles: int = CYCLES, mode: str = "lockstep"):
    return load(name, law=controller, mode=mode, set=(f"bridge.duration_s={cycles / 1000}",))


def verdict(folder: Path):
    return verify_run(bounded_memory("bag")(read_run)(Bag(folder)))


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("verify") / "bag"
    record_run(folder, scenario(cycles=SLIPPING_CYCLES))
    return folder


@pytest.mark.parametrize("controller", ["vic", "classical"])
@pytest.mark.parametrize("name", SCENARIOS)
def test_lockstep_runs_are_identical(tmp_path, name, controller):
    record_run(tmp_path / "bag", scenario(name, controller))
    result = verdict(tmp_path / "bag")
    assert result.text() == f"identical: {CYCLES} cycles, {7 * CYCLES} efforts, to the last bit"


@pytest.mark.parametrize(
    ("drive", "lacks", "kind"),
    [
        ("velocity_500", "controller.wrench.source=none", "velocities"),  # no wrench message, and none is missing
        ("torque_joint", "bridge.sensors.joint.velocity=false", "efforts"),  # the cycle works with others than recorded
    ],
)
def test_a_run_that_lacks_a_sensor_is_identical(tmp_path, drive, lacks, kind):
    loaded = load("paper_planar", law="governed", drive=drive, set=(lacks, "bridge.duration_s=0.6"))
    record_run(tmp_path / "bag", loaded)
    bag = Bag(tmp_path / "bag")
    assert (bag.topics["/wrench"].message_count == 0) is ("wrench" in lacks)
    assert {"HOLD", "ACTIVE"} <= {Mode(entry.mode).name for entry in read_run(bag)[""].ledger}
    assert verdict(tmp_path / "bag").text() == f"identical: 600 cycles, 4200 {kind}, to the last bit"


@pytest.mark.parametrize("name", SENSITIVE)
def test_last_bit_of_a_parameter_is_caught(recorded, name):
    bag = Bag(recorded)
    runs = read_run(bag)
    value = flatten(runs[""].params)[name]
    result = verify_run(with_parameters(runs, **{name: math.nextafter(value, math.inf)}))
    assert not result.identical
    assert "effort_command" in result.first


def test_last_bit_of_one_recorded_effort_is_caught(tmp_path):
    def flip(tick, effort):
        if tick.result.ledger[0] == FLIPPED:
            effort[4] = np.nextafter(effort[4], math.inf)
        return effort

    record_run(tmp_path / "bag", scenario(), change=flip)
    result = verdict(tmp_path / "bag")
    recorded, replayed = map(float, re.findall(r"(?:recorded|replayed) (\S+?)(?:,|$)", result.first))
    assert result.different == 1
    assert result.first.startswith(f"cycle {FLIPPED} (stamp")
    assert "s), effort_command, arm_joint5: recorded" in result.text()
    assert recorded == math.nextafter(replayed, math.inf)


def test_another_squeeze_is_found():
    run = read_run(Bag(Path("bags/grip_follows")))[""]
    squeezes = list(run.squeezes)
    squeezes[100] = math.nextafter(squeezes[100], 0.0)
    result = verify_run({"": dataclasses.replace(run, squeezes=tuple(squeezes))})
    assert result.different == 1
    assert "grip_command: recorded" in result.first


def test_parameters_that_change_on_the_way(tmp_path):
    """Two changes, each ramping; without knowing of them the replay would not agree."""
    retune = {100: {"gains.gamma_kp": 50.0}, 200: {"object.mass": 0.55, "gains.alpha": 90.0}}
    record_run(tmp_path / "bag", scenario(cycles=SLIPPING_CYCLES), retune=retune)
    assert verdict(tmp_path / "bag").identical
    bag = Bag(tmp_path / "bag")
    unchanged = {"": dataclasses.replace(read_run(bag)[""], changes={})}
    assert not verify_run(unchanged).identical


@pytest.mark.parametrize("topic", sorted(set(TOPICS) - OF_OTHER_RUNS))
def test_a_lost_message_is_named(tmp_path, topic):
    record_run(tmp_path / "bag", scenario(), skip=[(topic, 50)])
    with pytest.raises(
        InputError, match="got 1 messages lost; the first that does not follow is number 51 behind number 49"
    ):
        verdict(tmp_path / "bag")


def test_what_cannot_be_verified_says_why(tmp_path):
    whole, manifest = attachments(scenario()), "controller.params.yaml"
    for number, (given, what) in enumerate((
        ({"first": 10}, "a beginning at cycle 10"), ({"attached": {}}, "slip-vic run --record"),
        ({"attached": {**whole, manifest: b"- 1"}}, "bag: got .* expected a file as this suite writes it"),
        ({"attached": {**whole, manifest: b"\xff"}}, "binary"),
        ({"attached": {**whole, manifest: b"a: {ros__parameters: {arms: 5}}"}}, "parameter arms: got 5"),
    )):  # fmt: skip
        record_run(tmp_path / str(number), scenario(cycles=20), **given)
        with pytest.raises(InputError, match=what):
            verdict(tmp_path / str(number))


@pytest.mark.parametrize("topic", ["/slip_velocity", "/parameter_events"])
def test_a_topic_of_another_type_is_named(tmp_path, monkeypatch, topic):
    monkeypatch.setattr("test.support.run_maker.TOPICS", TOPICS | {topic: "geometry_msgs/msg/WrenchStamped"})
    record_run(tmp_path / "bag", scenario(cycles=10))
    for read in (verdict, read_data) if topic == "/slip_velocity" else (verdict,):
        with pytest.raises(InputError, match=f"topic {topic} of .*: got geometry_.*, expected {TOPICS[topic]}"):
            read(tmp_path / "bag")
