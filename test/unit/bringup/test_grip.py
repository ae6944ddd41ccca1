"""Grip as a second output: it holds what the load needs, the gripper follows it, and nothing slips at full speed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slip_core.errors import InputError
from slip_sim_bridge.arm import Gripper
from slip_sim_bridge.params import GripParams
from slip_vic.presets import preset_names
from slip_vic.run.in_process import ClosedLoop
from slip_vic.scenarios.scenario import load
from slip_vic_controller.governor.grip import SINKS_S, Grip, GripConfig, squeeze
from slip_vic_controller.safety.conditions import Mode
from test.support.call import blank, call

LAG_S = 0.1


def run(scenario: str, *assignments: str, seconds: float, gripper: str = ""):
    """Return the largest slip [m], the last result and grips (commanded, taken, true) [N]."""
    given = *assignments, f"bridge.duration_s={seconds}"
    loaded = load(scenario, law="governed_follow", gripper=gripper, set=given)
    loop, slip, grips = ClosedLoop(loaded), 0.0, []
    while not loop.bridge.finished:
        outputs = loop.bridge.observe()
        result = loop.answer(outputs)[0]
        slip = max(slip, float(np.linalg.norm(outputs.truth.slip_displacement[:3])))
        grips.append((result.grip, float(result.record.governor.grip_force), outputs.arms[0].readings.grip))
        loop.bridge.advance([result.command])
        loop.bridge.simulation.set_grip_force(0, result.grip)
    return slip, result, np.array(grips)


@pytest.mark.parametrize("gripper", ["", "robotiq_2f140"])
def test_grip_follows_a_heavy_path(gripper: str) -> None:
    """Governed alone it is refused with this margin; the gripper that presses 20 N or more carries a heavy bottle."""
    scenario, margin = ("examples/heavy_bottle.yaml", "1.0") if gripper else ("vertical_plane", "0.95")
    own = f"grip.lag_s={LAG_S}", f"controller.governor.margin={margin}"
    slip, result, grips = run(scenario, *own, gripper=gripper, seconds=0.85)
    assert slip < 4e-4
    assert result.mode == Mode.ACTIVE, result.reason
    assert result.record.governor.path_s == pytest.approx(0.8, abs=1e-12), "it does not arrive when it was asked to"
    # The controller's gripper is the bridge's, a tick later.
    assert gripper or np.abs(grips[1:, 1] - grips[:-1, 2]).max() < 0.02 * grips[0, 2]
    assert result.scalars()["grip_command"] == result.grip


def test_squeeze_rises_at_once_sinks_slowly_and_only_rises_in_a_slip() -> None:
    config, grip = map(blank, (GripConfig, Grip))
    config.cap, config.least_force, config.error_force, grip.command = 10.0, 0.5, 0.1, 1.0
    for needed, slips, slides, expected in (
        (3.0, False, False, 3.1),
        (1.0, True, False, 3.1),
        (1.0, False, False, 1.1 + 2.0 * math.exp(-1e-3 / SINKS_S)),
        (1.0, True, True, (1.1 + 2.0 * math.exp(-1e-3 / SINKS_S)) * math.exp(1e-3 / SINKS_S)),
        (50.0, True, True, 10.0),
    ):
        call(squeeze, config, grip, needed, slips, slides, 1e-3)
        assert grip.command == pytest.approx(expected, rel=1e-12)
    for _ in range(1000):
        call(squeeze, config, grip, 0.0, False, False, 1e-3)
    assert grip.command == pytest.approx(0.5, abs=1e-9), "never below the least force"


def test_gripper_has_a_lag() -> None:
    for lag_s in (LAG_S, 0.0):
        gripper = Gripper(GripParams(force=1.0, lag_s=lag_s), 1e-3)
        gripper.command(3.0)
        for tick in range(1, 400):
            gripper.step()
            if lag_s > 0.0:
                assert abs(gripper.force - (3.0 - 2.0 * math.exp(-tick * 1e-3 / lag_s))) < 1e-9
    assert gripper.force == 3.0, "without lag it is what is commanded, to the last bit"
    for force in (-0.1, math.nan, math.inf):
        with pytest.raises(InputError, match="grip force"):
            gripper.command(force)
    assert gripper.force == 3.0


def test_gripper_has_steps_friction_and_a_least_force() -> None:
    gripper, found = Gripper(GripParams(force=0.1, least_force=0.5, quantum=0.2, hysteresis=0.3), 1e-3), []
    for commanded in (0.1, 2.09, 2.35, 1.75, 1.31):
        gripper.command(commanded)
        found.append(gripper.step())
    assert found == pytest.approx([0.5, 1.7, 2.1, 2.1, 1.7])


@pytest.mark.parametrize("gripper", preset_names("grippers"))
def test_preset_is_known_to_both_sides(gripper: str) -> None:
    loaded = load("paper_planar", law="governed_follow", gripper=gripper)
    simulated, known = loaded.bridge.grip, loaded.controller.grip
    assert (simulated.lag_s, simulated.least_force) == (known.lag_s, known.least_force)
    assert known.error_force >= simulated.hysteresis + 0.5 * simulated.quantum - 1e-9
    assert known.cap > known.least_force


def test_following_grip_needs_a_path() -> None:
    with pytest.raises(InputError, match=r"grip\.control follow needs a governed path"):
        load("paper_planar", law="vic", set=("controller.grip.control=follow",))
    with pytest.raises(InputError, match=r"grip\.cap"):
        load("paper_planar", law="governed_follow", set=("controller.grip.cap=0.1",))
    with pytest.raises(InputError, match=r"handover open needs a commanded grip"):
        load("paper_planar", law="governed", set=("controller.handover=open",))
