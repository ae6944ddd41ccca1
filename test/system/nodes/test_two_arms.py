"""Two arms over DDS: bit for bit what they do in one process, every topic recorded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from slip_bags.reader import Bag
from slip_core.stamps import stamp_to_ns
from slip_vic.run.in_process import run_in_process
from slip_vic.run.launcher import Launcher
from slip_vic.scenarios.scenario import Scenario, load_scenario

SIDES = ("left", "right")
NOISY = (
    "bridge.duration_s=0.2",
    "controller.trajectory.start_s=0.0",
    "right.controller.publish_effort_array=true",
    "bridge.sensors.slip.rate_hz=120.0",
    "left.bridge.sensors.slip.latency_s=0.004",
    "right.bridge.sensors.wrench.noise_force=0.05",
    "bridge.sensors.joint.noise_position=1e-6",
)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Scenario, Path]:
    scenario, bag = (
        load_scenario("pane_two_arms_upright", seed=5, assignments=NOISY),
        tmp_path_factory.mktemp("two") / "bag",
    )
    assert Launcher(scenario, bag=bag).run().lost == 0
    return scenario, bag


@pytest.mark.smoke
def test_dds_equals_in_process(recorded: tuple[Scenario, Path]) -> None:
    scenario, path = recorded
    ticks = list(run_in_process(scenario))
    with Bag(path) as bag:
        for side, name in enumerate(SIDES):
            commands = [m.value for m in bag.messages(f"/{name}/effort_command")]
            states = [m.value for m in bag.messages(f"/{name}/joint_states")]
            assert len(commands) == len(states) == len(ticks) == 200
            for tick, command, state in zip(ticks, commands, states, strict=True):
                assert stamp_to_ns(command.header.stamp) == stamp_to_ns(state.header.stamp) == tick.outputs.stamp_ns
                assert np.array(state.position).tobytes() == tick.outputs.arms[side].joint.position.tobytes()
                assert np.array(command.effort).tobytes() == tick.results[side].command.numbers.tobytes()
            ledger = [tuple(m.value.data) for m in bag.messages(f"/{name}/controller/ledger")]
            assert ledger == [(*tick.results[side].ledger, *tick.results[side].decision) for tick in ticks]
