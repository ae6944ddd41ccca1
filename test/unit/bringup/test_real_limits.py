"""Every shipped scenario runs inside the real limits of the arm with every controller; the printed law may not."""

from __future__ import annotations

import numpy as np
import pytest

from slip_vic.run.in_process import run_in_process
from slip_vic.scenarios import scenario_names
from slip_vic.scenarios.scenario import load
from slip_vic_controller.robot import Robot
from slip_vic_controller.safety.conditions import Mode
from slip_vic_controller.safety.limits import BRAKE_SHARE

EFFORT_RATE = 1000.0
"""[N m/s], of such arms."""
LONG_ENOUGH = "bridge.duration_s=2.5"
"""All paths have ended by then."""


@pytest.mark.parametrize("name", scenario_names(1))
@pytest.mark.parametrize("law", ["classical", "vic", "governed"])
def test_runs_stay_within_arm_limits(name: str, law: str) -> None:
    scenario = load(name, law=law, set=(LONG_ENOUGH,))
    params = scenario.controller
    robot = Robot(scenario.urdf, params.ee_frame, params.joint_names, params.gravity)
    ticks, n = list(run_in_process(scenario)), len(params.joint_names)
    wanted = np.array([tick.result.record.wanted[:n] for tick in ticks])
    velocity = np.array([tick.outputs.arms[0].joint.velocity for tick in ticks])
    follows = np.array([tick.result.record.ok != 0 for tick in ticks])[1:]
    assert np.abs(np.diff(wanted, axis=0)[follows]).max() / params.control_period_s < EFFORT_RATE
    assert np.abs(wanted / robot.effort_limit).max() < 1.0
    assert np.abs(velocity / robot.velocity_limit).max() < BRAKE_SHARE
    assert not any(tick.result.record.saturated[:n].any() for tick in ticks)
    assert (ticks[-1].result.mode, ticks[-1].result.reason) == (Mode.ACTIVE, "")
