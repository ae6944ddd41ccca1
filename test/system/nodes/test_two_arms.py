"""Two arms over DDS: bit for bit what they do in one process, every topic recorded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from slip_bags.reader import Bag
from slip_core.stamps import stamp_to_ns
from slip_vic.replay.run_data import read_run
from slip_vic.replay.verify import verify_run
from slip_vic.run.in_process import run_in_process
from slip_vic.run.judge import judge_bag
from slip_vic.run.launcher import Launcher
from slip_vic.run.recording import recorded_topics
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
                assert np.array(command.effort).tobytes() == tick.results[side].command.effort.tobytes()
            ledger = [tuple(m.value.data) for m in bag.messages(f"/{name}/controller/ledger")]
            assert ledger == [(*tick.results[side].ledger, *tick.results[side].decision) for tick in ticks]


def test_the_bag_verifies_and_notices_another_gain(recorded: tuple[Scenario, Path]) -> None:
    with Bag(recorded[1]) as bag:
        assert (
            verify_run(read_run(bag, {})).text().startswith("identical: 400 cycles, 2744 efforts")
        )  # none while slip is late
        changed = verify_run(read_run(bag, {"right.gains.kappa": 0.9}))
    assert changed.first is not None
    assert changed.first.topic == "right/effort_command"


def test_its_numbers_are_those_in_process(recorded: tuple[Scenario, Path]) -> None:
    scenario, path = recorded
    found, truth = judge_bag(path, scenario), scenario.run().verdict
    assert found.outcome == truth.outcome == "ok"
    for side in SIDES:
        assert found.arms[side]["slip_linear_peak_m"] == truth.arms[side]["slip_linear_peak_m"]
    assert found.together["internal_peak_n"] == pytest.approx(truth.together["internal_peak_n"], rel=1e-12)
    # the law's numbers are in the bag every tenth cycle
    assert found.together["object_error_m"] == pytest.approx(truth.together["object_error_m"], abs=1e-5)


def test_every_topic_is_in_the_bag(recorded: tuple[Scenario, Path]) -> None:
    scenario, path = recorded
    listed = {f"/{name.lstrip('/')}" for name, _ in recorded_topics(scenario)}
    with Bag(path) as bag:
        assert set(bag.topics) == listed
        assert {"left.urdf", "right.urdf", "controller.params.yaml", "scenario.yaml"} <= set(bag.attachments)
