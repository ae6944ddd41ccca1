"""An arm without a wrench sensor: the load is the model's, and the law works with it."""

from __future__ import annotations

import numpy as np
import pytest

from slip_core.arrays import Array
from slip_vic.run.in_process import run_in_process
from slip_vic.scenarios.scenario import load


def loads(scenario: str, source: str, until_s: float) -> list[list[Array]]:
    """Return the wrenches that the law of each arm works with, of each of its contacts, at some time."""
    told = (f"controller.wrench.source={source}", f"bridge.duration_s={until_s}")
    for tick in run_in_process(load(scenario, law="governed", set=told)):
        last = tick
    count = len(last.results)
    return [[result.record.samples[k].wrench.copy() for k in range(count)] for result in last.results]


@pytest.mark.parametrize(
    ("scenario", "until_s", "force", "torque"),
    [
        ("vertical_plane", 0.01, 0.01, 0.002), ("glass_transport", 0.01, 0.01, 0.002),
        ("pane_two_arms_upright", 0.01, 0.01, 0.002),
        # In motion without what turns; how two arms pull at each other no model knows.
        ("vertical_plane", 0.5, 0.025, 0.01), ("glass_transport", 0.5, 0.025, 0.01),
    ],
)  # fmt: skip
def test_model_load_matches_sensor(scenario: str, until_s: float, force: float, torque: float) -> None:
    """That of each contact on the axes of its own pad."""
    pairs = zip(loads(scenario, "none", until_s), loads(scenario, "sensor", until_s), strict=True)
    for model, measured in pairs:
        beyond = np.abs(np.array(model) - np.array(measured))
        assert beyond[:, :3].max() < force
        assert beyond[:, 3:].max() < torque


def test_simulation_without_wrench_sensor() -> None:
    """So neither bridge nor recorder waits for a subscription to its topic."""
    world = load("paper_planar", law="governed", sensor="event_1000", set=("controller.wrench.source=none",))
    assert world.bridge.sensors.wrench.silent
    assert not load("paper_planar", law="governed").bridge.sensors.wrench.silent
