"""An arm without a wrench sensor: the load is the model's, and the law works with it."""

from __future__ import annotations

import numpy as np

import slip_vic
from slip_core.arrays import Array
from slip_vic.run.in_process import run_in_process
from slip_vic.scenarios.scenario import load_scenario
from test.support.every import every

NONE, SHORT = "controller.wrench.source=none", "bridge.duration_s=3.2"


@every(
    ("drive", "scenario", "off_mm"),
    (
        ("torque_joint", "glass_transport", 1.0), ("position_250", "vertical_plane", 0.1),
        ("velocity_500", "paper_planar", 0.1), ("velocity_500", "pane_two_arms_flat", 0.5),
    ),
)  # fmt: skip
def test_a_governed_arm_carries_what_it_does_not_weigh(drive: str, scenario: str, off_mm: float) -> None:
    run = slip_vic.load(scenario, law="governed", drive=drive, sensor="event_1000", set=(NONE, SHORT)).run()
    assert run.outcome == "ok", run.reason
    assert run.slip_mm < 0.2
    assert run.final_error_mm < off_mm


@every(
    ("mismatch", "drive", "most_mm"),
    (("mass=1.2", "velocity_500", 1.0), ("friction=0.8", "velocity_500", 1.0)),
)
def test_an_object_that_is_not_as_told_is_carried_too(mismatch: str, drive: str, most_mm: float) -> None:
    world = (NONE, SHORT, f"mismatch.{mismatch}")
    run = slip_vic.load("paper_planar", law="governed", drive=drive, sensor="event_1000", set=world).run()
    assert run.outcome == "ok", run.reason
    assert run.slip_mm < most_mm


def loads(scenario: str, source: str, until_s: float) -> list[list[Array]]:
    """Return the wrenches that the law of each arm works with, of each of its contacts, at some time."""
    told = (f"controller.wrench.source={source}", f"bridge.duration_s={until_s}")
    for tick in run_in_process(load_scenario(scenario, law="governed", assignments=told)):
        last = tick
    count = len(last.results)
    return [[result.record.samples[k].wrench.copy() for k in range(count)] for result in last.results]


@every(
    ("scenario", "until_s", "force", "torque"),
    (
        ("vertical_plane", 0.01, 0.01, 0.002), ("glass_transport", 0.01, 0.01, 0.002),
        ("pane_two_arms_upright", 0.01, 0.01, 0.002),
        # In motion without what turns; how two arms pull at each other no model knows.
        ("vertical_plane", 0.5, 0.025, 0.01), ("glass_transport", 0.5, 0.025, 0.01),
    ),
)  # fmt: skip
def test_the_models_load_is_that_of_a_sensor(scenario: str, until_s: float, force: float, torque: float) -> None:
    """That of each contact on the axes of its own pad."""
    pairs = zip(loads(scenario, "none", until_s), loads(scenario, "sensor", until_s), strict=True)
    for model, measured in pairs:
        beyond = np.abs(np.array(model) - np.array(measured))
        assert beyond[:, :3].max() < force
        assert beyond[:, 3:].max() < torque


def test_the_simulation_has_no_wrench_sensor_then() -> None:
    """So neither bridge nor recorder waits for a subscription to its topic."""
    world = load_scenario("paper_planar", law="governed", sensor="event_1000", assignments=(NONE,))
    assert world.bridge.sensors.wrench.silent
    assert not load_scenario("paper_planar", law="governed").bridge.sensors.wrench.silent
