"""Other slip sensors, a gripper that follows and goals, over DDS."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from slip_bags.reader import Bag
from slip_vic.replay.run_data import read_run
from slip_vic.replay.verify import verify_run
from slip_vic.run.in_process import run_in_process
from slip_vic.scenarios.scenario import load_scenario
from test.system.conftest import record

LESS = ("bridge.friction.mu_s=0.2", "bridge.friction.mu_k=0.15", "bridge.sensors.slip.latency_s=0.01")
RUNS = {
    "flag": ("slip_input=flag", "controller.effort.gravity=include", "grip.control=follow", "grip.lag_s=0.02", *LESS),
    "displacement": ("slip_input=displacement", *LESS),
}


@pytest.mark.parametrize("kind", RUNS)
def test_dds_equals_in_process(tmp_path: Path, kind: str) -> None:
    loaded = load_scenario("paper_planar", law="governed", assignments=(*RUNS[kind], "bridge.duration_s=0.3"))
    recording = record(tmp_path, loaded)
    with Bag(recording.bag) as bag:
        commands = [m.value for m in bag.messages("/effort_command")]
        grips = [m.value.data for m in bag.messages("/grip_command")] if "/grip_command" in bag.topics else []
        verdict = verify_run(read_run(bag))
    ticks = list(run_in_process(loaded))
    assert [np.array(m.effort).tobytes() for m in commands] == [t.result.command.numbers.tobytes() for t in ticks]
    assert verdict.text().startswith("identical: 300 cycles")
    assert grips == ([t.result.grip for t in ticks] if kind == "flag" else [])
    assert kind != "flag" or grips[-1] > 1.2 * grips[0]
