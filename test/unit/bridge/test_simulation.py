"""What drives make of commands."""

from __future__ import annotations

import math

import numpy as np

from slip_sim_bridge.session import BridgeSession
from slip_vic.scenarios.scenario import load
from test.unit.bridge.scenes import scene


def test_an_effort_changes_at_its_rate_up_to_its_limit() -> None:
    simulation = scene()
    arm, start = simulation.arm, simulation.observe().joint.effort.copy()
    arm.largest_change = 0.5
    wanted = np.array([1e3, -1e3, 0.2, -0.2, 1e3, -1e3, 0.0]) + start * [0, 0, 1, 1, 0, 0, 1]
    for k in range(300):
        simulation.step(wanted)
        expected = start + np.clip(wanted - start, -0.5 * (k + 1), 0.5 * (k + 1))
        np.testing.assert_allclose(
            simulation.observe().joint.effort, np.clip(expected, -arm.limits, arm.limits), atol=1e-9
        )


def test_a_position_leads_a_joint_by_what_its_speed_makes_good_in_a_period() -> None:
    """A loop of bandwidth K goes 1 - exp(-K T) of the way: with that lead it moves at its speed, and no faster."""
    scenario = load("paper_planar", law="vic", drive="position_250")
    arm = BridgeSession(scenario.bridges, scenario.urdfs).simulation.arms[0]
    period, bandwidth = scenario.bridge.control_period_s, scenario.bridge.drive.bandwidth
    posture = 0.5 * (arm.joints.lower + arm.joints.upper)
    for sign in (1.0, -1.0):
        way = arm.followable(posture + 9.0 * sign, posture) - posture
        np.testing.assert_allclose(way * (1.0 - math.exp(-bandwidth * period)), sign * arm.joints.speed * period)
    near = posture + 1e-4
    np.testing.assert_array_equal(arm.followable(near, posture), near)
    assert (arm.followable(arm.joints.upper + 1.0, arm.joints.upper - 1e-3) == arm.joints.upper).all()
