"""Grip as a second output: it follows the path ahead, the gripper follows it, and nothing slips at full speed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slip_core.errors import InputError
from slip_sim_bridge.gripper import Gripper
from slip_sim_bridge.params import GripParams
from slip_vic.run.in_process import ClosedLoop
from slip_vic.scenarios.scenario import load_scenario
from slip_vic_controller.safety.modes import Mode

LAG_S = 0.1
FOLLOW = ("grip.control=follow", f"grip.lag_s={LAG_S}", "controller.governor.margin=0.95")
SLIP_M = 4e-4


def run(scenario: str, *assignments: str, seconds: float):
    """Return the largest slip [m], the last result, grips (commanded, taken, true) [N] and loads over friction."""
    loaded = load_scenario(
        scenario, law="governed", assignments=(*FOLLOW, *assignments, f"bridge.duration_s={seconds}")
    )
    loop, slip, grips, loads = ClosedLoop(loaded), 0.0, [], []
    while not loop.bridge.finished:
        outputs = loop.observe()
        result = loop.control(outputs)
        governor = result.record.governor
        slip = max(slip, float(np.linalg.norm(outputs.truth.slip_displacement[:3])))
        grips.append((result.grip, float(governor.grip_force), loop.bridge.simulation.arms[0].gripper.force))
        loads.append(float(governor.load_ratio))
        loop.bridge.advance([result.command])
        loop.bridge.simulation.set_grip_force(0, result.grip)
    return slip, result, np.array(grips), np.array(loads)


def test_grip_follows_a_heavy_path() -> None:
    """Governed alone it is refused with this margin."""
    slip, result, grips, loads = run("vertical_plane", seconds=0.85)
    governor = result.record.governor
    assert slip < SLIP_M
    assert result.mode == Mode.ACTIVE, result.reason
    assert governor.path_s == pytest.approx(0.8, abs=1e-12), "it does not arrive when it was asked to"
    assert loads.max() <= 1.0 + 1e-9
    assert 1.0 < grips[:, 2].max() / grips[0, 2] < 3.0
    # The controller's gripper is the bridge's, a tick later.
    assert np.abs(grips[1:, 1] - grips[:-1, 2]).max() < 0.02 * grips[0, 2]
    assert result.scalars()["grip_command"] == result.grip


def test_gripper_has_a_lag() -> None:
    for lag_s in (LAG_S, 0.0):
        gripper = Gripper(GripParams(force=1.0, lag_s=lag_s), 1e-3)
        gripper.command(3.0)
        for tick in range(1, 400):
            gripper.step()
            if lag_s > 0.0:
                assert abs(gripper.force - (3.0 - 2.0 * math.exp(-tick * 1e-3 / lag_s))) < 1e-9
    assert gripper.force == 3.0, "without lag it is what is commanded, to the last bit"
    with pytest.raises(InputError, match="grip force"):
        gripper.command(-1.0)


def test_following_grip_needs_a_path() -> None:
    with pytest.raises(InputError, match=r"grip\.control follow needs a path"):
        load_scenario("paper_planar", assignments=("controller.grip.control=follow",))
    with pytest.raises(InputError, match="force_limit"):
        load_scenario("paper_planar", law="governed", assignments=(*FOLLOW, "controller.grip.force_limit=0.1"))
