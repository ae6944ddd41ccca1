"""Other slip sensors, a gripper that follows, two arms: over DDS they are bit for bit what they are in one process."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from slip_bags.reader import Bag
from slip_core.arms import prefix_of
from slip_core.stamps import stamp_to_ns
from slip_vic.replay.run_data import read_run
from slip_vic.replay.verify import verify_run
from slip_vic.run.in_process import run_in_process
from slip_vic.scenarios.scenario import load
from test.system.conftest import record

LESS = (
    "bridge.friction.mu_s=0.2", "bridge.friction.mu_k=0.15", "bridge.sensors.slip.latency_s=0.02",
    "bridge.sensors.slip.rate_hz=120.0", "controller.slip_delay_s=0.005",
)  # fmt: skip
RUNS = {
    "flag": ("slip_input=flag", "controller.effort.gravity=include", "grip.control=follow", "grip.lag_s=0.02", *LESS),
    "displacement": ("slip_input=displacement", *LESS),
    "two arms": (
        "controller.trajectory.start_s=0.0", "right.controller.publish_effort_array=true",
        "bridge.sensors.slip.rate_hz=120.0", "left.bridge.sensors.slip.latency_s=0.004",
        "right.bridge.sensors.wrench.noise_force=0.05", "bridge.sensors.joint.noise_position=1e-6",
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", ["flag", "displacement", pytest.param("two arms", marks=pytest.mark.smoke)])
def test_dds_equals_in_process(tmp_path: Path, kind: str) -> None:
    name, law = ("pane_two_arms_upright", "vic") if kind == "two arms" else ("paper_planar", "governed")
    loaded = load(name, law=law, seed=5, set=(*RUNS[kind], "bridge.duration_s=0.3"))
    ticks = list(run_in_process(loaded))
    bag = Bag(record(tmp_path, loaded).bag)
    assert verify_run(read_run(bag)).text().startswith(f"identical: {300 * len(loaded.controllers)} cycles")
    for k, arm in enumerate(loaded.controllers):
        topics = ("effort_command", "joint_states", "controller/ledger")
        columns = [[m.value for m in bag.messages(f"/{prefix_of(arm)}{topic}")] for topic in topics]
        for tick, command, state, ledger in zip(ticks, *columns, strict=True):
            assert stamp_to_ns(command.header.stamp) == stamp_to_ns(state.header.stamp) == tick.outputs.stamp_ns
            assert np.array(state.position).tobytes() == tick.outputs.arms[k].joint.position.tobytes()
            assert np.array(command.effort).tobytes() == tick.results[k].command.numbers.tobytes()
            assert tuple(ledger.data) == (*tick.results[k].ledger, *tick.results[k].decision)
    grips = [m.value.data for m in bag.messages("/grip_command")] if "/grip_command" in bag.topics else []
    assert grips == ([tick.result.grip for tick in ticks] if kind == "flag" else [])
    assert kind != "flag" or grips[-1] > 1.2 * grips[0]
